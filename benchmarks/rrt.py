"""RRT-Connect with shortcuts plans motions as people plan them without certified regions (Kuffner and LaValle, ICRA 2000).

It stands beside our planner in ``ciris bench plan``. Drake's checker looks at configurations along each straight line, so what is between
them is not known.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from certifier.model import Array, Scene
from certifier.seeding.iris import checker

STRIDE = 0.5
"""A tree grows by steps of at most this length in q."""
RESOLUTION = 0.05
"""A straight line is looked at in steps of at most this length in q, in radians and metres: 2.9 degrees where one joint turns."""
SHORTCUTS = 200
"""This many shortcuts between random points of the path are tried."""


@dataclass(frozen=True, eq=False)
class Found:
    """A path (k, n), straight in q between its rows, or None; and the seconds until the first path, and with the shortcuts."""

    path: Array | None
    first_seconds: float
    seconds: float


class RRTConnect:
    """Plans in the scene, within its joint limits."""

    def __init__(self, scene: Scene) -> None:
        self._lower, self._upper = scene.q_lower, scene.q_upper
        self._checker = checker(scene)
        self._checker.set_edge_step_size(RESOLUTION)

    def plan(self, start: Array, goal: Array, rng: np.random.Generator, limit: float) -> Found:
        """Returns a path between two free configurations, or none after ``limit`` seconds."""
        begin = time.perf_counter()
        path = self._connected(start, goal, rng, begin + limit)
        first = time.perf_counter() - begin
        if path is not None:
            path = self._shortened(path, rng)
        return Found(path, first, time.perf_counter() - begin)

    def _connected(self, start: Array, goal: Array, rng: np.random.Generator, until: float) -> Array | None:
        trees = [_Tree(start), _Tree(goal)]
        while time.perf_counter() < until:
            ahead, behind = trees
            reached = self._extend(ahead, rng.uniform(self._lower, self._upper))
            if reached is not None:
                met = self._connect(behind, ahead.nodes[reached])
                if met is not None:
                    halves = [ahead.back(reached)[::-1], behind.back(met)[1:]]
                    path = np.array([*halves[0], *halves[1]])
                    return path if (path[0] == start).all() else path[::-1]
            trees.reverse()
        return None

    def _extend(self, tree: _Tree, target: Array) -> int | None:
        """Grows a tree by one step towards a target. Returns the number of the new node; None where the step touches something."""
        nearest = tree.nearest(target)
        way = target - tree.nodes[nearest]
        length = float(np.linalg.norm(way))
        node = target if length <= STRIDE else tree.nodes[nearest] + way * (STRIDE / length)
        return tree.add(node, nearest) if self._free(tree.nodes[nearest], node) else None

    def _connect(self, tree: _Tree, target: Array) -> int | None:
        """Grows a tree step by step until it reaches the target. Returns the number of the node there; None where something is between."""
        while (reached := self._extend(tree, target)) is not None:
            if (tree.nodes[reached] == target).all():
                return reached
        return None

    def _shortened(self, path: Array, rng: np.random.Generator) -> Array:
        for _ in range(SHORTCUTS):
            along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
            a, b = np.sort(rng.uniform(0, along[-1], 2))
            ends = [np.array([np.interp(at, along, joint) for joint in path.T]) for at in (a, b)]
            before, behind = path[along < a], path[along > b]
            if len(before) + len(behind) < len(path) and self._free(*ends):
                path = np.array([*before, *ends, *behind])
        return path

    def _free(self, a: Array, b: Array) -> bool:
        return bool(self._checker.CheckEdgeCollisionFree(a, b))


class _Tree:
    def __init__(self, root: Array) -> None:
        self.nodes, self._parents = [root], [-1]
        self._array = np.empty((64, len(root)))
        self._array[0] = root

    def add(self, node: Array, parent: int) -> int:
        if len(self.nodes) == len(self._array):
            self._array = np.concatenate([self._array, np.empty_like(self._array)])
        self._array[len(self.nodes)] = node
        self.nodes.append(node)
        self._parents.append(parent)
        return len(self.nodes) - 1

    def nearest(self, target: Array) -> int:
        return int(np.linalg.norm(self._array[: len(self.nodes)] - target, axis=1).argmin())

    def back(self, node: int) -> list[Array]:
        """Returns the nodes from this one to the root."""
        nodes = []
        while node >= 0:
            nodes.append(self.nodes[node])
            node = self._parents[node]
        return nodes
