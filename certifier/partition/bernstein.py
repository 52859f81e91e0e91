"""Polynomials of degree 3 in each of k coordinates in Bernstein form: made, bounded, halved and evaluated, in compiled loops.

Long loops index reshaped arrays with loop variables alone, because Numba looks whether a sum is negative, and then there is no vector code.

A control point is a place in [0, 4)^k, of k own coordinates. The denominator is a product of one factor in each own coordinate, so its
control values are products, and so are those of the denominator times an own coordinate. ``den`` (2, k, 4) holds the factors: those of the
denominator, and those times the coordinate.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array

BLOCK = 2
"""Control values are computed in blocks over this many coordinates, which fill the registers."""
BATCH = 8
"""The polynomials of this many vertices are computed side by side."""
LARGE = 1e300
"""All control values are less than this."""


@njit(cache=True)
def elevate(values: Array, first: Array, last: Array) -> Array:
    """Returns the Bernstein coefficients of polynomials of degree 2 in each of k coordinates times a linear form in each, (4^k B,).

    Args:
        values: (3^k B,) coefficients of B polynomials; the first coordinate is the slowest, and the polynomial is the fastest.
        first, last: (k,) the linear forms' values at the two ends of each coordinate.
    """
    left, right = 1, len(values)
    for i in range(len(first)):
        right //= 3
        f, out = values.reshape(left, 3, right), np.empty((left, 4, right))
        a0, a1, a2 = first[i], 2 / 3.0 * first[i], 1 / 3.0 * first[i]
        b1, b2, b3 = 1 / 3.0 * last[i], 2 / 3.0 * last[i], last[i]
        for x in range(left):
            for y in range(right):
                out[x, 0, y] = a0 * f[x, 0, y]
                out[x, 1, y] = a1 * f[x, 1, y] + b1 * f[x, 0, y]
                out[x, 2, y] = a2 * f[x, 2, y] + b2 * f[x, 1, y]
                out[x, 3, y] = b3 * f[x, 2, y]
        values = out.reshape(out.size)
        left *= 4
    return values


@njit(cache=True)
def factors(X: Array, ends: Array) -> Array:
    """Returns the factors of the denominator, (2, k, 4).

    Args:
        X: (k, 3) Bernstein coefficients of the denominator in each own coordinate.
        ends: (4, k) both ends of the own coordinates and their weights.
    """
    k = len(X)
    den = np.zeros((2, k, 4))
    for i in range(k):
        l, u, w, v = ends[:, i]
        for j in range(4):
            if j < 3:
                den[0, i, j] += (3 - j) / 3.0 * w * X[i, j]
                den[1, i, j] += (3 - j) / 3.0 * w * l * X[i, j]
            if j > 0:
                den[0, i, j] += j / 3.0 * v * X[i, j - 1]
                den[1, i, j] += j / 3.0 * v * u * X[i, j - 1]
    return den


@njit(cache=True)
def polynomials(X: Array, vertices: Array, base: Array, own: Array, outside: Array, ends: Array) -> Array:
    """Returns the Bernstein coefficients of f den of all vertices, (V, 1 + o, 4^k).

    Args:
        X: (3^k, 4, 4) control matrices of the pose.
        vertices: (V, 3) metres.
        base: (4,) the plane at the middle of the outside coordinates; the radius is subtracted from its offset already.
        own, outside: (k, 4), (o, 4) what the own coordinates s_i and the outside coordinates, which are in [-1, 1], add to it.
        ends: (4, k) both ends of the own coordinates and their weights.
    """
    k, o, V = len(own), len(outside), len(vertices)
    c = np.empty((V, 1 + o, 4**k))
    first, last = ends[2].copy(), ends[3].copy()
    for begin in range(0, V, BATCH):
        B = min(BATCH, V - begin)
        p = np.empty((4, len(X), B))
        for e in range(4):
            for a in range(len(X)):
                for v in range(B):
                    x, y, z = vertices[begin + v]
                    p[e, a, v] = X[a, e, 0] * x + X[a, e, 1] * y + X[a, e, 2] * z + X[a, e, 3]
        total = elevate(_along(p, base), first, last)
        for i in range(k):
            first[i] *= ends[0, i]
            last[i] *= ends[1, i]
            total += elevate(_along(p, own[i]), first, last)
            first[i], last[i] = ends[2, i], ends[3, i]
        _spread(total, c[begin : begin + B, 0])
        for i in range(o):
            _spread(elevate(_along(p, outside[i]), first, last), c[begin : begin + B, 1 + i])
    return c


@njit(cache=True)
def _spread(values: Array, rows: Array) -> None:
    """Writes the values of B polynomials, (N B,), into rows of their own, (B, N)."""
    B, N = rows.shape
    columns = values.reshape(N, B)
    for v in range(B):
        row = rows[v]
        for a in range(N):
            row[a] = columns[a, v]


@njit(cache=True)
def _along(p: Array, plane: Array) -> Array:
    """Returns the scalar products of homogeneous points (4, N, B) with a plane (4,), flat."""
    q, values = p.reshape(4, -1), np.empty(p[0].size)
    for a in range(len(values)):
        values[a] = q[0, a] * plane[0] + q[1, a] * plane[1] + q[2, a] * plane[2] + q[3, a] * plane[3]
    return values


@njit(cache=True)
def halve(A: Array, axis: int, k: int, low: Array) -> None:
    """Halves a coordinate by de Casteljau's algorithm: ``low`` gets the Bernstein coefficients of the lower half, A those of the upper one.

    Args:
        A, low: (q, 4^k).
    """
    stride = 4 ** (k - 1 - axis)
    blocks = A.size // (4 * stride)
    high, out = A.reshape(blocks, 4, stride), low.reshape(blocks, 4, stride)
    if stride == 1:
        for b in range(blocks):
            c0, c1, c2, c3 = high[b, 0, 0], high[b, 1, 0], high[b, 2, 0], high[b, 3, 0]
            d0, d1, d2 = 0.5 * (c0 + c1), 0.5 * (c1 + c2), 0.5 * (c2 + c3)
            e0, e1 = 0.5 * (d0 + d1), 0.5 * (d1 + d2)
            f0 = 0.5 * (e0 + e1)
            out[b, 0, 0], out[b, 1, 0], out[b, 2, 0], out[b, 3, 0] = c0, d0, e0, f0
            high[b, 0, 0], high[b, 1, 0], high[b, 2, 0] = f0, e1, d2
        return
    for b in range(blocks):
        for y in range(stride):
            c0, c1, c2, c3 = high[b, 0, y], high[b, 1, y], high[b, 2, y], high[b, 3, y]
            d0, d1, d2 = 0.5 * (c0 + c1), 0.5 * (c1 + c2), 0.5 * (c2 + c3)
            e0, e1 = 0.5 * (d0 + d1), 0.5 * (d1 + d2)
            f0 = 0.5 * (e0 + e1)
            out[b, 0, y], out[b, 1, y], out[b, 2, y], out[b, 3, y] = c0, d0, e0, f0
            high[b, 0, y], high[b, 1, y], high[b, 2, y] = f0, e1, d2


@njit(cache=True)
def at(den: Array, place: int, values: Array) -> None:
    """Fills in the control values of the denominator, and of the denominator times each own coordinate, at one place, (1 + k,)."""
    k = den.shape[1]
    values[:] = 1.0
    for i in range(k - 1, -1, -1):
        x = place % 4
        place //= 4
        for e in range(1 + k):
            values[e] *= den[1, i, x] if e == 1 + i else den[0, i, x]


@njit(cache=True)
def _expanded(den: Array, slopes: Array, begin: int, end: int, base: float) -> tuple[Array, Array]:
    """Returns the control values of prod_i den_i and of (base + sum_i slopes_i s_i) prod_i den_i, over some own coordinates."""
    product, linear = np.empty(4 ** (end - begin)), np.empty(4 ** (end - begin))
    product[0], linear[0] = 1.0, base
    n = 1
    for i in range(begin, end):
        d0, d1, d2, d3 = den[0, i, 0], den[0, i, 1], den[0, i, 2], den[0, i, 3]
        s0, s1, s2, s3 = slopes[i] * den[1, i, 0], slopes[i] * den[1, i, 1], slopes[i] * den[1, i, 2], slopes[i] * den[1, i, 3]
        for b in range(n - 1, -1, -1):
            p, q = product[b], linear[b]
            product[4 * b], product[4 * b + 1], product[4 * b + 2], product[4 * b + 3] = p * d0, p * d1, p * d2, p * d3
            linear[4 * b], linear[4 * b + 1] = q * d0 + p * s0, q * d1 + p * s1
            linear[4 * b + 2], linear[4 * b + 3] = q * d2 + p * s2, q * d3 + p * s3
        n *= 4
    return product, linear


@njit(cache=True, fastmath=True)
def _least(z0: float, c: Array, p: Array, q: Array, product: Array, linear: Array, slopes: Array) -> tuple[float, int]:
    """Returns the least control value, and the first place of it.

    Every place in a block has a lane of its own, because LLVM makes vector code of independent lanes but not of one minimum.

    Args:
        c: (1 + o, B, n) of f, in blocks over the last own coordinates.
        p, q, product, linear: (B,), (B,), (n,), (n,) control values of the denominator and of the faces.
        slopes: (o,) of the faces in the outside coordinates.
    """
    o, blocks, n = c.shape[0] - 1, c.shape[1], c.shape[2]
    values, least, where = np.empty(n), np.full(n, LARGE), np.zeros(n, np.int64)
    for b in range(blocks):
        if o == 0:
            for y in range(n):
                t = z0 * c[0, b, y] - (q[b] * product[y] + p[b] * linear[y])
                less = t < least[y]
                least[y], where[y] = t if less else least[y], b if less else where[y]
            continue
        for y in range(n):
            values[y] = z0 * c[0, b, y] - (q[b] * product[y] + p[b] * linear[y])
        for i in range(1, o):
            slope = slopes[i - 1] * p[b]
            for y in range(n):
                values[y] -= abs(z0 * c[i, b, y] - slope * product[y])
        slope = slopes[o - 1] * p[b]
        for y in range(n):
            t = values[y] - abs(z0 * c[o, b, y] - slope * product[y])
            less = t < least[y]
            least[y], where[y] = t if less else least[y], b if less else where[y]
    lane = 0
    for y in range(1, n):
        if least[y] < least[lane] or (least[y] == least[lane] and where[y] < where[lane]):
            lane = y
    return least[lane], where[lane] * n + lane


@njit(cache=True)
def lowest(z: Array, c: Array, den: Array, constant: Array, own: Array, outside: Array, rest: Array, slopes: Array) -> tuple[float, int]:
    """Returns the least control value of z_0 f - sum_j z_j g_j, and the place of it.

    Args:
        z: (1 + m,).
        c: (1 + o, N) of f: the constant part, and the slopes in the outside coordinates, which are in [-1, 1].
        den: (2, k, 4) the factors of the denominator.
        constant, own, outside, rest: (m,), (m, k), (m, o), (m, r) of the faces g_j, in the coordinates of the piece.
        slopes: (k + o,) is overwritten with those of sum_j z_j g_j.
    """
    m, k, o = len(constant), den.shape[1], c.shape[0] - 1
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
            if z[1 + j] != 0.0:
                t += z[1 + j] * rest[j, i]
        base += abs(t)
    size = 0.0
    for i in range(k + o):
        size += abs(slopes[i])
    if not np.isfinite(z[0] + base + size):
        return -np.inf, 0
    first = max(k - BLOCK, 0)
    p, q = _expanded(den, slopes, 0, first, base)
    product, linear = _expanded(den, slopes, first, k, 0.0)
    return _least(z[0], c.reshape(1 + o, len(p), len(product)), p, q, product, linear, slopes[k:])


@njit(cache=True)
def extremes(values: Array) -> tuple[float, float]:
    """Returns the least and the largest of 4^k values."""
    n = min(len(values), 64)
    rows, low, high = values.reshape(-1, n), values[:n].copy(), values[:n].copy()
    for b in range(1, len(rows)):
        for y in range(n):
            low[y] = min(low[y], rows[b, y])
            high[y] = max(high[y], rows[b, y])
    return float(low.min()), float(high.max())


@njit(cache=True)
def steepest(c: Array, k: int) -> int:
    """Returns the coordinate to halve: the one in which f bends and varies most."""
    N, o = c.shape[1], c.shape[0] - 1
    most, axis = -1.0, 0
    lanes = np.empty(max(N // 4, 1))
    for i in range(k):
        stride = 4 ** (k - 1 - i)
        blocks = N // (4 * stride)
        f = c[0].reshape(blocks, 4, stride)
        if stride == 1:
            for b in range(blocks):
                d0, d1, d2 = f[b, 1, 0] - f[b, 0, 0], f[b, 2, 0] - f[b, 1, 0], f[b, 3, 0] - f[b, 2, 0]
                lanes[b] = 2 * max(abs(d1 - d0), abs(d2 - d1)) + 0.3 * max(max(abs(d0), abs(d1)), abs(d2))
            t = extremes(lanes[:blocks])[1]
        else:
            lanes[:stride] = 0.0
            for b in range(blocks):
                for y in range(stride):
                    d0, d1, d2 = f[b, 1, y] - f[b, 0, y], f[b, 2, y] - f[b, 1, y], f[b, 3, y] - f[b, 2, y]
                    lanes[y] = max(lanes[y], 2 * max(abs(d1 - d0), abs(d2 - d1)) + 0.3 * max(max(abs(d0), abs(d1)), abs(d2)))
            t = extremes(lanes[:stride])[1]
        if t > most:
            most, axis = t, i
    for i in range(o):
        low, high = extremes(c[1 + i])
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


@njit(cache=True)
def alone(c: Array, values: Array) -> float:
    """Fills in the least values that f has in the outside coordinates, (N,), and returns the least of them."""
    values[:] = c[0]
    for i in range(1, len(c)):
        for a in range(len(values)):
            values[a] -= abs(c[i, a])
    return extremes(values)[0]


@njit(cache=True)
def leasts(c: Array) -> Array:
    """Returns the least value of each f, (V,), of c (V, 1 + o, N)."""
    least, values = np.empty(len(c)), np.empty(c.shape[2])
    for v in range(len(c)):
        least[v] = alone(c[v], values)
    return least
