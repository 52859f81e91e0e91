"""The broad phase puts boxes around several geometries of one link, so that one program settles many pairs.

Every rigid part of the scene has a tree of boxes along its axes, down to single geometries. For a pair, the search goes down the two
trees together from their roots. Where two boxes are clearly apart at the samples, the program is tried for them, and what it proves
covers all pairs between their geometries. So obstacles that are far away are settled by the hundred, and near ones one by one.

What is tried for a pair does not depend on which pairs were asked for before.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import lru_cache
from typing import Generic, TypeVar

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import Array, Geometry, Pair, Volume

MANY_VERTICES = 16
"""A single geometry with more vertices than this is tried by its box first."""
ROUNDING = 1e-9

Volumes = tuple[Volume, Volume]
R = TypeVar("R")


@dataclass(frozen=True, eq=False)
class Node:
    """A node is a volume and the nodes that it is divided into; a leaf is one geometry as it is."""

    volume: Volume
    children: tuple[Node, ...]

    def child(self, name: str) -> Node:
        """Returns the child that holds this geometry."""
        return next(child for child in self.children if name in child.volume.geometries)

    @property
    def extent(self) -> float:
        """Returns the length of the box's diagonal in metres; 0 for a leaf, which cannot be divided."""
        return float(np.linalg.norm(np.ptp(self.volume.vertices, axis=0))) if self.children else 0.0


class BroadPhase(Generic[R]):
    """Searches the trees of one scene and remembers what has been tried with them.

    Args:
        attempt: gives the result for two volumes, or None when it is better to divide them.
    """

    def __init__(self, kinematics: Kinematics, attempt: Callable[[Volumes], R | None]) -> None:
        self._attempt = attempt
        self._partners, self._root = _trees(kinematics)
        self._tried: dict[tuple[Node, Node], R | None] = {}

    def find(self, pair: Pair, names: Collection[str] = ()) -> R | None:
        """Returns the result for the largest volumes that have one and hold the pair; None when the pair has to be settled by itself.

        Args:
            names: other geometries that the volumes have to hold as well.
        """
        ((_, a), first), ((_, b), second) = sorted(((self._root[name], name) for name in (pair.a, pair.b)), key=lambda root: root[0][0])
        while (a.children or b.children) and {*names} <= {*a.volume.geometries, *b.volume.geometries}:
            if (a, b) not in self._tried:
                self._tried[a, b] = self._attempt((a.volume, b.volume)) if self._worth_it(a, b) else None
            if (found := self._tried[a, b]) is not None:
                return found
            if a.extent >= b.extent:
                a = a.child(first)
            else:
                b = b.child(second)
        return None

    def _worth_it(self, a: Node, b: Node) -> bool:
        """Returns whether the volumes stand for several pairs, or for one pair with fewer vertices."""
        others = set(b.volume.geometries)
        pairs = sum(len(self._partners[name] & others) for name in a.volume.geometries)
        return pairs > 1 or max(len(a.volume.geometries), len(b.volume.geometries)) == 1


@lru_cache(maxsize=8)
def _trees(kinematics: Kinematics) -> tuple[dict[str, set[str]], dict[str, tuple[int, Node]]]:
    """Returns two mappings by a geometry's name: the geometries that it makes a pair with; the number and the root of its tree."""
    partners: dict[str, set[str]] = {}
    for pair in kinematics.scene.pairs:
        partners.setdefault(pair.a, set()).add(pair.b)
        partners.setdefault(pair.b, set()).add(pair.a)
    parts: dict[str, list[Geometry]] = {}
    for geometry in map(kinematics.scene.geometry, partners):
        parts.setdefault(kinematics.rigid_root(geometry.body), []).append(geometry)
    roots: dict[str, tuple[int, Node]] = {}
    for number, (body, geometries) in enumerate(parts.items()):
        root = _tree(kinematics, body, geometries)
        roots |= {geometry.name: (number, root) for geometry in geometries}
    return partners, roots


def _tree(kinematics: Kinematics, body: str, geometries: list[Geometry]) -> Node:
    """Returns the root of the tree over the geometries of one rigid part, with boxes in the frame of ``body``."""
    vertices = [kinematics.points(body, g.body, g.vertices, np.zeros((1, kinematics.scene.n)))[0] for g in geometries]
    lower = np.array([v.min(axis=0) - g.radius for v, g in zip(vertices, geometries, strict=True)])
    upper = np.array([v.max(axis=0) + g.radius for v, g in zip(vertices, geometries, strict=True)])

    def node(members: Array) -> Node:
        box = _box(body, [geometries[i].name for i in members], lower[members].min(axis=0), upper[members].max(axis=0))
        if len(members) == 1:
            leaf = Node(Volume.of(geometries[members[0]]), ())
            return Node(box, (leaf,)) if len(leaf.volume.vertices) > MANY_VERTICES else leaf
        centers = (lower[members] + upper[members]) / 2
        order = members[np.argsort(centers[:, np.argmax(np.ptp(centers, axis=0))], kind="stable")]
        half = len(order) // 2
        return Node(box, (node(order[:half]), node(order[half:])))

    return node(np.arange(len(geometries)))


def _box(body: str, names: list[str], lower: Array, upper: Array) -> Volume:
    """Returns the corners of the box, made a little larger for the rounding of the frames between welded bodies."""
    slack = ROUNDING * (1 + np.abs(lower) + np.abs(upper))
    corners = np.array(list(itertools.product(*zip(lower - slack, upper + slack, strict=True))))
    return Volume(tuple(names), body, corners, 0.0)
