"""A face cuts the part of a cell off in which nothing touches: compiled loops.

Where a contact surface crosses a cell, cuts in joints leave a layer along the surface open that is as thick as the cells. A face that is
linear in s, before the surface, leaves a layer as thick as the surface is curved in the cell.

The face is fitted to the gaps at some configurations of the cell, and moved until all that touch are beyond it. Then a plane is looked for
in the part before it, with what that part has of the cell (certifier.partition.bodies). A contact that turns up there moves the face on.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.map.settle import configurations
from certifier.model import Array
from certifier.partition.bodies import LEAST, NO_PLANE, SEPARATED, Pair, separated
from certifier.partition.hulls import gaps
from certifier.partition.sides import Proofs
from certifier.polytopes.simplex import dot

MOST_JOINTS = 5
"""Volumes that more joints move take too many pieces in cells of the size at which faces are worth their time."""
WORTH = 0.25
"""A face has to leave this share of a cell's samples before it."""
TRIES = 3
INSIDE = 64
"""Besides the configurations on the boundary, this many inside of the cell are looked at."""
BEFORE, BACK = 0.02, 0.05
"""The face is before the contacts by BEFORE of its whole way through the cell, and moves BACK by this part of it where a plane fails."""
FLAT = 0.2
"""Gaps count for the fit by their distance from FLAT times the median one; larger ones than the median are cut off."""
STARTS = 40
"""The search for a plane begins with at most this many configurations."""
_SPREAD = np.random.default_rng(1).uniform(-1.0, 1.0, (INSIDE, 64))


@njit(cache=True)
def cut_off(pair: Pair, lower: Array, upper: Array, samples: Array) -> tuple[bool, Array, float, Array, Proofs, Array]:
    """Looks for a face with a plane for the part of a cell before it.

    Args:
        samples: (S, n) in the cell.

    Returns:
        Whether there is one; its normal (n,), of length 1, and offset; the plane (5, 1 + k), the proofs of both sides and the lengths of
        the first one's, as certifier.partition.bodies.separated has them.
    """
    J, n = pair.joints, len(lower)
    k = len(J)
    mid, half = (lower + upper) / 2, (upper - lower) / 2
    on_boundary = configurations(J, lower, upper)
    many = len(on_boundary)
    X = np.empty((many + INSIDE, n))
    X[:many] = on_boundary
    for i in range(INSIDE):
        X[many + i] = mid
        for e in range(k):
            X[many + i, J[e]] += half[J[e]] * _SPREAD[i, e]
    gap = gaps(pair.a, pair.b, X)
    C, d = np.zeros((2 * n + 1, n)), np.empty(2 * n + 1)
    for i in range(n):
        C[i, i], C[n + i, i], d[i], d[n + i] = 1.0, -1.0, upper[i], -lower[i]
    normal = C[2 * n]
    fitted = _fitted(J, mid, half, X, gap, normal)
    places, nearest = np.empty(len(X)), np.inf
    for i in range(len(X)):
        places[i] = dot(normal, X[i])
        if gap[i] <= 0:
            nearest = min(nearest, places[i])
    if nearest == np.inf:  # nothing is known to touch
        nearest = places[gap.argmin()]
    length = places.max() - places.min()
    value = nearest - BEFORE * length
    faces, one, at, start = np.zeros(1, np.int64), normal.copy().reshape(1, n), np.empty(1), np.empty(n)
    for _ in range(TRIES if fitted else 0):
        before = 0
        for i in range(len(samples)):
            before += dot(normal, samples[i]) <= value
        near = np.flatnonzero(places <= value)[:STARTS]
        if before < WORTH * len(samples) or len(near) < 2:
            break
        points = X[near]
        for j in range(n):
            start[j] = points[:, j].mean()
        d[2 * n], at[0] = value, value
        kind, plane, proofs, first, Y, failed, _ = separated(pair, lower, upper, C, d, one, at, faces, start, points, 0, LEAST)
        if kind == SEPARATED:
            return True, normal.copy(), value, plane, proofs, first
        if kind != NO_PLANE or not len(failed):
            break
        # The face moves to before what touches, or to before all of what no plane separates.
        where, touch = np.empty(len(failed)), gaps(pair.a, pair.b, Y[failed]) <= 0
        for i in range(len(failed)):
            where[i] = dot(normal, Y[failed[i]])
        value = min(value, (where[touch] if touch.any() else where).min()) - BACK * length
    none = np.zeros(0)
    nothing = Proofs(none.astype(np.int8), none.astype(np.int16), none.astype(np.int16), none.astype(np.float32), np.zeros(3, np.int64))
    return False, normal.copy(), value, np.zeros((5, 1 + k)), nothing, np.zeros(3, np.int64)


@njit(cache=True)
def _fitted(J: Array, mid: Array, half: Array, X: Array, gap: Array, normal: Array) -> bool:
    """Fills in the direction, of length 1, in which the gap falls, by least squares, and returns whether there is one.

    Small gaps count most.
    """
    k, size = len(J), np.median(np.abs(gap))
    A, row = np.zeros((1 + k, 2 + k)), np.ones(2 + k)
    for i in range(len(X)):
        weight = 1 / (abs(gap[i]) + FLAT * size + 1e-12) ** 2
        for e in range(k):
            row[1 + e] = (X[i, J[e]] - mid[J[e]]) / half[J[e]]
        row[1 + k] = min(max(gap[i], -size), size)
        for a in range(1 + k):
            for b in range(2 + k):
                A[a, b] += weight * row[a] * row[b]
    for a in range(1 + k):  # the matrix is positive definite: no pivots are needed
        if A[a, a] <= 0:
            return False
        for b in range(a + 1, 1 + k):
            A[b] -= A[b, a] / A[a, a] * A[a]
    total = 0.0
    slopes = np.zeros(1 + k)
    for a in range(k, -1, -1):
        t = A[a, 1 + k]
        for b in range(a + 1, 1 + k):
            t -= A[a, b] * slopes[b]
        slopes[a] = t / A[a, a]
    for e in range(k):
        normal[J[e]] = -slopes[1 + e] / half[J[e]]
        total += normal[J[e]] ** 2
    if not total > 0:
        return False
    for e in range(k):
        normal[J[e]] /= np.sqrt(total)
    return True
