"""A cell of a partition, while the search works on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.model import Array
from certifier.partition.area import Area
from certifier.partition.tree import Node


@dataclass
class Cell:
    """A cell is a box in s with what is known of the polytope in it.

    Attributes:
        node: its node in the tree.
        lower, upper: (n,) its bounds; joints that do not move one body against the other have those of the root cell.
        points: (p, n) points of the polytope in the cell.
        samples: (S, n) those of the area's samples that lie in the cell.
        coarse: coarse volumes are tried first.
    """

    node: Node
    lower: Array
    upper: Array
    points: Array
    samples: Array
    coarse: bool = True

    @property
    def mid(self) -> Array:
        """Returns the middle, (n,)."""
        return (self.lower + self.upper) / 2

    @property
    def half(self) -> Array:
        """Returns the half edges, (n,)."""
        return (self.upper - self.lower) / 2

    def faces(self, area: Area) -> tuple[Array, Array]:
        """Returns the faces of the polytope, then the upper and the lower ones of the cell, with normals of length 1."""
        eye = np.eye(len(self.lower))
        return np.concatenate([area.unit.C, eye, -eye]), np.concatenate([area.unit.d, self.upper, -self.lower])

    def turn(self, area: Area) -> Array:
        """Returns how far every joint turns in the cell, (n,), in radians or metres."""
        turn: Array = np.where(area.scene.revolute, 2 * (np.arctan(self.upper) - np.arctan(self.lower)), self.upper - self.lower)
        return turn
