"""The verifier: exact re-checks of proofs. It imports neither the pair solver nor the polytope step; data types only."""
