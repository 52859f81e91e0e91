"""Seeding makes proposals, which are polytopes around a seed that are worth certifying."""
