"""This module finds which regions {s : C s <= d} contain which points, and how deep inside they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array, Scene
from planner.library import Library

_POINTS, _PAIRS = 500, 10_000
"""Number of points, and of pairs of a point and a region, that are looked at together, which bounds the memory that this takes."""
_FACES = 8
"""Number of faces of a region that are tried first; each time after, twice as many."""

_Found = tuple[NDArray[np.intp], NDArray[np.intp], Array]


@dataclass(frozen=True)
class Hits:
    """Says of points and regions which point is in which region.

    Attributes:
        point: (h,) numbers of points, ascending.
        region: (h,) numbers of regions in the library; those of one point by margin, the largest first.
        margin: (h,) distance in s from the point to the nearest face's hyperplane, min_j (d_j - c_j's) / |c_j| >= 0.
    """

    point: NDArray[np.intp]
    region: NDArray[np.intp]
    margin: Array


def locate(library: Library, s: Array) -> Hits:
    """Returns which regions contain which of the points s, (k, n). A row with a value that is not finite is in no region."""
    none = np.zeros(0, dtype=np.intp)
    found: list[_Found] = [(none, none, np.zeros(0))]
    for begin in range(0, len(s), _POINTS):
        point, region = in_boxes(library, s[begin : begin + _POINTS])
        for pair in range(0, len(point), _PAIRS):
            found += _inside(library, s, begin + point[pair : pair + _PAIRS], region[pair : pair + _PAIRS])
    points, regions, margin = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((-margin, points))
    return Hits(points[order], regions[order], margin[order])


def in_boxes(library: Library, s: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Returns which points are in the boxes of which regions."""
    point, region = library.grid.candidates(s)
    at = s[point]
    within = ((at >= library.lower[region]) & (at <= library.upper[region])).all(axis=1)
    return point[within], region[within]


def _inside(library: Library, s: Array, point: NDArray[np.intp], region: NDArray[np.intp]) -> Iterator[_Found]:
    """Yields those of the pairs whose point is in their region, with the margins.

    A pair is dropped at the first faces that the point is beyond, which most often are the very first.
    """
    margin = np.full(len(point), np.inf)
    tried, more = 0, _FACES
    while len(point):
        last = library.first[region + 1][:, None] - 1
        # The last face stands in for those that a region with fewer faces lacks.
        rows = np.minimum(library.first[region][:, None] + np.arange(tried, tried + more), last)
        faces = library.faces.take(rows, axis=0)
        slack = faces[:, :, -1] - np.einsum("cfn,cn->cf", faces[:, :, :-1], s[point])
        inside = (slack >= 0).all(axis=1)
        nearest = (slack[inside] / library.norms.take(rows[inside])).min(axis=1, initial=np.inf)
        margin = np.minimum(margin[inside], nearest)
        settled = rows[inside, -1] == last[inside, 0]
        point, region = point[inside], region[inside]
        yield point[settled], region[settled], margin[settled]
        point, region, margin = point[~settled], region[~settled], margin[~settled]
        tried, more = tried + more, 2 * more


def to_s(scene: Scene, q: Array) -> Array:
    """Returns the tangent-space coordinates (k, n) of configurations q (k, n), with a row of NaN where a joint is outside its limits.

    A joint that can turn a whole turn and more is in the same pose a turn later, so its position is taken to the window that the scene
    covers. s itself has period 2 pi in every revolute joint, so without the check of the limits any configuration a turn away would count.

    Raises:
        RegionError: number_too_large, for a position whose whole turns a double cannot hold (:meth:`Scene.in_windows`).
    """
    lower, upper = scene.own_limits
    shifted = scene.in_windows(q)
    within = (q >= lower) & (q <= upper) & (shifted >= scene.q_lower) & (shifted <= scene.q_upper)
    return np.where(within.all(axis=1, keepdims=True), scene.to_s(shifted), np.nan)
