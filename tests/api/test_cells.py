"""Pairs and cells of regions and jobs, workers and obstacles over HTTP, on regions that were really grown."""
