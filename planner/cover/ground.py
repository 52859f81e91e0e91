"""Configurations that are free of collisions, and straight lines between them: what a scene looks like to somebody who may only try.

All of this is found by tests at points, in floating point. It says where to grow regions, and proves nothing.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from certifier.errors import RegionError
from certifier.model import Array, Scene

Collides = Callable[[Array], NDArray[np.bool_]]
"""Tells at which of the points s, (k, n), bodies touch; (k,)."""

BATCH, BATCHES = 2000, 500
"""Number of configurations that are drawn together, and the largest number of draws."""
EMPTY = 50
"""Nothing more is drawn after this many draws without a free configuration."""
LEVELS = 4
"""A line is tried at its middle, then at the middles of its halves, and so on, for this many levels."""


def free_samples(scene: Scene, collides: Collides, count: int, rng: np.random.Generator) -> Array:
    """Returns collision-free configurations, (count, n) in s, uniform in q within the joint limits.

    Raises:
        RegionError: nothing_free, when hardly any configuration is.
    """
    found: list[Array] = []
    total = 0
    for batch in range(BATCHES):
        if batch == EMPTY and not total:
            break
        s = scene.to_s(rng.uniform(scene.q_lower, scene.q_upper, (BATCH, scene.n)))
        found.append(s[~collides(s)])
        total += len(found[-1])
        if total >= count:
            return np.concatenate(found)[:count]
    message = f"of {BATCH * len(found)} configurations, {total} were found that are free of collisions and keep the conditions"
    raise RegionError("nothing_free", message, field="scene", hint="`ciris scene check` says which bodies always touch")


def sees(collides: Collides, a: Array, b: Array, levels: int = LEVELS) -> NDArray[np.bool_]:
    """Returns which of the lines in s from a to b, (k, n) each, are free at 2^levels - 1 points between their ends; (k,)."""
    free = np.ones(len(a), dtype=bool)
    for level in range(levels):
        t = (np.arange(2**level) + 0.5) / 2**level
        left = np.flatnonzero(free)
        points = a[left, None] + t[:, None] * (b[left, None] - a[left, None])
        free[left] = ~collides(points.reshape(-1, a.shape[1])).reshape(len(left), len(t)).any(axis=1)
    return free


def seen_from_each_other(collides: Collides, points: Array) -> NDArray[np.bool_]:
    """Returns which of the points (k, n) see which; (k, k), symmetric, True on the diagonal."""
    i, j = np.triu_indices(len(points), 1)
    visible = np.eye(len(points), dtype=bool)
    visible[i, j] = visible[j, i] = sees(collides, points[i], points[j])
    return visible


def clique(visible: NDArray[np.bool_], weights: Array) -> NDArray[np.intp]:
    """Returns points that all see each other, with much weight together: first the one that sees most, then who sees most of the rest.

    A convex free set can contain all of a clique and none but cliques (Werner et al., "Approximating robot configuration spaces with few
    convex sets using clique covers of visibility graphs", ICRA 2024).
    """
    members: list[int] = []
    left = weights > 0
    while left.any():
        score = np.where(left, visible[:, left] @ weights[left], -1.0)
        best = int(score.argmax())
        members.append(best)
        left = left & visible[best]
        left[best] = False
    return np.array(members, dtype=np.intp)
