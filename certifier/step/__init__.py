"""The polytope step (12): all pairs coupled, the faces move."""
