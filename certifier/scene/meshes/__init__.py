"""Mesh files are read strictly here, each format by its own reader."""
