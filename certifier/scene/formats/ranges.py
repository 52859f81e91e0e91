"""These are the ranges of the numbers that models may have. Beyond them, double precision fails Drake, Qhull or the certifier."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from certifier.positions import MAGNITUDE


@dataclass(frozen=True)
class Range:
    """A range holds the numbers whose magnitudes are from ``least`` to ``most``."""

    least: float
    most: float

    def __str__(self) -> str:
        return f"from {self.least:g} to {self.most:g}"

    def outside(self, numbers: Iterable[float]) -> float | None:
        """Returns the first number whose magnitude is outside of the range, or None."""
        return next((number for number in numbers if not self.least <= abs(number) <= self.most), None)


POSITION = Range(0.0, MAGNITUDE)
"""Positions in metres, angles, and what mimic joints add and multiply."""
SIZE = Range(1e-9, MAGNITUDE)
"""Sizes of shapes, in metres."""
SCALE = Range(1e-8, 1e9)
"""Factors of meshes; Drake takes no smaller ones."""
DIRECTION = Range(1e-6, 1e6)
"""Lengths of axes and normals; Drake makes them 1."""
RANGE_HINT = "mend the number; lengths are in metres"
