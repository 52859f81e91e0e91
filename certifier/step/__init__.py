"""The polytope step (12) moves the faces of a region, with all pairs coupled."""
