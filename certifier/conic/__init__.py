"""Weighted sums of squares are treated here as cones, with the interior-point methods over them."""
