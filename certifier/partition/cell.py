"""A cell of a partition, while the search works on it."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import cached_property

from certifier.model import Array
from certifier.partition.area import Area, Inside
from certifier.partition.tree import Node

KEPT = 200
"""A cell begins with, or inherits, at most this many points."""


@dataclass
class Cell:
    """A cell is a box in s with what is known of the polytope in it.

    Attributes:
        area: the polytope and what is known of it.
        node: its node in the tree.
        lower, upper: (n,) its bounds; joints that do not move one body against the other have those of the root cell.
        points: (p, n) points of the polytope in the cell.
        samples: (S, n) those of the area's samples that lie in the cell.
    """

    area: Area
    node: Node
    lower: Array
    upper: Array
    points: Array
    samples: Array

    @classmethod
    def at(cls, area: Area, node: Node, lower: Array, upper: Array, samples: Array) -> Cell:
        """Returns a cell of which no more is known than the samples in it."""
        return cls(area, node, lower, upper, samples[:KEPT], samples)

    @property
    def mid(self) -> Array:
        """Returns the middle, (n,)."""
        return (self.lower + self.upper) / 2

    @property
    def half(self) -> Array:
        """Returns the half edges, (n,)."""
        return (self.upper - self.lower) / 2

    @cached_property
    def inside(self) -> Inside:
        """Holds the part of the polytope in the cell."""
        return self.area.inside(self.lower, self.upper)

    @property
    def seed(self) -> int:
        """Returns a number for random choices in this cell, the same for every pair."""
        return zlib.crc32(self.lower.tobytes() + self.upper.tobytes())

    def turn(self) -> Array:
        """Returns how far every joint turns in the cell, (n,), in radians or metres."""
        return self.area.scene.turn(self.lower, self.upper)
