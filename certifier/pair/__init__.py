"""The pair program (11): one pair of bodies certified on one polytope."""
