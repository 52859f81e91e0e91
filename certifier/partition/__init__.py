"""A pair is certified over a partition of the polytope: the search for cells, planes and multipliers is here."""
