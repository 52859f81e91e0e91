"""A path through several configurations to the cheapest of several goals is put together here, leg by leg."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from certifier.model import Array, Scene
from planner.sampling.ends import turned
from planner.sampling.search import Search


@dataclass(frozen=True, eq=False)
class Route:
    """A path that is free, straight in q between its points.

    Attributes:
        path: (k, n) joint positions.
        kept: numbers of the points that it was asked to go through.
    """

    path: Array
    kept: tuple[int, ...]

    @property
    def length(self) -> float:
        """Returns the length in q, in radians (and metres)."""
        return float(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum())


def route(scene: Scene, search: Search, points: Sequence[Array], goals: Sequence[Array], until: float) -> Route | None:
    """Returns the shortest path that was found from point to point and on to one of the goals; None where none was found in time.

    Args:
        points: (n,) each, the start first.
        goals: (n,) each. A joint that can turn more than a whole turn goes to a goal's pose, or a point's, in any turn.
        until: when to give up, as time.monotonic() tells it.
    """
    path, kept = points[0][None], []
    for point in points[1:]:
        leg = _cheapest(search, path[-1], turned(scene, path[-1], point), until)
        if leg is None:
            return None
        path = np.concatenate([path, leg[1:]])
        kept.append(len(path) - 1)
    leg = _cheapest(search, path[-1], [one for goal in goals for one in turned(scene, path[-1], goal)], until)
    return None if leg is None else Route(np.concatenate([path, leg[1:]]), tuple(kept))


def _cheapest(search: Search, start: Array, goals: Sequence[Array], until: float) -> Array | None:
    """Returns the shortest path that was found from the start to one of the goals, (k, n).

    The nearest goals come first. Those that are farther away than a path is long are left out.
    """
    best, least = None, np.inf
    ahead = sorted((float(np.linalg.norm(goal - start)), i) for i, goal in enumerate(goals))
    for place, (distance, i) in enumerate(ahead):
        if distance >= least or not search.is_free(goals[i]):
            continue
        now = time.monotonic()
        path = search.path(start, goals[i], now + (until - now) / (len(ahead) - place))
        if path is not None and (length := float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())) < least:
            best, least = path, length
    return best
