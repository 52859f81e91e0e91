"""Linear programs over one polytope {x : A x <= b} from a point inside, by the simplex method from vertex to vertex.

The programs here have few unknowns and many directions: a call to a general solver costs more than the whole of them. From a point inside
one walks along the objective, projected onto the faces met so far, to a vertex; from there along edges, each time to the best neighbour
(Dantzig's rule; Bland's after a step of no length, so that no cycle goes on). Every further direction starts from the last one's vertex.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array

_PARALLEL = 1e-9
"""Sine below which a direction is taken as parallel to a face."""
_OPTIMAL = 1e-11
"""Most negative multiplier of an optimal vertex, relative to the objective."""
_LEVEL = 1e-13
"""Steps, relative to the offsets, that count as none."""
_PIVOTS = 50
"""Edges followed at most, for every row and unknown."""


def maximise(A: Array, b: Array, directions: Array, start: Array) -> tuple[Array, Array]:
    """Maximisers (k, n) of the directions (k, n) on {x : A x <= b}, and the rows' multipliers (k, m) >= 0.

    Values are accurate to rounding; what has to hold for certain is to be proved by the multipliers.

    Args:
        start: (n,) a point of the polytope, inside or on its faces.

    Raises:
        np.linalg.LinAlgError: a direction has no largest value, or rounding stands in the way.
    """
    norms = np.linalg.norm(A, axis=1)
    norms[norms == 0] = 1.0
    rows = np.ascontiguousarray(A / norms[:, None])
    slack = np.maximum(b / norms - rows @ start, 0.0)
    points, multipliers = np.zeros(directions.shape), np.zeros((len(directions), len(b)))
    _walk(rows, slack, np.ascontiguousarray(directions, dtype=float), points, multipliers)
    return start + points, multipliers / norms


@njit(cache=True)
def _walk(A: Array, b: Array, directions: Array, points: Array, multipliers: Array) -> None:
    n = A.shape[1]
    basis = np.zeros(n, dtype=np.int64)
    _vertex(A, b, directions[0], basis)
    for k in range(len(directions)):
        _along_edges(A, b, directions[k], basis, points[k], multipliers[k])


@njit(cache=True)
def _vertex(A: Array, b: Array, c: Array, basis: Array) -> None:
    """Rows of a vertex that is reached from 0 without going down in c."""
    n = A.shape[1]
    x, frame = np.zeros(n), np.zeros((n, n))
    for k in range(n):
        v = _rest(frame, k, c)
        size = np.sqrt(np.sum(c * c))
        rising = np.sqrt(np.sum(v * v)) > _PARALLEL * size
        if not rising:
            longest = -1.0
            for i in range(n):
                unit = np.zeros(n)
                unit[i] = 1.0
                rest = _rest(frame, k, unit)
                if np.sum(rest * rest) > longest:
                    longest, v = np.sum(rest * rest), rest
        v /= np.sqrt(np.sum(v * v))
        entering, step = _first(A, b, x, v, basis[:k], False)
        if entering < 0 and not rising:
            v = -v
            entering, step = _first(A, b, x, v, basis[:k], False)
        if entering < 0:
            raise np.linalg.LinAlgError("no face ends the way")
        x += step * v
        basis[k] = entering
        row = _rest(frame, k, A[entering])
        frame[k] = row / np.sqrt(np.sum(row * row))


@njit(cache=True)
def _rest(frame: Array, k: int, v: Array) -> Array:
    """The part of v that is orthogonal to the first k rows, which are orthonormal."""
    rest = v.copy()
    for _ in range(2):
        for i in range(k):
            rest -= np.sum(frame[i] * rest) * frame[i]
    return rest


@njit(cache=True)
def _first(A: Array, b: Array, x: Array, v: Array, basis: Array, lowest: bool) -> tuple[int, float]:
    """The row that ends the way from x along v, none of the basis, and the length of the way; -1 if there is none.

    Of several the one that is met most squarely, or the one with the lowest number.
    """
    m, n = A.shape
    entering, step, speed = -1, np.inf, 0.0
    for j in range(m):
        approach, slack = 0.0, b[j]
        for i in range(n):
            approach += A[j, i] * v[i]
            slack -= A[j, i] * x[i]
        if approach <= _PARALLEL:
            continue
        time = max(slack, 0.0) / approach
        if time > step + _LEVEL or (time > step - _LEVEL and (lowest or approach <= speed)):
            continue
        used = False
        for i in basis:
            used = used or i == j
        if not used:
            entering, step, speed = j, min(time, step), approach
    return entering, step


@njit(cache=True)
def _along_edges(A: Array, b: Array, c: Array, basis: Array, x: Array, multipliers: Array) -> None:
    """From the basis' vertex to the best one, which the basis then is; fills x and the multipliers."""
    m, n = A.shape
    size = np.sqrt(np.sum(c * c))
    inverse = np.linalg.inv(A[basis])
    lowest = False
    for _ in range(_PIVOTS * (m + n)):
        for i in range(n):
            x[i] = np.sum(inverse[i] * b[basis])
        leaving, least, largest = -1, 0.0, 0.0
        for k in range(n):
            y = np.sum(c * inverse[:, k])
            multipliers[basis[k]] = max(y, 0.0)
            largest = max(largest, abs(y))
            if y < -_OPTIMAL * size and (basis[k] < basis[leaving] if lowest and leaving >= 0 else y < least):
                leaving, least = k, y
        if leaving < 0 or least > -1e-15 * largest:
            return
        multipliers[basis] = 0.0
        v = -inverse[:, leaving]
        length = np.sqrt(np.sum(v * v))
        entering, step = _first(A, b, x, v / length, basis, lowest)
        if entering < 0:
            raise np.linalg.LinAlgError("no face ends the way")
        lowest = step <= _LEVEL
        pivot = np.sum(A[entering] * inverse[:, leaving])
        column = inverse[:, leaving] / pivot
        for k in range(n):
            if k != leaving:
                inverse[:, k] -= np.sum(A[entering] * inverse[:, k]) * column
        inverse[:, leaving] = column
        basis[leaving] = entering
    raise np.linalg.LinAlgError("too many edges")
