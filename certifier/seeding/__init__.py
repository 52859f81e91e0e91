"""Proposals: polytopes around a seed that are worth certifying."""
