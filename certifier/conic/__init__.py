"""Weighted sums of squares as cones, and the interior-point methods over them."""
