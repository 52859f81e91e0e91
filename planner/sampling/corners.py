"""The corners of a path are rounded here, so that the robot need not stop at them.

A parabola cuts a corner: it leaves the line before it, and joins the line behind it. Straight lines between points of the parabola stand
for it. Where they touch something, a smaller one is tried.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import pairwise

import numpy as np

from certifier.model import Array

PARTS = (0.5, 0.25, 0.1, 0.03)
"""How much of the lines beside a corner its parabola takes, the first that is free; a corner stays where none is."""
CHORDS = 4
"""A parabola is looked at as this many straight lines."""


def rounded(path: Array, sees: Callable[[Array, Array], bool], kept: Collection[int] = ()) -> Array:
    """Returns points of a path, (m, n), joined by straight lines in q that are free where those of ``path``, (k, n), are.

    Args:
        sees: says whether the straight line between two configurations is free.
        kept: numbers of points that the path has to go through.
    """
    points = [path[:1]]
    for i in range(1, len(path) - 1):
        points.append(path[i : i + 1] if i in kept else _cut(path[i - 1], path[i], path[i + 1], sees))
    return np.concatenate([*points, path[-1:]])


def _cut(before: Array, corner: Array, behind: Array, sees: Callable[[Array, Array], bool]) -> Array:
    u = np.linspace(0.0, 1.0, CHORDS + 1)[:, None]
    for part in PARTS:
        first, last = corner + part * (before - corner), corner + part * (behind - corner)
        curve = (1 - u) ** 2 * first + 2 * u * (1 - u) * corner + u**2 * last
        if all(sees(a, b) for a, b in pairwise(curve)):
            return curve
    return corner[None]
