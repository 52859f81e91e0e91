"""A plane, affine in the configuration, is looked for that separates two bodies on a polytope: compiled loops.

Planes are found for some configurations of the polytope. Then each vertex is moved to where it is farthest on the wrong side, and such
configurations join the others, until there is no plane or none fails any more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.partition.chords import INSIDE
from certifier.partition.hulls import SHORTEST, SLOWEST, Hull, place
from certifier.partition.separate import Support, separate
from certifier.polytopes.simplex import WORK, corner

WRONG = -1e-9
"""A vertex with a smaller value than this is on the wrong side."""
STEEPEST = 5.0
"""The bound of a normal's length is taken to be at most this many times the length."""

LENGTHS = INSIDE * 0.5 ** np.arange(SHORTEST)
"""A step of a descent goes one of these parts of the way."""

NO_PLANE, FOUND, TIRED = 0, 1, 2


class Chart(NamedTuple):
    """The coordinates u = (s - shift) scale of a plane on a cell, which are in [-calm, calm].

    Attributes:
        joints: (k,) position indices.
        shift, scale: (k,).
    """

    joints: Array
    shift: Array
    scale: Array
    calm: float


@njit(cache=True)
def _coordinates(chart: Chart, s: Array, u: Array) -> None:
    """Fills in the coordinates u (k,) of a configuration."""
    for e in range(len(chart.joints)):
        u[e] = (s[chart.joints[e]] - chart.shift[e]) * chart.scale[e]


@njit(cache=True)
def _plane(z: Array, u: Array, plane: Array) -> None:
    """Fills in the plane z at u, (4,)."""
    k = len(u)
    for c in range(4):
        t = z[c * (k + 1)]
        for e in range(k):
            t += z[c * (k + 1) + 1 + e] * u[e]
        plane[c] = t


@njit(cache=True)
def _length(bound: Array, u: Array) -> float:
    """Returns the bound of the normal's length at u."""
    t = bound[0]
    for e in range(len(u)):
        t += bound[1 + e] * u[e]
    return float(t)


@njit(cache=True)
def length_bound(z: Array, k: int, calm: float, bound: Array) -> None:
    """Fills in a bound of the normal's length, affine in u, that holds where all |u_i| <= calm, (1 + k,).

    The length is convex, so a bound of it at the corners is enough. Its slopes are the mean differences between the corners.
    """
    corners = 1 << k
    lengths = np.empty(corners)
    bound[:] = 0.0
    for c in range(corners):
        t = 0.0
        for i in range(3):
            a = z[i * (k + 1)]
            for e in range(k):
                a += z[i * (k + 1) + 1 + e] * (calm if (c >> e) & 1 else -calm)
            t += a * a
        lengths[c] = np.sqrt(t)
        for e in range(k):
            bound[1 + e] += lengths[c] if (c >> e) & 1 else -lengths[c]
    for e in range(k):
        bound[1 + e] /= corners * calm
    for c in range(corners):
        t = lengths[c]
        for e in range(k):
            t -= bound[1 + e] * (calm if (c >> e) & 1 else -calm)
        bound[0] = max(bound[0], t)


@njit(cache=True)
def _images(hull: Hull, s: Array, images: Array) -> None:
    """Fills in where every factor of the pose moves a vertex to, times the denominator, (F + 1, 4); the last row is the vertex itself."""
    for f in range(len(hull.joints) - 1, -1, -1):
        j, terms, p = hull.joints[f], hull.terms[f], images[f + 1]
        for a in range(4):
            t = terms[0, a, 0] * p[0] + terms[0, a, 1] * p[1] + terms[0, a, 2] * p[2] + terms[0, a, 3] * p[3]
            if j >= 0:
                for b in range(4):
                    t += s[j] * (terms[1, a, b] + s[j] * terms[2, a, b]) * p[b]
            images[f, a] = t


@njit(cache=True)
def _value(hull: Hull, sign: float, z: Array, bound: Array, chart: Chart, s: Array, images: Array, u: Array, plane: Array) -> float:
    """Returns how far a vertex is on the right side of a plane at s, its radius times the bound of the normal's length subtracted.

    Args:
        images: (F + 1, 4) its last row is the vertex; the others are filled in (:func:`_images`).
        u, plane: (k,), (4,) get the coordinates of s and the plane there.
    """
    _images(hull, s, images)
    _coordinates(chart, s, u)
    _plane(z, u, plane)
    p = images[0]
    return sign * ((plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2]) / p[3] + plane[3]) - hull.radius * _length(bound, u)


@njit(cache=True)
def _slopes(hull: Hull, sign: float, z: Array, bound: Array, chart: Chart, s: Array, images: Array, plane: Array, slopes: Array) -> None:
    """Fills in the slopes of the value in s, (n,), from what :func:`_value` has filled in."""
    k, p, row, next_row = len(chart.joints), images[0], np.empty(4), np.empty(4)
    slopes[:] = 0.0
    for e in range(k):
        t = z[3 * (k + 1) + 1 + e]
        for c in range(3):
            t += z[c * (k + 1) + 1 + e] * p[c] / p[3]
        slopes[chart.joints[e]] = (sign * t - hull.radius * bound[1 + e]) * chart.scale[e]
    row[:3] = sign * plane[:3] / p[3]
    row[3] = -sign * (plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2]) / p[3] ** 2
    for f in range(len(hull.joints)):
        j, terms = hull.joints[f], hull.terms[f]
        next_row[:] = 0.0
        for a in range(4):
            for b in range(4):
                t = terms[0, a, b]
                if j >= 0:
                    t += s[j] * (terms[1, a, b] + s[j] * terms[2, a, b])
                    slopes[j] += row[a] * (terms[1, a, b] + 2 * s[j] * terms[2, a, b]) * images[f + 1, b]
                next_row[b] += row[a] * t
        row[:] = next_row


@njit(cache=True)
def _values_on_the_way(
    hull: Hull, vertex: Array, sign: float, z: Array, bound: Array, chart: Chart, s: Array, way: Array, lanes: Array, values: Array
) -> None:
    """Fills in the values of :func:`_value` at s + LENGTHS[i] way, (SHORTEST,), side by side in vector registers.

    Args:
        lanes: (12, SHORTEST) is overwritten.
    """
    p, q, plane, x = lanes[:4], lanes[4:8], lanes[8:], lanes[8]
    for c in range(4):
        p[c] = vertex[c]
    for f in range(len(hull.joints) - 1, -1, -1):
        j, terms = hull.joints[f], hull.terms[f]
        if j >= 0:
            for i in range(SHORTEST):
                x[i] = s[j] + LENGTHS[i] * way[j]
        for a in range(4):
            t = q[a]
            for i in range(SHORTEST):
                t[i] = terms[0, a, 0] * p[0, i] + terms[0, a, 1] * p[1, i] + terms[0, a, 2] * p[2, i] + terms[0, a, 3] * p[3, i]
            if j >= 0:
                for b in range(4):
                    linear, square = terms[1, a, b], terms[2, a, b]
                    if linear != 0 or square != 0:
                        for i in range(SHORTEST):
                            t[i] += x[i] * (linear + x[i] * square) * p[b, i]
        p, q = q, p
    k = len(chart.joints)
    for c in range(4):
        plane[c] = z[c * (k + 1)]
    values[:] = -hull.radius * bound[0]
    x = q[0]
    for e in range(k):
        j = chart.joints[e]
        for i in range(SHORTEST):
            x[i] = (s[j] + LENGTHS[i] * way[j] - chart.shift[e]) * chart.scale[e]
            values[i] -= hull.radius * bound[1 + e] * x[i]
        for c in range(4):
            slope = z[c * (k + 1) + 1 + e]
            for i in range(SHORTEST):
                plane[c, i] += slope * x[i]
    for i in range(SHORTEST):
        values[i] += sign * ((plane[0, i] * p[0, i] + plane[1, i] * p[1, i] + plane[2, i] * p[2, i]) / p[3, i] + plane[3, i])


@njit(cache=True)
def descend(
    hull: Hull,
    vertex: Array,
    sign: float,
    z: Array,
    bound: Array,
    chart: Chart,
    columns: Array,
    d: Array,
    s: Array,
    steps: int,
    basis: Array,
    edges: Array,
    work: Array,
) -> float:
    """Moves s to where the vertex is farther on the wrong side, by linear programs over {C s <= d}, and returns its value there.

    Args:
        columns: (n, m) the transpose of C, which has rows of length 1.
        basis, edges, work: see :func:`certifier.polytopes.simplex.corner`.
    """
    n = len(s)
    images, slopes, way = np.ones((len(hull.joints) + 1, 4)), np.empty(n), np.empty(n)
    u, plane, lanes, values = np.empty(len(chart.joints)), np.empty(4), np.empty((12, SHORTEST)), np.empty(SHORTEST)
    images[-1, :3] = vertex
    now = _value(hull, sign, z, bound, chart, s, images, u, plane)
    for _ in range(steps):
        _slopes(hull, sign, z, bound, chart, s, images, plane, slopes)
        for i in range(n):
            slopes[i] = -slopes[i]
        if len(d) == 2 * n:  # no face cuts the cell
            for i in range(n):
                way[i] = (d[i] if slopes[i] > 0 else -d[n + i]) - s[i] if slopes[i] != 0 else 0.0
        elif not corner(columns, d, s, slopes, basis, edges, work, way):
            break
        _values_on_the_way(hull, images[-1], sign, z, bound, chart, s, way, lanes, values)
        best = values.argmin()
        if values[best] >= now - SLOWEST * abs(now) + WRONG:
            break
        for i in range(n):
            s[i] += LENGTHS[best] * way[i]
        now = _value(hull, sign, z, bound, chart, s, images, u, plane)
    return now


@njit(cache=True)
def look(
    a: Hull, b: Hull, chart: Chart, C: Array, d: Array, X: Array, N: int, rounds: int, steps: int, least: float, enough: float
) -> tuple[int, Array, Array, Array, int]:
    """Looks for a plane that keeps a on its positive and b on its negative side on {C s <= d}.

    Args:
        C, d: with rows of length 1.
        X: (capacity, n) its first N rows are points of the polytope; those at which planes failed are added.
        rounds: give up after this many planes.
        least, enough: as for :func:`separate`.

    Returns:
        (NO_PLANE, FOUND or TIRED, the plane z (4 (k + 1),) in u, rows of X and weights as for :func:`separate`, the new N).
    """
    n, k, capacity, made = X.shape[1], len(chart.joints), len(X), 0
    V, W = len(a.vertices), len(b.vertices)
    A, B, u, ratio = np.empty((V, 3, capacity)), np.empty((W, 3, capacity)), np.empty((k, capacity)), np.ones(capacity)
    P, Q, s, bound, plane, at = np.empty((4, 4)), np.empty((4, 4)), np.empty(n), np.zeros(1 + k), np.empty(4), np.empty(k)
    points_a, points_b, z = np.empty((V, 3)), np.empty((W, 3)), np.zeros(4 * (k + 1))
    low, where = np.empty(V + W), np.empty(V + W, np.int64)
    columns, work = np.ascontiguousarray(C.T), np.empty((WORK, len(d)))
    # The programs of a vertex begin where its last one ended, and the first one where that of the vertex before did.
    basis, edges = np.full((V + W, n), -1), np.empty((V + W, n, n))
    support = Support(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))
    for _ in range(rounds):
        for i in range(made, N):
            place(a, X[i], P, Q, points_a)
            place(b, X[i], P, Q, points_b)
            A[:, :, i], B[:, :, i] = points_a, points_b
            _coordinates(chart, X[i], at)
            u[:, i] = at
        made = N
        found, support = separate(A, B, u, a.radius, b.radius, ratio, N, least, enough, z, support)
        if not found:
            return NO_PLANE, z, support.rows, support.weights, N
        if a.radius + b.radius > 0:
            length_bound(z, k, chart.calm, bound)
        low[:] = np.inf
        for i in range(N):
            at[:] = u[:, i]
            kappa = _length(bound, at)
            _plane(z, at, plane)
            if kappa > 0:
                # The bodies will have to keep their radius times this bound away from the next plane, if it is like this one.
                ratio[i] = min(kappa / np.sqrt(plane[0] ** 2 + plane[1] ** 2 + plane[2] ** 2), STEEPEST)
            for v in range(V):
                t = plane[0] * A[v, 0, i] + plane[1] * A[v, 1, i] + plane[2] * A[v, 2, i] + plane[3] - a.radius * kappa
                if t < low[v]:
                    low[v], where[v] = t, i
            for v in range(W):
                t = -(plane[0] * B[v, 0, i] + plane[1] * B[v, 1, i] + plane[2] * B[v, 2, i] + plane[3]) - b.radius * kappa
                if t < low[V + v]:
                    low[V + v], where[V + v] = t, i
        held = low.min() >= 0
        for v in range(V + W):
            s[:] = X[where[v]]
            if basis[v, 0] < 0 and v > 0:
                basis[v], edges[v] = basis[v - 1], edges[v - 1]
            if v < V:
                t = descend(a, a.vertices[v], 1.0, z, bound, chart, columns, d, s, steps, basis[v], edges[v], work)
            else:
                t = descend(b, b.vertices[v - V], -1.0, z, bound, chart, columns, d, s, steps, basis[v], edges[v], work)
            if t < WRONG and capacity > N:
                X[N] = s
                N += 1
        if made == N and held:
            return FOUND, z, support.rows, support.weights, N
    return TIRED, z, support.rows, support.weights, N
