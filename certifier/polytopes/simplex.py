"""The simplex method solves linear programs over one polytope {x : A x <= b}, from a point inside and then from vertex to vertex.

The programs here have few unknowns and many directions, so one call to a general solver costs more than all of them together.

From a point inside, the method walks along the objective, projected onto the faces met so far, to a vertex. From there it walks along
edges, each time to the best neighbour. (This is Dantzig's rule; after a step of no length Bland's rule is used, so that no cycle goes
on.) Every further direction starts from the last one's vertex.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array

_PARALLEL = 1e-9
"""Below this sine a direction is taken as parallel to a face."""
_OPTIMAL = 1e-11
"""An optimal vertex may have a multiplier that is negative by this much, relative to the objective."""
_LEVEL = 1e-13
"""A step no longer than this counts as none; the unknowns are of order one."""
_BEYOND = 1e-9
"""A vertex may be beyond a face by this."""
WORK = 5
"""A program needs this many numbers for each row to work with."""
_PIVOTS = 50
"""At most this many edges are followed for every row and unknown."""


def maximise(A: Array, b: Array, directions: Array, start: Array) -> tuple[Array, Array]:
    """Returns the maximisers (k, n) of the directions (k, n) on {x : A x <= b}, and the rows' multipliers (k, m) >= 0.

    Values are accurate to rounding. What has to hold for certain must be proved by the multipliers.

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
    if not _walk(np.ascontiguousarray(rows.T), slack, np.ascontiguousarray(directions, dtype=float), points, multipliers):
        raise np.linalg.LinAlgError("no vertex is the best")
    return start + points, multipliers / norms


def deepest(C: Array, d: Array, start: Array) -> tuple[Array, float, Array]:
    """Returns the point (n,) of {x : C x <= d} that lies farthest inside of all faces, how far, and the faces' multipliers (m,).

    Args:
        C, d: rows of length 1, of a polytope that is bounded; it may be empty.
        start: (n,) any point.

    Returns:
        Where the polytope is empty, the distance is negative, and the multipliers' sums prove it: that of C is 0, and that of d is the
        distance.

    Raises:
        np.linalg.LinAlgError: rounding stands in the way.
    """
    objective = np.append(np.zeros(len(start)), 1.0)[None]
    points, multipliers = maximise(np.column_stack([C, np.ones(len(d))]), d, objective, np.append(start, (d - C @ start).min()))
    return points[0, :-1], float(points[0, -1]), multipliers[0]


@njit(cache=True)
def corner(columns: Array, b: Array, start: Array, direction: Array, basis: Array, edges: Array, work: Array, way: Array) -> bool:
    """Fills in the way (n,) from a point of {x : A x <= b}, with rows of length 1, to where the direction has its largest value.

    Args:
        columns: (n, m) the transpose of A.
        basis: (n,) the rows of a vertex to begin at, which this replaces with those of the one found; basis[0] = -1 for none.
        edges: (n, n) belongs to the basis; what is in it does not matter where there is none.
        work: (WORK, m) is overwritten.

    Returns:
        False where there is none, or rounding stands in the way.
    """
    slack, multipliers, values = work[WORK - 2], work[WORK - 1], work[0]
    _times(columns, start, slack)
    for j in range(len(b)):
        slack[j] = max(b[j] - slack[j], 0.0)
    found = basis[0] >= 0 or (_vertex(columns, slack, direction, basis, work) and _edges(columns, basis, edges))
    found = found and _along_edges(columns, slack, direction, basis, edges, work, way, multipliers)
    if found:
        _times(columns, way, values)
        for j in range(len(b)):
            found = found and values[j] - slack[j] <= _BEYOND
    if not found:
        basis[0] = -1
    return found


@njit(cache=True)
def _walk(columns: Array, b: Array, directions: Array, points: Array, multipliers: Array) -> bool:
    n = len(columns)
    basis, edges, work = np.zeros(n, dtype=np.int64), np.zeros((n, n)), np.empty((WORK, len(b)))
    solved = _vertex(columns, b, directions[0], basis, work)
    for k in range(len(directions)):
        solved = solved and _edges(columns, basis, edges)
        solved = solved and _along_edges(columns, b, directions[k], basis, edges, work, points[k], multipliers[k])
    return solved


@njit(cache=True)
def _times(columns: Array, x: Array, values: Array) -> None:
    """Fills in A x, (m,); the rows are side by side in vector registers, and each is summed up in the same order."""
    n, m = columns.shape
    values[:] = 0.0
    for i in range(0, n - n % 4, 4):
        a, b, c, d = columns[i], columns[i + 1], columns[i + 2], columns[i + 3]
        x0, x1, x2, x3 = x[i], x[i + 1], x[i + 2], x[i + 3]
        for j in range(m):
            values[j] = values[j] + x0 * a[j] + x1 * b[j] + x2 * c[j] + x3 * d[j]
    for i in range(n - n % 4, n):
        t, column = x[i], columns[i]
        for j in range(m):
            values[j] += t * column[j]


@njit(cache=True)
def _vertex(columns: Array, b: Array, c: Array, basis: Array, work: Array) -> bool:
    """Fills in the rows of a vertex that is reached from 0 without going down in c; returns False when no face ends the way."""
    n = len(columns)
    left, rates, times = work[0], work[1], work[2]
    left[:] = b
    frame, v, unit = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    for k in range(n):
        rising = _rest(frame, k, c, v) > _PARALLEL * np.sqrt(dot(c, c))
        if not rising:
            longest, axis = -1.0, 0
            for i in range(n):
                unit[:] = 0.0
                unit[i] = 1.0
                length = _rest(frame, k, unit, v)
                if length > longest:
                    longest, axis = length, i
            unit[:] = 0.0
            unit[axis] = 1.0
            _rest(frame, k, unit, v)
        _scale(v, 1 / np.sqrt(dot(v, v)))
        entering, step = _first(columns, left, v, basis, k, False, rates, times)
        if entering < 0 and not rising:
            _scale(v, -1.0)
            entering, step = _first(columns, left, v, basis, k, False, rates, times)
        if entering < 0:
            return False
        _walked(left, rates, step)
        basis[k] = entering
        for i in range(n):
            unit[i] = columns[i, entering]
        length = _rest(frame, k, unit, v)
        for i in range(n):
            frame[k, i] = v[i] / length
    return True


@njit(cache=True)
def dot(v: Array, w: Array) -> float:
    """Returns a scalar product; for few elements this is faster than BLAS, which needs Python's lock."""
    total = 0.0
    for i in range(len(v)):
        total += v[i] * w[i]
    return total


@njit(cache=True)
def _scale(v: Array, factor: float) -> None:
    for i in range(len(v)):
        v[i] *= factor


@njit(cache=True)
def _rest(frame: Array, k: int, v: Array, rest: Array) -> float:
    """Fills in the part of v that is orthogonal to the first k rows of the frame, which are orthonormal, and returns its length."""
    for i in range(len(v)):
        rest[i] = v[i]
    for _ in range(2):
        for j in range(k):
            along = dot(frame[j], rest)
            for i in range(len(v)):
                rest[i] -= along * frame[j, i]
    return np.sqrt(dot(rest, rest))


@njit(cache=True)
def _walked(left: Array, rates: Array, step: float) -> None:
    """Subtracts a step of this length from the room that each row still has, (m,)."""
    for j in range(len(left)):
        left[j] = max(left[j] - step * rates[j], 0.0)


@njit(cache=True, error_model="numpy")
def _first(columns: Array, left: Array, v: Array, basis: Array, size: int, lowest: bool, rates: Array, times: Array) -> tuple[int, float]:
    """Returns the row that ends the way along v, and the length of the way; the row is -1 if there is none.

    The first ``size`` rows of the basis are left out. Of several rows it is the one that is met most squarely or, if ``lowest``, the one
    with the lowest number.

    Args:
        left: (m,) the room that each row still has.
        rates, times: (m,) get A v, and how long the way to each row is.
    """
    entering, step, speed = -1, np.inf, 0.0
    _times(columns, v, rates)
    for j in range(len(left)):
        times[j] = left[j] / rates[j] if rates[j] > _PARALLEL else np.inf
    for j in range(len(left)):
        if times[j] > step + _LEVEL:
            continue
        time, approach = times[j], rates[j]
        if approach <= _PARALLEL or (time > step - _LEVEL and (lowest or approach <= speed)):
            continue
        used = False
        for i in range(size):
            used = used or basis[i] == j
        if not used:
            entering, step, speed = j, min(time, step), approach
    return entering, step


@njit(cache=True)
def _edges(columns: Array, basis: Array, edges: Array) -> bool:
    """Fills in the columns of the inverse of the basis' rows, row by row, by Gauss-Jordan elimination with pivots.

    Returns:
        False when the basis' rows are numerically dependent.
    """
    n = len(basis)
    work = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            work[i, j] = columns[i, basis[j]]
            edges[i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        if abs(work[pivot, k]) < 1e-14:
            return False
        for j in range(n):
            work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
            edges[k, j], edges[pivot, j] = edges[pivot, j], edges[k, j]
        factor = 1 / work[k, k]
        _scale(work[k], factor)
        _scale(edges[k], factor)
        for i in range(n):
            if i != k:
                factor = work[i, k]
                for j in range(n):
                    work[i, j] -= factor * work[k, j]
                    edges[i, j] -= factor * edges[k, j]
    return True


@njit(cache=True)
def _along_edges(columns: Array, b: Array, c: Array, basis: Array, edges: Array, work: Array, x: Array, multipliers: Array) -> bool:
    """Goes from the basis' vertex to the best one, which the basis then is, with its edges; fills in x and the multipliers.

    Returns:
        False when there is no best vertex.
    """
    n, m = columns.shape
    size = np.sqrt(dot(c, c))
    v, row, left, rates, times = np.zeros(n), np.zeros(n), work[0], work[1], work[2]
    multipliers[:] = 0.0
    _at(b, basis, edges, x)
    _times(columns, x, left)
    for j in range(m):
        left[j] = max(b[j] - left[j], 0.0)
    lowest = False
    for _ in range(_PIVOTS * (m + n)):
        leaving, least, largest = -1, 0.0, 0.0
        for k in range(n):
            y = dot(c, edges[k])
            multipliers[basis[k]] = max(y, 0.0)
            largest = max(largest, abs(y))
            if y < -_OPTIMAL * size and (basis[k] < basis[leaving] if lowest and leaving >= 0 else y < least):
                leaving, least = k, y
        if leaving < 0 or least > -1e-15 * largest:
            _at(b, basis, edges, x)
            return True
        for k in range(n):
            multipliers[basis[k]] = 0.0
            v[k] = -edges[leaving, k]
        _scale(v, 1 / np.sqrt(dot(v, v)))
        entering, step = _first(columns, left, v, basis, n, lowest, rates, times)
        if entering < 0:
            return False
        _walked(left, rates, step)
        lowest = step <= _LEVEL
        for i in range(n):
            row[i] = columns[i, entering]
        _scale(edges[leaving], 1 / dot(row, edges[leaving]))
        for k in range(n):
            if k != leaving:
                rate = dot(row, edges[k])
                for i in range(n):
                    edges[k, i] -= rate * edges[leaving, i]
        basis[leaving] = entering
    return False


@njit(cache=True)
def _at(b: Array, basis: Array, edges: Array, x: Array) -> None:
    """Fills in the vertex of a basis, (n,)."""
    x[:] = 0.0
    for k in range(len(x)):
        for i in range(len(x)):
            x[i] += edges[k, i] * b[basis[k]]
