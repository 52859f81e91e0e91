"""Whole jobs run here without the service: grow a region, certify a polytope, ask Drake. A region's proof and manifest are made here."""
