"""Which trees a map has, and which configurations each of them is grown for.

The geometries of a rigid part are a hierarchy: all of them, halves of them, and so on to each alone. A cell in which volumes around many
of them are apart is proved for every pair between them. So each sample goes to the fattest volumes that are apart there. Of two parts, the
wider one is divided first: boards that fill a room before a hand that is small beside them.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Geometry, Pair, Scene, Volume
from certifier.partition.together import gaps_between, halves, placed, volumes_of

ROOM = 0.05
"""Volumes of several geometries are apart for a sample if they are apart by this, in metres."""
SHARE = 0.01
"""They get a tree of their own if they are apart at this share of all samples."""
FEW_JOINTS = 5
"""And if at most this many joints move the fattest volumes of this tree. With more joints it takes far more cells than the trees of halves,
whose fat volumes are apart more often."""

Pairs = tuple[Pair, ...]
"""The pairs of one tree."""
Geometries = list[Geometry]
Names = tuple[str, ...]


class Plan:
    """Says which trees configurations are for, and which configurations are free of collision.

    Volumes of several geometries get a tree if they are apart at SHARE of the first configurations that are assigned, and if it has
    fat volumes that at most FEW_JOINTS joints move.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene, self._known = scene, {frozenset((pair.a, pair.b)): pair for pair in scene.pairs}
        self._volumes: dict[tuple[Names, Names], tuple[Volume, Volume] | None] = {}
        self._reaches: dict[Names, float] = {}
        self._chosen: set[Pairs] | None = None
        self._parts = list(itertools.combinations(_rigid_parts(scene), 2))

    def free(self, samples: Array) -> Array:
        """Returns which configurations, (S, n) in s, are shown to be free of collision, padding included, (S,)."""
        left = np.arange(len(samples))
        for first, second in self._parts:
            left = np.setdiff1d(left, self._touching(first, second, samples, left))
        return np.isin(np.arange(len(samples)), left)

    def assigned(self, samples: Array, joints: Callable[[Pairs], int]) -> dict[Pairs, Array]:
        """Returns which configurations each tree is for, by their numbers; a configuration has one tree for each pair.

        Args:
            samples: (S, n) in s, free of collision.
            joints: says how many joints move the fattest volumes that a tree of some pairs has.
        """
        found: dict[Pairs, Array] = {}
        chosen: set[Pairs] = set()
        for first, second in self._parts:
            self._assign(first, second, samples, np.arange(len(samples)), joints, found, chosen)
        if self._chosen is None:
            self._chosen = chosen
        return found

    def _assign(
        self,
        first: Geometries,
        second: Geometries,
        samples: Array,
        numbers: Array,
        joints: Callable[[Pairs], int],
        found: dict[Pairs, Array],
        chosen: set[Pairs],
    ) -> None:
        pairs = self._between(first, second)
        if not pairs or not len(numbers):
            return
        if len(first) * len(second) == 1:
            found[pairs] = numbers
            return
        if self._chosen is None or pairs in self._chosen:
            room = self._gaps(first, second, samples[numbers])
            settled = self._chosen is not None
            if room is not None and (settled or ((room > ROOM).sum() >= SHARE * len(samples) and joints(pairs) <= FEW_JOINTS)):
                chosen.add(pairs)
                if (room > ROOM).any():
                    found[pairs] = numbers[room > ROOM]
                numbers = numbers[room <= ROOM]
        for one, other in self._divided(first, second):
            self._assign(one, other, samples, numbers, joints, found, chosen)

    def _touching(self, first: Geometries, second: Geometries, samples: Array, numbers: Array) -> Array:
        """Returns the numbers of configurations at which two of the geometries are not shown to be apart."""
        if not self._between(first, second) or not len(numbers):
            return numbers[:0]
        room = self._gaps(first, second, samples[numbers])
        numbers = numbers if room is None else numbers[room <= 0]
        if len(first) * len(second) == 1:
            return numbers
        return np.concatenate([self._touching(*parts, samples, numbers) for parts in self._divided(first, second)])

    def _between(self, first: Geometries, second: Geometries) -> Pairs:
        asked = (self._known.get(frozenset((a.name, b.name))) for a in first for b in second)
        return tuple(pair for pair in asked if pair is not None)

    def _divided(self, first: Geometries, second: Geometries) -> list[tuple[Geometries, Geometries]]:
        """Returns the halves of the geometries that reach farther, each with all of the others."""
        larger, other = sorted((first, second), key=self._reach, reverse=True)
        return [(half, other) for half in halves(Kinematics.of(self._scene), larger)]

    def _reach(self, geometries: Geometries) -> float:
        """Returns the diagonal of the box around the vertices of geometries, in metres; -1 for a single one, which has no halves."""
        if len(geometries) == 1:
            return -1.0
        names = tuple(geometry.name for geometry in geometries)
        if names not in self._reaches:
            points = np.concatenate(placed(Kinematics.of(self._scene), geometries, geometries[0].body))
            self._reaches[names] = float(np.linalg.norm(np.ptp(points, axis=0)))
        return self._reaches[names]

    def _gaps(self, first: Geometries, second: Geometries, samples: Array) -> Array | None:
        """Returns how far the volumes around geometries are apart, in metres; None where not all between them are pairs of one padding."""
        key = tuple(geometry.name for geometry in first), tuple(geometry.name for geometry in second)
        if key not in self._volumes:
            pairs = self._between(first, second)
            same = len(pairs) == len(first) * len(second) and len({self._scene.padding_of(pair) for pair in pairs}) == 1
            self._volumes[key] = volumes_of(self._scene, pairs) if same else None
        volumes = self._volumes[key]
        return None if volumes is None else gaps_between(self._scene, *volumes, samples)


def _rigid_parts(scene: Scene) -> list[list[Geometry]]:
    """Returns the geometries that pairs are about, together where they have the same rigid part and radius; in the world, the same body."""
    kinematics, found = Kinematics.of(scene), dict[tuple[str, float], list[Geometry]]()
    for name in dict.fromkeys(name for pair in scene.pairs for name in (pair.a, pair.b)):
        geometry = scene.geometry(name)
        root = kinematics.rigid_root(geometry.body)
        found.setdefault((geometry.body if root == WORLD else root, geometry.radius), []).append(geometry)
    return list(found.values())
