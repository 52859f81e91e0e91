"""This module finds which regions overlap, and which regions of a scene are connected."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from certifier.model import Array
from planner.library import Library
from planner.nearest import between, project

FLAT = 1e-9
"""Regions into both of which no larger ball fits, in s, do not overlap: they touch at most."""


@dataclass(frozen=True)
class Overlap:
    """Two regions overlap.

    Attributes:
        depth: radius of the largest ball inside of both, in s.
        witness: (n,) its centre.
    """

    depth: float
    witness: Array


@dataclass(frozen=True)
class Compared:
    """Says which regions of lower numbers a region overlaps.

    Attributes:
        row: the region's number in the library.
        reached: all regions of numbers in the scene up to this one were looked at.
        found: numbers in the library of those that it overlaps, and how.
        complete: whether these were all regions of lower numbers.
    """

    row: int
    reached: int
    found: tuple[tuple[int, Overlap], ...]
    complete: bool


def beside(library: Library, region: int, others: Sequence[int]) -> list[int]:
    """Returns those of the other regions whose boxes reach into the box of this one."""
    numbers = np.asarray(others, dtype=np.intp)
    lower = np.maximum(library.lower[numbers], library.lower[region])
    upper = np.minimum(library.upper[numbers], library.upper[region])
    found: list[int] = numbers[(lower < upper).all(axis=1)].tolist()
    return found


def overlap(library: Library, a: int, b: int) -> Overlap | None:
    """Returns the overlap of two regions whose boxes overlap; None where they do not overlap, or only touch.

    Most of the faces cannot cut what the boxes have in common and are left out. Whether a point is left is asked before the largest ball,
    because that is the quicker question.
    """
    lower, upper = np.maximum(library.lower[a], library.lower[b]), np.minimum(library.upper[a], library.upper[b])
    rows = np.r_[library.rows(a), library.rows(b)]
    norms = library.norms[rows]
    C, d = library.faces[rows, :-1] / norms[:, None], library.faces[rows, -1] / norms
    reach = np.maximum(C * lower, C * upper).sum(axis=1)
    room = float((upper - lower).min()) / 2
    cuts = reach + room > d
    C, d = C[cuts], d[cuts]
    if project(C, d, (lower + upper) / 2) is None:
        return None
    balls = np.column_stack([C, np.ones(len(d))])
    bounds = [*zip(lower, upper, strict=True), (0.0, room)]
    # Most of what presolving could remove is left out already, and it takes longer than solving.
    found = linprog(np.append(np.zeros(len(lower)), -1.0), A_ub=balls, b_ub=d, bounds=bounds, options={"presolve": False})
    if found.x is None or found.x[-1] <= FLAT:
        return None
    return Overlap(float(found.x[-1]), found.x[:-1])


def compare(library: Library, linked: Sequence[tuple[int, int, int]], until: float) -> Iterator[Compared]:
    """Compares regions that were not compared yet, until the time is over.

    Args:
        linked: for regions of the library by their numbers in the scene, ascending: row in the library, number in the scene, and as far as
            which number the overlaps with those of lower numbers are known.
        until: the time by ``time.monotonic()`` at which to stop.

    Yields:
        What was found for each region, as far as there was time.
    """
    for row, number, known in linked:
        if known >= number - 1:
            continue
        found, reached = [], number - 1
        number_of = {other: its for other, its, _ in linked if known < its < number}
        for other in beside(library, row, list(number_of)):
            if time.monotonic() > until:
                reached = number_of[other] - 1
                break
            common = overlap(library, other, row)
            if common is not None:
                found.append((other, common))
        yield Compared(row, reached, tuple(found), complete=reached == number - 1)
        if reached < number - 1:
            return


def components(count: int, edges: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Returns the sets of regions that overlaps join, of ``count`` regions, the largest first; regions are numbers from 0 on."""
    ends = np.array(edges, dtype=np.intp).reshape(-1, 2)
    graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    parts, labels = connected_components(graph, directed=False)
    return sorted((np.flatnonzero(labels == part).tolist() for part in range(parts)), key=len, reverse=True)


@dataclass(frozen=True)
class Gap:
    """Names the place where one component comes nearest to another.

    Attributes:
        a: number of a region of the component.
        b: number of a region of another component.
        s_a: (n,) a point of a.
        s_b: (n,) a point of b, as near as it gets.
        distance: between the points, in s; 0 where the regions touch.
    """

    a: int
    b: int
    s_a: Array
    s_b: Array
    distance: float


def gap(library: Library, component: Sequence[int], others: Sequence[int] | None = None) -> Gap | None:
    """Returns where a component comes nearest to other regions, by default all that are outside of it; None where there are none.

    Pairs of regions are looked at by the distance of their boxes, until boxes are farther apart than the best pair.
    """
    outside = np.setdiff1d(np.arange(len(library)) if others is None else others, component)
    if not len(outside):
        return None

    def far(a: int) -> Array:
        """Returns how far the box of a region is from the boxes outside, (o,)."""
        apart = np.maximum(library.lower[a] - library.upper[outside], library.lower[outside] - library.upper[a])
        return np.asarray(np.linalg.norm(np.maximum(apart, 0.0), axis=1))

    best: Gap | None = None
    for _, a in sorted((float(far(a).min()), a) for a in component):
        distances = far(a)
        for i in np.argsort(distances, kind="stable").tolist():
            if best is not None and distances[i] >= best.distance:
                break
            b = int(outside[i])
            x, y = between(library, a, b)
            distance = float(np.linalg.norm(x - y))
            if best is None or distance < best.distance:
                best = Gap(a, b, x, y, distance)
    return best
