"""Seeding makes proposals, which are polytopes around a seed that are worth certifying."""

PROPOSE = "certifier.seeding.propose:propose_in_child"
"""A child process makes proposals with this function."""
