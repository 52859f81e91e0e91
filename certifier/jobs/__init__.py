"""Whole jobs without the service: grow a region, certify a polytope, ask Drake; and the region that comes of it."""
