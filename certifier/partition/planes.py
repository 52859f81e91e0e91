"""A plane, affine in the configuration, is looked for that separates two bodies on a polytope: compiled loops.

Planes are found for some configurations of the polytope. Then each vertex is moved to where it is farthest on the wrong side, and such
configurations join the others, until there is no plane or none fails any more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.partition.hulls import SLOWEST, Hull, along, place
from certifier.partition.wolfe import unused, weigh

FEW = 24
"""So many configurations are looked at in each step for a plane, as long as one of them is on its wrong side."""
WRONG = -1e-9
"""A vertex with a smaller value than this is on the wrong side."""
STEEPEST = 5.0
"""The bound of a normal's length counts as so many times the length at most."""

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
def _worst(
    A: Array, B: Array, u: Array, radius_a: float, radius_b: float, ratio: Array, rows: Array, z: Array, values: Array
) -> tuple[int, int, int, float]:
    """Returns the configuration, the vertex and the side (1 for A, -1 for B) that are farthest on the wrong side of a plane, and how far.

    Args:
        values: gets the least value at each of the rows, which is positive on the right side.
    """
    plane = np.zeros(4)
    lowest, row, vertex, side = np.inf, 0, 0, 1
    for i in range(len(rows)):
        r = rows[i]
        _plane(z, u[r], plane)
        norm = ratio[r] * np.sqrt(plane[0] ** 2 + plane[1] ** 2 + plane[2] ** 2)
        least = np.inf
        for v in range(A.shape[1]):
            t = plane[0] * A[r, v, 0] + plane[1] * A[r, v, 1] + plane[2] * A[r, v, 2] + plane[3] - radius_a * norm
            if t < least:
                least = t
                if t < lowest:
                    lowest, row, vertex, side = t, r, v, 1
        for v in range(B.shape[1]):
            t = -(plane[0] * B[r, v, 0] + plane[1] * B[r, v, 1] + plane[2] * B[r, v, 2] + plane[3]) - radius_b * norm
            if t < least:
                least = t
                if t < lowest:
                    lowest, row, vertex, side = t, r, v, -1
        values[i] = least
    return row, vertex, side, lowest


@njit(cache=True)
def separate(
    A: Array, B: Array, u: Array, radius_a: float, radius_b: float, ratio: Array, rows: Array, least: float, enough: float
) -> tuple[int, Array, Array, Array]:
    """Looks for the plane z, affine in u, that keeps the points A on its positive and B on its negative side with the widest margin.

    This is Wolfe's algorithm for the point nearest to 0 of the hull of all +-[p; 1] x [1; u].

    Args:
        A, B: (N, v, 3), (N, w, 3) points at N configurations.
        u: (N, k) the configurations.
        ratio: (N,) the bodies keep so many times their radius away from the plane there.
        rows: configurations to look at.
        least: a plane with a smaller margin than this counts as none.
        enough: any plane with this share of the widest margin will do.

    Returns:
        (found, z (4 (k + 1),), configurations (m,), weights (m,)): these weights of points at these configurations come to the point that
        is nearest to 0, which is z.
    """
    k = u.shape[1]
    D = 4 * (k + 1)
    points, G, w = np.zeros((D + 2, D)), np.zeros((D + 2, D + 2)), np.zeros(D + 2)
    places = np.zeros(D + 2, np.int64)
    origin = np.zeros(D + 2, np.int64)
    z, direction, point = np.zeros(D), np.zeros(3), np.zeros(D)
    m = 0
    values = np.empty(len(rows))
    few = rows[:0]
    for _ in range(8 * D):
        row, vertex, side, lowest = _worst(A, B, u, radius_a, radius_b, ratio, few, z, values)
        if m == 0 or lowest >= enough * (z @ z):
            # No point of those that mattered last is on its wrong side, so all are looked at.
            row, vertex, side, lowest = _worst(A, B, u, radius_a, radius_b, ratio, rows, z, values)
            few = rows[np.argsort(values)[:FEW]]
        if m > 0:
            square = 0.0
            for i in range(D):
                square += z[i] * z[i]
            if square < least * least:
                return 0, z, places[:m].copy(), w[:m].copy()
            if lowest >= enough * square:
                return 1, z, places[:m].copy(), w[:m].copy()
            if m > D:
                return (1 if lowest > 0 else 0), z, places[:m].copy(), w[:m].copy()
        for c in range(3):
            direction[c] = z[c * (k + 1)]
            for e in range(k):
                direction[c] += z[c * (k + 1) + 1 + e] * u[row, e]
        length = np.sqrt(direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2)
        direction *= ratio[row] / length if length > 0 else 0.0
        for c in range(4):
            t = 1.0
            if c < 3:
                t = A[row, vertex, c] - radius_a * direction[c] if side > 0 else B[row, vertex, c] + radius_b * direction[c]
            point[c * (k + 1)] = side * t
            for e in range(k):
                point[c * (k + 1) + 1 + e] = side * t * u[row, e]
        for i in range(m):
            t = 0.0
            for c in range(D):
                t += points[origin[i], c] * point[c]
            G[i, m] = G[m, i] = t
        t = 0.0
        for c in range(D):
            t += point[c] * point[c]
        G[m, m] = t
        free = unused(origin, m)
        points[free] = point
        origin[m] = free
        keys = np.empty(m + 1, np.int64)
        for i in range(m):
            keys[i] = origin[i] * 1000000 + places[i]
        keys[m] = free * 1000000 + row
        w[m] = 1.0 if m == 0 else 0.0
        m = weigh(G, w, keys, m + 1)
        for i in range(m):
            origin[i], places[i] = keys[i] // 1000000, keys[i] % 1000000
        z[:] = 0.0
        for i in range(m):
            for c in range(D):
                z[c] += w[i] * points[origin[i], c]
    return 0, z, places[:m].copy(), w[:m].copy()


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
def descend(
    hull: Hull, vertex: Array, sign: float, z: Array, bound: Array, chart: Chart, C: Array, d: Array, s: Array, steps: int, basis: Array
) -> float:
    """Moves s to where the vertex is farther on the wrong side, by linear programs over {C s <= d}, and returns its value there.

    Args:
        C, d: rows of length 1.
        basis: see :func:`certifier.polytopes.simplex.corner`.
    """
    images, slopes = np.ones((len(hull.joints) + 1, 4)), np.empty(len(s))
    u, plane = np.empty(len(chart.joints)), np.empty(4)
    images[-1, :3] = vertex
    now = _value(hull, sign, z, bound, chart, s, images, u, plane)
    for _ in range(steps):
        _slopes(hull, sign, z, bound, chart, s, images, plane, slopes)
        least, best = np.inf, -1
        trials = along(C, d, s, -slopes, basis)
        for i in range(len(trials)):
            t = _value(hull, sign, z, bound, chart, trials[i], images, u, plane)
            if t < least:
                least, best = t, i
        if best < 0 or least >= now - SLOWEST * abs(now) + WRONG:
            break
        s[:] = trials[best]
        now = _value(hull, sign, z, bound, chart, s, images, u, plane)
    return now


@njit(cache=True)
def look(
    a: Hull, b: Hull, chart: Chart, C: Array, d: Array, X: Array, N: int, rounds: int, steps: int, least: float, enough: float
) -> tuple[int, Array, Array, Array, int]:
    """Looks for a plane that keeps a on its positive and b on its negative side on {C s <= d}.

    Args:
        C, d: as for :func:`descend`.
        X: (capacity, n) its first N rows are points of the polytope; those at which planes failed are added.
        rounds: give up after so many planes.
        least, enough: as for :func:`separate`.

    Returns:
        (NO_PLANE, FOUND or TIRED, the plane z (4 (k + 1),) in u, rows of X and weights as for :func:`separate`, the new N).
    """
    n, k, capacity, made = X.shape[1], len(chart.joints), len(X), 0
    V, W = len(a.vertices), len(b.vertices)
    A, B, u, ratio = np.empty((capacity, V, 3)), np.empty((capacity, W, 3)), np.empty((capacity, k)), np.ones(capacity)
    P, Q, s, bound, plane = np.empty((4, 4)), np.empty((4, 4)), np.empty(n), np.zeros(1 + k), np.empty(4)
    low, where, basis = np.empty(V + W), np.empty(V + W, np.int64), np.full(n, -1)
    for _ in range(rounds):
        for i in range(made, N):
            place(a, X[i], P, Q, A[i])
            place(b, X[i], P, Q, B[i])
            _coordinates(chart, X[i], u[i])
        made = N
        found, z, places, weights = separate(A[:N], B[:N], u[:N], a.radius, b.radius, ratio, np.arange(N), least, enough)
        if not found:
            return NO_PLANE, z, places, weights, N
        if a.radius + b.radius > 0:
            length_bound(z, k, chart.calm, bound)
        low[:] = np.inf
        for i in range(N):
            kappa = _length(bound, u[i])
            _plane(z, u[i], plane)
            if kappa > 0:
                # The bodies will have to keep their radius times this bound away from the next plane, if it is like this one.
                ratio[i] = min(kappa / np.sqrt(plane[0] ** 2 + plane[1] ** 2 + plane[2] ** 2), STEEPEST)
            for v in range(V + W):
                p = A[i, v] if v < V else B[i, v - V]
                t = plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] + plane[3]
                t = t - a.radius * kappa if v < V else -t - b.radius * kappa
                if t < low[v]:
                    low[v], where[v] = t, i
        held = low.min() >= 0
        for v in range(V + W):
            s[:] = X[where[v]]
            if v < V:
                t = descend(a, a.vertices[v], 1.0, z, bound, chart, C, d, s, steps, basis)
            else:
                t = descend(b, b.vertices[v - V], -1.0, z, bound, chart, C, d, s, steps, basis)
            if t < WRONG and capacity > N:
                X[N] = s
                N += 1
        if made == N and held:
            return FOUND, z, places, weights, N
    return TIRED, z, places, weights, N
