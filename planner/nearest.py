"""This module finds the point of a polytope, of all regions and a map, and of two regions, that is nearest. Distances are those of s.

These are answers for planners and prove nothing: they are found in floating point.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from certifier.model import Array, Scene
from certifier.positions import check_magnitude
from ciris.free_set import BOXES, FreeSet
from planner.library import Library

INWARDS = 1e-9
"""The nearest point lies this far behind every face, in s, so that rounding does not take it out of its region."""
TOGETHER = 5 * BOXES
"""The searches in the map for all points of one question look at this many boxes at most, in some seconds. Most points need a hundred."""
_INFEASIBLE = 1e-10
"""The residual of a least distance program without a solution is 0; rounding leaves it below this."""
_ROUNDS, _SETTLED = 200, 1e-6
"""Projecting to and fro ends after _ROUNDS, or when a round moves a point by less than this part of the distance."""


@dataclass(frozen=True)
class Nearest:
    """Names what is nearest to a point: a region, or the map.

    Attributes:
        region: the region's number in the library; None for the map.
        s: (n,) the nearest point; the point itself where it is inside.
        distance: from the point to that, in s; 0 where the point is inside.
    """

    region: int | None
    s: Array
    distance: float


@dataclass(frozen=True)
class Proved:
    """Says what is proved nearest to a point.

    Attributes:
        nearest: None where nothing is proved.
        complete: whether nothing nearer is proved; False where the search in the map ended early.
    """

    nearest: Nearest | None
    complete: bool


def nearest_proved(library: Library, free: FreeSet | None, scene: Scene, points: Array) -> list[Proved]:
    """Returns what is nearest to each of the points s, (k, n), of all regions and the map's free set; nothing for a row that is not finite.

    All searches in the map look at TOGETHER boxes at most.

    Args:
        free: None where the scene has no map.

    Raises:
        RegionError: number_too_large.
    """
    left, found = TOGETHER, []
    for s in points:
        if not np.isfinite(s).all():
            found.append(Proved(None, True))
            continue
        near = nearest(library, s)
        if free is None or (near is not None and near.distance == 0):
            found.append(Proved(near, True))
            continue
        closest = free.nearest(scene.to_q(s), closer_than=np.inf if near is None else near.distance, boxes=min(BOXES, left))
        left -= closest.boxes
        if closest.q is not None and closest.distance is not None:
            near = Nearest(None, s if closest.distance == 0 else scene.to_s(closest.q), closest.distance)
        found.append(Proved(near, closest.complete))
    return found


def nearest(library: Library, s: Array, without: Collection[int] = ()) -> Nearest | None:
    """Returns the region that is nearest to the point s, (n,), of all but those ``without``; None where there is none.

    Raises:
        RegionError: number_too_large.

    The regions are looked at by the distance of their boxes, until a box is farther away than the best region. The distance to the
    farthest face that the point is beyond spares most of the others their projection.
    """
    check_magnitude(s, "s")
    outside = np.maximum(np.maximum(library.lower - s, s - library.upper), 0.0)
    far = np.linalg.norm(outside, axis=1)
    far[list(without)] = np.inf
    best: Nearest | None = None
    for region in np.argsort(far, kind="stable").tolist():
        if far[region] == np.inf or (best is not None and far[region] >= best.distance):
            break
        C, d = _normalised(library, region)
        beyond = float((C @ s - d).max())
        if beyond <= 0:
            return Nearest(region, s, 0.0)
        if best is not None and beyond >= best.distance:
            continue
        point = project(C, d, s)
        if point is not None and (best is None or np.linalg.norm(point - s) < best.distance):
            best = Nearest(region, point, float(np.linalg.norm(point - s)))
    return best


def project(C: Array, d: Array, s: Array) -> Array | None:
    """Returns the point (n,) of {x : C x <= d - INWARDS} that is nearest to s, (n,); None where there is none.

    The least distance program min |y| with C (s + y) <= d is solved by its dual, a nonnegative least squares problem (Lawson and Hanson,
    Solving Least Squares Problems, chapter 23).

    Args:
        C: (m, n), rows of length 1, or of zeros.
        d: (m,).
    """
    beyond = C @ s - (d - INWARDS)
    scale = float(beyond.max(initial=0.0))
    if scale <= 0:
        return s
    program = np.vstack([-C.T, beyond / scale])
    target = np.append(np.zeros(len(s)), 1.0)
    residual = program @ nnls(program, target, maxiter=10 * len(d))[0] - target
    if -residual[-1] <= _INFEASIBLE:
        return None
    return s - scale * residual[:-1] / residual[-1]


def between(library: Library, a: int, b: int) -> tuple[Array, Array]:
    """Returns a point (n,) of each of two regions, about as near to each other as the regions are.

    Projecting to and fro between two polytopes converges to their nearest points (Cheney and Goldstein).
    """
    first, second = _normalised(library, a), _normalised(library, b)
    x = _onto(first, (library.lower[b] + library.upper[b]) / 2)
    for _ in range(_ROUNDS):
        y = _onto(second, x)
        x, before = _onto(first, y), x
        if np.linalg.norm(x - before) <= _SETTLED * np.linalg.norm(x - y):
            break
    return x, y


def _normalised(library: Library, region: int) -> tuple[Array, Array]:
    """Returns the half-spaces of a region with normals of length 1, (m, n) and (m,)."""
    faces, norms = library.faces[library.rows(region)], library.norms[library.rows(region)]
    return faces[:, :-1] / norms[:, None], faces[:, -1] / norms


def _onto(polytope: tuple[Array, Array], s: Array) -> Array:
    point = project(*polytope, s)
    assert point is not None, "a certified region has room for a ball"
    return point
