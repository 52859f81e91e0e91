"""Pairs with the same coarse volumes share here what was found for them in a cell, because it does not depend on the pair.

What is found in a cell is a function of the polytope, the volumes, the cell and the points that are known in it. So it does not matter to
the result which pairs a process was asked for before.
"""

from __future__ import annotations

import hashlib

from cachetools import LRUCache

from certifier.model import Array, Volume
from certifier.partition.area import Area
from certifier.partition.bodies import Bodies, Separated, Undecided
from certifier.partition.cell import Cell

MOST = 2000
"""What was found is kept for at most this many cells."""


class Shared:
    """Holds the coarse volumes of the pairs of one polytope, and what was found for them."""

    def __init__(self, area: Area) -> None:
        self._area = area
        self._bodies: dict[tuple[object, ...], Bodies] = {}
        self._tried: LRUCache[bytes, Separated | Undecided] = LRUCache(MOST)

    def bodies(self, frame: str, volumes: tuple[Volume, Volume]) -> Bodies:
        """Returns two volumes as bodies, the same ones for volumes of one shape and padding, whatever geometries they stand for."""
        shapes = ((volume.body, volume.vertices.tobytes(), volume.radius) for volume in volumes)
        key = frame, self._area.scene.padding_between(volumes), *shapes
        if key not in self._bodies:
            self._bodies[key] = Bodies(self._area, frame, volumes)
        return self._bodies[key]

    def tried(self, bodies: Bodies, cell: Cell, start: Array) -> Separated | Undecided:
        """Returns what is found for two of these bodies in a cell; ``start`` is a point of the polytope in it."""
        parts = (cell.lower, cell.upper, start, cell.points)
        key = hashlib.blake2b(id(bodies).to_bytes(8, "little") + b"".join(part.tobytes() for part in parts), digest_size=16).digest()
        if key not in self._tried:
            self._tried[key] = bodies.separate(cell, start)
        return self._tried[key]
