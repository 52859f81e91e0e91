"""Collisions are checked here in floating point, by compiled loops: at a configuration, and all along a straight line."""
