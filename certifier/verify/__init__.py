"""The verifier checks proofs again, exactly. It imports data types only: neither the pair solver nor the polytope step."""
