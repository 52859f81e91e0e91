"""Concave meshes become convex parts here, where a scene file asks for it."""
