"""Compiled loops run here: points of a polytope, the plane that separates two sets of points, and polynomials in Bernstein form.

Everything uses one thread. Nothing here is trusted: the verifier checks what is found.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array

NOTHING = 1e-12
"""A weight below this counts as 0."""
FEW = 24
"""So many configurations are looked at in each step for a plane, as long as one of them is on its wrong side."""


@njit(cache=True)
def chords(C: Array, d: Array, start: Array, targets: Array, steps: int, seed: int) -> Array:
    """Returns points close to the boundary of {C x <= d}, (len(targets) + 2 steps, n).

    The first ones lie where the ways from ``start`` to the targets leave the polytope, or at the targets themselves. The others are both
    ends of the chords of a hit-and-run walk from ``start``, which must be inside.
    """
    m, n = C.shape
    count = targets.shape[0]
    found = np.empty((count + 2 * steps, n))
    slack = np.maximum(d - C @ start, 0.0)
    for i in range(count):
        way = targets[i] - start
        rate = C @ way
        reach = 1.0
        for j in range(m):
            if rate[j] > 1e-14:
                reach = min(reach, slack[j] / rate[j])
        found[i] = start + 0.999999 * reach * way
    widths = np.empty(n)
    for i in range(n):
        low, high = -1e6, 1e6
        for j in range(m):
            if C[j, i] > 1e-14:
                high = min(high, slack[j] / C[j, i])
            elif C[j, i] < -1e-14:
                low = max(low, slack[j] / C[j, i])
        widths[i] = high - low
    np.random.seed(seed)
    x = start.copy()
    for r in range(steps):
        way = np.random.normal(0.0, 1.0, n) * widths
        rate = C @ way
        slack = np.maximum(d - C @ x, 0.0)
        low, high = -1e6, 1e6
        for j in range(m):
            if rate[j] > 1e-14:
                high = min(high, slack[j] / rate[j])
            elif rate[j] < -1e-14:
                low = max(low, slack[j] / rate[j])
        low, high = min(0.999999 * low, 0.0), max(0.999999 * high, 0.0)
        found[count + 2 * r] = x + low * way
        found[count + 2 * r + 1] = x + high * way
        x = x + (low + (high - low) * np.random.random()) * way
    return found


@njit(cache=True)
def _solved(A: Array) -> Array:
    """Returns A^-1 times ones for a positive definite matrix, by Cholesky's method; A is overwritten."""
    m = len(A)
    x = np.ones(m)
    for j in range(m):
        for i in range(j, m):
            t = A[i, j]
            for a in range(j):
                t -= A[i, a] * A[j, a]
            A[i, j] = np.sqrt(max(t, 1e-300)) if i == j else t / A[j, j]
        for a in range(j):
            x[j] -= A[j, a] * x[a]
        x[j] /= A[j, j]
    for j in range(m - 1, -1, -1):
        for a in range(j + 1, m):
            x[j] -= A[a, j] * x[a]
        x[j] /= A[j, j]
    return x


@njit(cache=True)
def weigh(G: Array, w: Array, rows: Array, m: int) -> int:
    """Moves the weights w of m points to the point of their hull that is nearest to 0, and drops points that get none.

    This is the minor cycle of Wolfe's algorithm (1976). ``rows`` is rearranged in the same way as the points that are kept.

    Args:
        G: the Gram matrix of the points; its rows and columns are rearranged as well.

    Returns:
        How many points are left.
    """
    while m > 1:
        trace = 0.0
        for i in range(m):
            trace += G[i, i]
        A = np.empty((m, m))
        for i in range(m):
            for j in range(m):
                A[i, j] = G[i, j] + trace / m
            A[i, i] += 1e-13 * trace
        best = _solved(A)
        best /= best.sum()
        if best.min() > NOTHING:
            w[:m] = best
            return m
        share = 1.0
        for i in range(m):
            if best[i] <= NOTHING and w[i] > best[i]:
                share = min(share, w[i] / (w[i] - best[i]))
        least = 0
        for i in range(m):
            w[i] += share * (best[i] - w[i])
            if w[i] < w[least]:
                least = i
        w[least] = 0.0
        kept = 0
        for i in range(m):
            if w[i] > NOTHING:
                w[kept], rows[kept] = w[i], rows[i]
                for j in range(m):
                    G[kept, j] = G[i, j]
                for j in range(m):
                    G[j, kept] = G[j, i]
                kept += 1
        m = kept
    w[0] = 1.0
    return m


@njit(cache=True)
def _unused(origin: Array, m: int) -> int:
    """Returns the first slot that is not among the first m of those in use."""
    for slot in range(m + 1):
        used = False
        for i in range(m):
            if origin[i] == slot:
                used = True
        if not used:
            return slot
    return m


@njit(cache=True)
def _worst(
    A: Array, B: Array, u: Array, radius_a: float, radius_b: float, rows: Array, z: Array, values: Array
) -> tuple[int, int, int, float]:
    """Returns the configuration, the vertex and the side (1 for A, -1 for B) that are farthest on the wrong side of a plane, and how far.

    Args:
        values: gets the least value at each of the rows, which is positive on the right side.
    """
    k = u.shape[1]
    plane = np.zeros(4)
    lowest, row, vertex, side = np.inf, 0, 0, 1
    for i in range(len(rows)):
        r = rows[i]
        for c in range(4):
            t = z[c * (k + 1)]
            for e in range(k):
                t += z[c * (k + 1) + 1 + e] * u[r, e]
            plane[c] = t
        norm = np.sqrt(plane[0] ** 2 + plane[1] ** 2 + plane[2] ** 2)
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
    A: Array, B: Array, u: Array, radius_a: float, radius_b: float, rows: Array, least: float, enough: float
) -> tuple[int, Array, Array, Array]:
    """Looks for the plane z, affine in u, that keeps the points A on its positive and B on its negative side with the widest margin.

    This is Wolfe's algorithm for the point nearest to 0 of the hull of all +-[p; 1] x [1; u].

    Args:
        A, B: (N, v, 3), (N, w, 3) points at N configurations.
        u: (N, k) the configurations.
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
        row, vertex, side, lowest = _worst(A, B, u, radius_a, radius_b, few, z, values)
        if m == 0 or lowest >= enough * (z @ z):
            # No point of those that mattered last is on its wrong side, so all are looked at.
            row, vertex, side, lowest = _worst(A, B, u, radius_a, radius_b, rows, z, values)
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
        direction /= length if length > 0 else 1.0
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
        free = _unused(origin, m)
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
def elevate(values: Array, first: Array, last: Array) -> Array:
    """Returns the Bernstein coefficients of a polynomial of degree 2 in each of k coordinates times a linear form in each, (4^k,).

    Args:
        values: (3^k,) coefficients; the first coordinate is the slowest.
        first, last: (k,) the linear forms' values at the two ends of each coordinate.
    """
    k = len(first)
    left, right = 1, 3**k
    for i in range(k):
        right //= 3
        out = np.empty(left * 4 * right)
        for x in range(left):
            for j in range(4):
                for y in range(right):
                    t = 0.0
                    if j < 3:
                        t += (3 - j) / 3.0 * first[i] * values[(x * 3 + j) * right + y]
                    if j > 0:
                        t += j / 3.0 * last[i] * values[(x * 3 + j - 1) * right + y]
                    out[(x * 4 + j) * right + y] = t
        values = out
        left *= 4
    return values


@njit(cache=True)
def polynomials(X: Array, vertices: Array, base: Array, own: Array, outside: Array, ends: Array) -> tuple[Array, Array]:
    """Returns the Bernstein coefficients of f den of all vertices, (V, 1 + o, 4^k), and of den and den s_i, (1 + k, 4^k).

    Args:
        X: (3^k, 4, 4) control matrices of the pose.
        vertices: (V, 3) metres.
        base: (4,) the plane at the middle of the outside coordinates; the radius is subtracted from its offset already.
        own, outside: (k, 4), (o, 4) what the own coordinates s_i and the outside coordinates, which are in [-1, 1], add to it.
        ends: (4, k) both ends of the own coordinates and their weights.
    """
    N, k, o, V = len(X), len(own), len(outside), len(vertices)
    first, last = ends[2].copy(), ends[3].copy()
    den = X[:, 3, 3].copy()
    T = np.empty((1 + k, 4**k))
    T[0] = elevate(den, first, last)
    for i in range(k):
        first[i] *= ends[0, i]
        last[i] *= ends[1, i]
        T[1 + i] = elevate(den, first, last)
        first[i], last[i] = ends[2, i], ends[3, i]
    c = np.empty((V, 1 + o, 4**k))
    p, values = np.empty((N, 4)), np.empty(N)
    for v in range(V):
        for a in range(N):
            for e in range(4):
                p[a, e] = X[a, e, 0] * vertices[v, 0] + X[a, e, 1] * vertices[v, 1] + X[a, e, 2] * vertices[v, 2] + X[a, e, 3]
            values[a] = p[a, 0] * base[0] + p[a, 1] * base[1] + p[a, 2] * base[2] + p[a, 3] * base[3]
        c[v, 0] = elevate(values, first, last)
        for i in range(k):
            for a in range(N):
                values[a] = p[a, 0] * own[i, 0] + p[a, 1] * own[i, 1] + p[a, 2] * own[i, 2] + p[a, 3] * own[i, 3]
            first[i] *= ends[0, i]
            last[i] *= ends[1, i]
            c[v, 0] += elevate(values, first, last)
            first[i], last[i] = ends[2, i], ends[3, i]
        for i in range(o):
            for a in range(N):
                values[a] = p[a, 0] * outside[i, 0] + p[a, 1] * outside[i, 1] + p[a, 2] * outside[i, 2] + p[a, 3] * outside[i, 3]
            c[v, 1 + i] = elevate(values, first, last)
    return c, T


@njit(cache=True)
def halve(A: Array, axis: int, k: int, low: Array, high: Array) -> None:
    """Writes the Bernstein coefficients of both halves of a coordinate, by de Casteljau's algorithm, for every row of A, (q, 4^k).

    ``low`` or ``high`` may be A itself.
    """
    q, N = A.shape
    stride = 4 ** (k - 1 - axis)
    for r in range(q):
        for block in range(0, N, 4 * stride):
            for b in range(block, block + stride):
                c0, c1, c2, c3 = A[r, b], A[r, b + stride], A[r, b + 2 * stride], A[r, b + 3 * stride]
                d0, d1, d2 = 0.5 * (c0 + c1), 0.5 * (c1 + c2), 0.5 * (c2 + c3)
                e0, e1 = 0.5 * (d0 + d1), 0.5 * (d1 + d2)
                f0 = 0.5 * (e0 + e1)
                low[r, b], low[r, b + stride], low[r, b + 2 * stride], low[r, b + 3 * stride] = c0, d0, e0, f0
                high[r, b], high[r, b + stride], high[r, b + 2 * stride], high[r, b + 3 * stride] = f0, e1, d2, c3


@njit(cache=True)
def lowest(z: Array, c: Array, T: Array, constant: Array, own: Array, outside: Array, rest: Array, slopes: Array) -> tuple[float, int]:
    """Returns the least control value of z_0 f - sum_j z_j g_j, and the place of it.

    Args:
        z: (1 + m,).
        c: (1 + o, N) of f: the constant part, and the slopes in the outside coordinates, which are in [-1, 1].
        T: (1 + k, N) of the denominator, and of the denominator times each own coordinate.
        constant, own, outside, rest: (m,), (m, k), (m, o), (m, r) of the faces g_j, in the coordinates of the piece.
        slopes: (k + o,) is overwritten with those of sum_j z_j g_j.
    """
    N, m, k, o = c.shape[1], len(constant), T.shape[0] - 1, c.shape[0] - 1
    slopes[:] = 0.0
    base = 0.0
    for j in range(m):
        if z[1 + j] != 0.0:
            base += z[1 + j] * constant[j]
            for i in range(k):
                slopes[i] += z[1 + j] * own[j, i]
            for i in range(o):
                slopes[k + i] += z[1 + j] * outside[j, i]
    for i in range(rest.shape[1]):
        t = 0.0
        for j in range(m):
            t += z[1 + j] * rest[j, i]
        base += abs(t)
    least, place = np.inf, 0
    for a in range(N):
        t = z[0] * c[0, a] - base * T[0, a]
        for i in range(k):
            t -= slopes[i] * T[1 + i, a]
        for i in range(o):
            t -= abs(z[0] * c[1 + i, a] - slopes[k + i] * T[0, a])
        if t < least:
            least, place = t, a
    return least, place


@njit(cache=True)
def steepest(c: Array, k: int) -> int:
    """Returns the coordinate to halve: the one in which f bends and varies most."""
    N, o = c.shape[1], c.shape[0] - 1
    most, axis = -1.0, 0
    for i in range(k):
        stride = 4 ** (k - 1 - i)
        t = 0.0
        for block in range(0, N, 4 * stride):
            for b in range(block, block + stride):
                d0, d1, d2 = (
                    c[0, b + stride] - c[0, b],
                    c[0, b + 2 * stride] - c[0, b + stride],
                    c[0, b + 3 * stride] - c[0, b + 2 * stride],
                )
                t = max(t, 2 * max(abs(d1 - d0), abs(d2 - d1)) + 0.3 * max(max(abs(d0), abs(d1)), abs(d2)))
        if t > most:
            most, axis = t, i
    for i in range(o):
        low, high = c[1 + i].min(), c[1 + i].max()
        t = (high - low) + 0.3 * max(abs(low), abs(high))
        if t > most:
            most, axis = t, k + i
    return axis


@njit(cache=True)
def evaluate(c: Array, spot: Array, ends: Array) -> float:
    """Returns f times a positive number at a point.

    Args:
        c: (1 + o, 4^k) of f.
        spot: the values of the own coordinates, then the outside coordinates in [-1, 1].
        ends: (4, k) of the own coordinates: both ends and their weights.
    """
    k, o = ends.shape[1], c.shape[0] - 1
    values = c[0].copy()
    for i in range(o):
        values += spot[k + i] * c[1 + i]
    N = len(values)
    for i in range(k):
        low, high = ends[2, i] * (spot[i] - ends[0, i]), ends[3, i] * (ends[1, i] - spot[i])
        t = min(max(low / (low + high), 0.0), 1.0)
        N //= 4
        for y in range(N):
            d0 = (1 - t) * values[y] + t * values[N + y]
            d1 = (1 - t) * values[N + y] + t * values[2 * N + y]
            d2 = (1 - t) * values[2 * N + y] + t * values[3 * N + y]
            values[y] = (1 - t) * ((1 - t) * d0 + t * d1) + t * ((1 - t) * d1 + t * d2)
    return values[0]


PROVED, REFUTED, UNDECIDED = 1, 0, -1


@njit(cache=True)
def prove(
    c: Array,
    T: Array,
    ends: Array,
    constant: Array,
    own: Array,
    outside: Array,
    rest: Array,
    precision: float,
    most: int,
    codes: Array,
    counts: Array,
    faces: Array,
    values: Array,
    lengths: Array,
    point: Array,
    halvings: Array,
) -> int:
    """Proves that f > 0 wherever all g_j >= 0, on a box that is halved where one set of multipliers is not enough.

    Every piece gets multipliers with z_0 f - sum_j z_j g_j > 0 at its control points, or z_0 = 0 where the piece misses the polytope.

    Args:
        c, T, constant, own, outside, rest: as for :func:`lowest`.
        ends: as for :func:`evaluate`.
        precision: control values must be larger than this multiple of the magnitude of what they are made of.
        most: give up after this many pieces.
        codes, counts, faces, values: streams of the proof (certifier.proof.partition), written from ``lengths`` on.
        lengths: (3,) of codes, counts and faces; they are advanced.
        point: (k + o + r,) gets a point of the polytope where f < 0, when REFUTED: own coordinates as they are, the others in [-1, 1].
        halvings: (k + o,) counts how often each coordinate was halved.

    Returns:
        PROVED, REFUTED or UNDECIDED.
    """
    N, m, k, o, r = c.shape[1], len(constant), T.shape[0] - 1, c.shape[0] - 1, rest.shape[1]
    D, depth = 1 + m, 40
    stack_c, stack_T, stack_z = np.empty((depth, 1 + o, N)), np.empty((depth, 1 + k, N)), np.zeros((depth, D))
    center, half = np.zeros((depth, o)), np.ones((depth, o))
    stack_c[0], stack_T[0], stack_z[0, 0] = c, T, 1.0
    slopes, local, g_out = np.empty(k + o), np.empty(m), np.empty((m, o))
    points, G, w = np.zeros((D + 2, D)), np.zeros((D + 2, D + 2)), np.zeros(D + 2)
    where = np.zeros((D + 2, k + o + r + 1))
    origin, scale = np.zeros(D + 2, np.int64), np.empty(D)
    x, z, trial, row, spot = np.zeros(D), np.zeros(D), np.zeros(D), np.zeros(D), np.zeros(k + o + r)
    top, count = 1, 0
    while top:
        top -= 1
        count += 1
        cc, TT = stack_c[top], stack_T[top]
        size, weight = np.abs(cc[0]).max(), np.abs(TT[0]).max()
        for j in range(m):
            local[j] = constant[j]
            for i in range(o):
                local[j] += outside[j, i] * center[top, i]
                g_out[j, i] = outside[j, i] * half[top, i]
        scale[0] = size
        for j in range(m):
            t = abs(local[j])
            for i in range(k):
                t += abs(own[j, i]) * np.abs(TT[1 + i]).max() / weight
            for i in range(o):
                t += abs(g_out[j, i])
            for i in range(r):
                t += abs(rest[j, i])
            scale[1 + j] = t * weight
        z[:] = stack_z[top]
        found = lowest(z, cc, TT, local, own, g_out, rest, slopes)[0] > precision * (z * scale).sum()
        if not found and z[1:].any():
            z[:] = 0.0
            z[0] = 1.0
            found = lowest(z, cc, TT, local, own, g_out, rest, slopes)[0] > precision * size
        if not found and m:
            n = 0
            for _ in range(60):
                place = lowest(z, cc, TT, local, own, g_out, rest, slopes)[1]
                if n > D:
                    break
                negative = -1
                for j in range(D):
                    if z[j] < -1e-9 * np.abs(z).max():
                        negative = j
                row[:] = 0.0
                spot[:] = 0.0
                if negative >= 0:
                    row[negative] = 1.0
                else:
                    den = TT[0, place]
                    row[0] = cc[0, place]
                    for i in range(k):
                        spot[i] = TT[1 + i, place]
                    for i in range(o):
                        spot[k + i] = -1.0 if z[0] * cc[1 + i, place] - slopes[k + i] * den > 0 else 1.0
                        row[0] += spot[k + i] * cc[1 + i, place]
                    for i in range(r):
                        t = 0.0
                        for j in range(m):
                            t += z[1 + j] * rest[j, i]
                        spot[k + o + i] = 1.0 if t > 0 else -1.0
                    for j in range(m):
                        t = local[j] * den
                        for i in range(k):
                            t += own[j, i] * TT[1 + i, place]
                        for i in range(o):
                            t += spot[k + i] * g_out[j, i] * den
                        for i in range(r):
                            t += spot[k + o + i] * rest[j, i] * den
                        row[1 + j] = -t
                    for i in range(o + r):
                        spot[k + i] *= den
                    for j in range(D):
                        row[j] /= scale[j]
                for i in range(n):
                    t = 0.0
                    for j in range(D):
                        t += points[origin[i], j] * row[j]
                    G[i, n] = G[n, i] = t
                G[n, n] = row @ row
                free = _unused(origin, n)
                points[free] = row
                where[free, : k + o + r] = spot
                where[free, k + o + r] = 0.0 if negative >= 0 else TT[0, place]
                origin[n] = free
                w[n] = 1.0 if n == 0 else 0.0
                n = weigh(G, w, origin, n + 1)
                x[:] = 0.0
                for i in range(n):
                    for j in range(D):
                        x[j] += w[i] * points[origin[i], j]
                if x @ x < 1e-10:
                    break
                for j in range(D):
                    z[j] = x[j] / scale[j]
                if z[0] > 0:
                    # The multipliers are stored in single precision.
                    trial[0] = 1.0
                    for j in range(m):
                        trial[1 + j] = np.float32(max(z[1 + j] / z[0], 0.0))
                    magnitude = size + (trial[1:] * scale[1:]).sum()
                    if lowest(trial, cc, TT, local, own, g_out, rest, slopes)[0] > precision * magnitude:
                        z[:] = trial
                        found = True
                        break
                if z[0] <= 1e-6 * np.abs(z).max():
                    trial[0] = 0.0
                    largest = 0.0
                    for j in range(m):
                        largest = max(largest, z[1 + j])
                    if largest > 0:
                        for j in range(m):
                            trial[1 + j] = np.float32(max(z[1 + j] / largest, 0.0))
                        if lowest(trial, cc, TT, local, own, g_out, rest, slopes)[0] > precision * (trial[1:] * scale[1:]).sum():
                            z[:] = trial
                            found = True
                            break
                z /= np.abs(z).max()
            if not found and n and x @ x < 1e-10:
                # The rows come to 0, so the mean of their places lies in the polytope; there f may be negative.
                total = 0.0
                spot[:] = 0.0
                for i in range(n):
                    total += w[i] * where[origin[i], k + o + r]
                    for a in range(k + o + r):
                        spot[a] += w[i] * where[origin[i], a]
                if total > 0:
                    for a in range(k + o + r):
                        spot[a] /= total
                    for i in range(o):
                        spot[k + i] = center[top, i] + half[top, i] * spot[k + i]
                    if evaluate(c, spot, ends) < 0:
                        point[:] = spot
                        return REFUTED
        if found:
            if lengths[0] >= len(codes) or lengths[1] >= len(counts):
                return UNDECIDED
            codes[lengths[0]] = -1 if z[0] > 0 else -2
            lengths[0] += 1
            used_faces = 0
            for j in range(m):
                if z[1 + j] > 0:
                    if lengths[2] >= len(faces):
                        return UNDECIDED
                    faces[lengths[2]], values[lengths[2]] = j, z[1 + j]
                    lengths[2] += 1
                    used_faces += 1
            counts[lengths[1]] = used_faces
            lengths[1] += 1
            continue
        if count >= most or top + 2 > depth or lengths[0] >= len(codes):
            return UNDECIDED
        axis = steepest(cc, k)
        halvings[axis] += 1
        codes[lengths[0]] = axis
        lengths[0] += 1
        for j in range(D):
            stack_z[top, j] = max(z[j], 0.0) if z[0] > 0 else 0.0
        if z[0] <= 0:
            stack_z[top, 0] = 1.0
        elif z[0] != 1.0:
            for j in range(m):
                stack_z[top, 1 + j] = np.float32(stack_z[top, 1 + j] / z[0])
            stack_z[top, 0] = 1.0
        stack_z[top + 1] = stack_z[top]
        center[top + 1], half[top + 1] = center[top], half[top]
        if axis < k:
            halve(cc, axis, k, stack_c[top + 1], stack_c[top])
            halve(TT, axis, k, stack_T[top + 1], stack_T[top])
        else:
            i = axis - k
            stack_T[top + 1], stack_c[top + 1] = TT, cc
            for a in range(N):
                t = 0.5 * cc[1 + i, a]
                stack_c[top + 1, 0, a] = cc[0, a] - t
                stack_c[top, 0, a] = cc[0, a] + t
                stack_c[top, 1 + i, a] = stack_c[top + 1, 1 + i, a] = t
            half[top, i] *= 0.5
            half[top + 1, i] = half[top, i]
            center[top + 1, i] = center[top, i] - half[top, i]
            center[top, i] += half[top, i]
        top += 2
    return PROVED
