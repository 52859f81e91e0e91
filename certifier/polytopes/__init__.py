"""Polytopes {s : C s <= d}: bounds, redundancy, the inscribed ellipsoid, samples."""
