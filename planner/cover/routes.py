"""Finds a collision-free route between two sets of configurations: a straight line in s, or else two trees that grow towards each other.

The trees are those of RRT-Connect (Kuffner and LaValle, 2000), with many branches tried at a time, because many configurations are tested
together far more quickly than one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from certifier.model import Array, Scene
from planner.cover.ground import Collides, sees

NEAREST = 20
"""Number of pairs of a start and an end that are tried by straight lines, the nearest ones."""
ROUNDS, BRANCHES = 80, 24
"""The trees grow in ROUNDS, by BRANCHES each."""
STEP = 0.15
"""A branch is no longer than this part of the joint limits' diagonal, in s."""
FINE = 6
"""Lines of a route are free at 2^FINE - 1 points."""
SHORTCUTS = 40


def routes(scene: Scene, collides: Collides, starts: Array, ends: Array, rng: np.random.Generator) -> Iterator[Array]:
    """Yields the corners, (k, n) in s, of routes from one of the starts (a, n) to one of the ends (b, n).

    Straight lines come first, the shortest of them before the others, and then one that trees have found. If there is none, that does not
    mean that no route exists.
    """
    distances = np.linalg.norm(starts[:, None] - ends[None], axis=2)
    i, j = np.unravel_index(np.argsort(distances, axis=None)[:NEAREST], distances.shape)
    yield from straight(collides, starts[i], ends[j])
    found = _grow(scene, collides, starts, ends, rng)
    if found is not None:
        yield _shortened(collides, found, rng)


def straight(collides: Collides, starts: Array, ends: Array) -> list[Array]:
    """Returns the ends, (2, n), of those of the lines in s from starts to ends, (k, n) each, that are free."""
    return [np.stack([starts[i], ends[i]]) for i in np.flatnonzero(sees(collides, starts, ends, FINE))]


class _Tree:
    """Holds points in s, each with the number of the point from which it was reached; -1 for a root."""

    def __init__(self, roots: Array) -> None:
        self.points, self.parents = roots, np.full(len(roots), -1)

    def nearest(self, targets: Array) -> np.ndarray:
        distances: np.ndarray = ((self.points[None] - targets[:, None]) ** 2).sum(axis=2)
        return distances.argmin(axis=1)

    def add(self, points: Array, parents: np.ndarray) -> None:
        self.points, self.parents = np.concatenate([self.points, points]), np.concatenate([self.parents, parents])

    def back(self, node: int) -> list[Array]:
        """Returns the points from a node back to its root."""
        way = []
        while node >= 0:
            way.append(self.points[node])
            node = int(self.parents[node])
        return way


def _grow(scene: Scene, collides: Collides, starts: Array, ends: Array, rng: np.random.Generator) -> Array | None:
    first, second = _Tree(starts), _Tree(ends)
    reach = STEP * float(np.linalg.norm(scene.s_upper - scene.s_lower))
    for turn in range(ROUNDS):
        tree, other = (first, second) if turn % 2 == 0 else (second, first)
        targets = scene.to_s(rng.uniform(scene.q_lower, scene.q_upper, (BRANCHES, scene.n)))
        targets[: BRANCHES // 4] = other.points[rng.integers(len(other.points), size=BRANCHES // 4)]
        parents = tree.nearest(targets)
        moves = targets - tree.points[parents]
        lengths = np.linalg.norm(moves, axis=1, keepdims=True)
        tips = tree.points[parents] + moves * np.minimum(1.0, reach / np.maximum(lengths, 1e-12))
        free = ~collides(tips)
        free[free] = sees(collides, tree.points[parents[free]], tips[free], FINE - 1)
        tree.add(tips[free], parents[free])
        tips = tips[free]
        if not len(tips):
            continue
        across = other.nearest(tips)
        meets = np.flatnonzero(sees(collides, tips, other.points[across], FINE))
        if len(meets):
            here = tree.back(len(tree.points) - len(tips) + int(meets[0]))[::-1]
            there = other.back(int(across[meets[0]]))
            both = np.array([*here, *there])
            return both if tree is first else both[::-1]
    return None


def _shortened(collides: Collides, corners: Array, rng: np.random.Generator) -> Array:
    """Returns a route without the corners that a straight line may leave out."""
    for _ in range(SHORTCUTS):
        if len(corners) <= 2:
            break
        i, j = sorted(rng.choice(len(corners), 2, replace=False).tolist())
        if j - i > 1 and sees(collides, corners[i : i + 1], corners[j : j + 1], FINE)[0]:
            corners = np.concatenate([corners[: i + 1], corners[j:]])
    return corners


def along(corners: Array, spacing: float) -> Array:
    """Returns points of a route, (m, n), no farther apart than the spacing, the corners among them."""
    parts = [corners[:1]]
    for a, b in pairwise(corners):
        count = max(int(np.ceil(np.linalg.norm(b - a) / spacing)), 1)
        parts.append(a + np.arange(1, count + 1)[:, None] / count * (b - a))
    return np.concatenate(parts)
