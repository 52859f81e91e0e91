"""The pair program (11) certifies one pair of bodies on one polytope."""
