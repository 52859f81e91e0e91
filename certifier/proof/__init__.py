"""Proofs are held here as data and as files. Nothing here decides whether a proof holds: certifier.verify does."""
