"""A plane, affine in coordinates u, is looked for that separates points at some configurations: Wolfe's algorithm, in compiled loops."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.partition.wolfe import unused, weigh

FEW = 24
"""Each step for a plane looks at no more than this many configurations, as long as one of them is on its wrong side."""


class Support(NamedTuple):
    """The points whose mean is nearest to 0: vertices at configurations.

    Attributes:
        rows: (m,) the configurations.
        vertices: (m,) v for a vertex of A, and -1 - v for one of B.
        weights: (m,) they add up to 1.
    """

    rows: Array
    vertices: Array
    weights: Array


@njit(cache=True)
def _worst(
    A: Array, B: Array, u: Array, radius_a: float, radius_b: float, ratio: Array, N: int, z: Array, lanes: Array
) -> tuple[int, int, float]:
    """Returns the configuration and the vertex that are farthest on the wrong side of a plane, and how far.

    The configurations are side by side in vector registers.

    Args:
        A, B, u, ratio, N: as for :func:`separate`.
        lanes: (6, N) is overwritten; the last row gets the least value at each configuration, which is positive on the right side.

    Returns:
        (row, vertex, value): the vertex is v for one of A, and -1 - v for one of B.
    """
    k = len(u)
    for c in range(4):
        plane, t = lanes[c], z[c * (k + 1)]
        for i in range(N):
            plane[i] = t
        for e in range(k):
            slope, ue = z[c * (k + 1) + 1 + e], u[e]
            for i in range(N):
                plane[i] += slope * ue[i]
    p0, p1, p2, p3, highest, values = lanes[0], lanes[1], lanes[2], lanes[3], lanes[4], lanes[5]
    for i in range(N):
        values[i], highest[i] = np.inf, -np.inf
    for v in range(len(A)):
        x, y, w = A[v, 0], A[v, 1], A[v, 2]
        for i in range(N):
            t = p0[i] * x[i] + p1[i] * y[i] + p2[i] * w[i]
            values[i] = t if t < values[i] else values[i]
    for v in range(len(B)):
        x, y, w = B[v, 0], B[v, 1], B[v, 2]
        for i in range(N):
            t = p0[i] * x[i] + p1[i] * y[i] + p2[i] * w[i]
            highest[i] = t if t > highest[i] else highest[i]
    for i in range(N):
        norm = ratio[i] * np.sqrt(p0[i] * p0[i] + p1[i] * p1[i] + p2[i] * p2[i])
        low, high = values[i] + p3[i] - radius_a * norm, -(highest[i] + p3[i]) - radius_b * norm
        values[i] = low if low < high else high
    lowest, row = np.inf, 0
    for i in range(N):
        if values[i] < lowest:
            lowest, row = values[i], i
    x0, x1, x2, x3 = p0[row], p1[row], p2[row], p3[row]
    norm = ratio[row] * np.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
    least, vertex = np.inf, 0
    for v in range(len(A)):
        t = x0 * A[v, 0, row] + x1 * A[v, 1, row] + x2 * A[v, 2, row] + x3 - radius_a * norm
        if t < least:
            least, vertex = t, v
    for v in range(len(B)):
        t = -(x0 * B[v, 0, row] + x1 * B[v, 1, row] + x2 * B[v, 2, row] + x3) - radius_b * norm
        if t < least:
            least, vertex = t, -1 - v
    return row, vertex, lowest


@njit(cache=True)
def _point(
    A: Array, B: Array, u: Array, radius_a: float, radius_b: float, ratio: Array, z: Array, row: int, vertex: int, point: Array
) -> None:
    """Fills in the point +-[p; 1] x [1; u] of a vertex at a configuration, (4 (k + 1),), where p is nearest to the plane z."""
    k = len(u)
    x, y, w = z[0], z[k + 1], z[2 * (k + 1)]
    for e in range(k):
        x += z[1 + e] * u[e, row]
        y += z[k + 2 + e] * u[e, row]
        w += z[2 * k + 3 + e] * u[e, row]
    length = np.sqrt(x * x + y * y + w * w)
    share = ratio[row] / length if length > 0 else 0.0
    for c in range(4):
        t = 1.0 if vertex >= 0 else -1.0
        if c < 3:
            direction = share * (x if c == 0 else y if c == 1 else w)
            t = A[vertex, c, row] - radius_a * direction if vertex >= 0 else -(B[-1 - vertex, c, row] + radius_b * direction)
        point[c * (k + 1)] = t
        for e in range(k):
            point[c * (k + 1) + 1 + e] = t * u[e, row]


@njit(cache=True)
def separate(
    A: Array,
    B: Array,
    u: Array,
    radius_a: float,
    radius_b: float,
    ratio: Array,
    N: int,
    least: float,
    enough: float,
    z: Array,
    begun: Support,
) -> tuple[int, Support]:
    """Looks for the plane z, affine in u, that keeps the points A on its positive and B on its negative side with the widest margin.

    This is Wolfe's algorithm for the point nearest to 0 of the hull of all +-[p; 1] x [1; u].

    Args:
        A, B: (v, 3, C), (w, 3, C) points at C configurations, of which the first N count.
        u: (k, C) the configurations.
        ratio: (C,) the bodies keep this many times their radius away from the plane there.
        least: a plane with a smaller margin than this counts as none.
        enough: any plane with this share of the widest margin will do.
        z: (4 (k + 1),) the plane to begin with, of these points; it is replaced by the one found.
        begun: the support of that plane; empty for none. Where it leads to no result, the search begins anew.

    Returns:
        (found, support): whether there is such a plane, 0 also where the steps did not suffice to find it. The weighted mean of the
        support's points is the point nearest to 0, which is z.
    """
    k = len(u)
    D = 4 * (k + 1)
    # The points are held twice, so that both sums over them and products with them run through memory.
    points, across, G, w = np.zeros((D + 2, D)), np.zeros((D, D + 2)), np.zeros((D + 2, D + 2)), np.zeros(D + 2)
    rows, vertices, origin = np.zeros(D + 2, np.int64), np.zeros(D + 2, np.int64), np.zeros(D + 2, np.int64)
    point, products, lanes = np.zeros(D), np.zeros(D + 2), np.empty((6, N))
    few_A, few_B, few_u, few_ratio = np.empty((len(A), 3, FEW)), np.empty((len(B), 3, FEW)), np.empty((k, FEW)), np.empty(FEW)
    few, few_lanes, F = np.empty(FEW, np.int64), np.empty((6, FEW)), 0
    m = 0
    for i in range(len(begun.rows)):
        rows[i], vertices[i], origin[i], w[i] = begun.rows[i], begun.vertices[i], i, begun.weights[i]
        _point(A, B, u, radius_a, radius_b, ratio, z, rows[i], vertices[i], points[i])
        across[:, i] = points[i]
        for j in range(i + 1):
            G[i, j] = G[j, i] = points[i] @ points[j]
        m += 1
    if m:
        m = weigh(G, w, origin, m)
        _mean(points, origin, w, m, z)
    else:
        z[:] = 0.0
    found, anew, steps = -1, m == 0, 8 * D
    while steps > 0:
        steps -= 1
        row, vertex, lowest = 0, 0, np.inf
        square = z @ z
        if F:
            row, vertex, lowest = _worst(few_A, few_B, few_u, radius_a, radius_b, few_ratio, F, z, few_lanes)
            row = few[row]
        if F == 0 or lowest >= enough * square:
            # No point of those that mattered last is on its wrong side, so all are looked at.
            row, vertex, lowest = _worst(A, B, u, radius_a, radius_b, ratio, N, z, lanes)
            F = _lowest(lanes[5], N, few)
            for f in range(F):
                i = few[f]
                for v in range(len(A)):
                    for c in range(3):
                        few_A[v, c, f] = A[v, c, i]
                for v in range(len(B)):
                    for c in range(3):
                        few_B[v, c, f] = B[v, c, i]
                for e in range(k):
                    few_u[e, f] = u[e, i]
                few_ratio[f] = ratio[i]
        if m > 0:
            if square < least * least:
                found = 0
            elif lowest >= enough * square:
                found = 1
            elif not anew and (m > D or steps == 0):
                # Points that were found for another plane may be too near to each other to go on with, those of balls above all.
                m, F, anew, steps, z[:] = 0, 0, True, 8 * D, 0.0
                continue
            elif m > D:
                found = 1 if _worst(A, B, u, radius_a, radius_b, ratio, N, z, lanes)[2] > 0 else 0
            if found >= 0:
                break
        _point(A, B, u, radius_a, radius_b, ratio, z, row, vertex, point)
        products[:] = 0.0
        for c in range(D):
            t, column = point[c], across[c]
            for i in range(D + 2):
                products[i] += t * column[i]
        for i in range(m):
            G[i, m] = G[m, i] = products[origin[i]]
        G[m, m] = point @ point
        free = unused(origin, m)
        points[free] = point
        across[:, free] = point
        rows[free], vertices[free], origin[m] = row, vertex, free
        w[m] = 1.0 if m == 0 else 0.0
        m = weigh(G, w, origin, m + 1)
        _mean(points, origin, w, m, z)
    kept = origin[:m]
    return max(found, 0), Support(rows[kept], vertices[kept], w[:m].copy())


@njit(cache=True)
def _mean(points: Array, origin: Array, w: Array, m: int, z: Array) -> None:
    """Fills in the mean of m points, (D,)."""
    z[:] = 0.0
    for i in range(m):
        t, point = w[i], points[origin[i]]
        for c in range(len(z)):
            z[c] += t * point[c]


@njit(cache=True)
def _lowest(values: Array, N: int, few: Array) -> int:
    """Fills in the numbers of the lowest of N values, as many as there is room for, and returns how many these are."""
    if len(few) >= N:
        for i in range(N):
            few[i] = i
        return N
    limit, n = np.partition(values[:N], len(few) - 1)[len(few) - 1], 0
    for i in range(N):
        if values[i] <= limit and n < len(few):
            few[n] = i
            n += 1
    return n
