"""Bounds, redundancy, the inscribed ellipsoid and samples of polytopes {s : C s <= d} are computed here."""
