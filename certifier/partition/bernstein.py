"""Polynomials in Bernstein form are proved positive on a polytope, one box of it after the other.

Long loops index reshaped arrays with loop variables alone, because Numba looks whether a sum is negative, and then there is no vector code.

A control point is a place in [0, 4)^k, of k own coordinates. The denominator is a product of one factor in each own coordinate, so its
control values are products, and so are those of the denominator times an own coordinate. ``den`` (2, k, 4) holds the factors: those of the
denominator, and those times the coordinate.

Everything uses one thread. Nothing here is trusted: the verifier checks what is found.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.partition.wolfe import unused, weigh
from certifier.proof.limits import PIECE_DEPTH

PROVED, REFUTED, UNDECIDED = 1, 0, -1
FACES, MORE, ATTEMPTS = 10, 4, 4
"""A piece is tried with FACES faces, then with MORE of those that its last answer violated, in so many attempts."""
LOWEST = 32
"""So many of the lowest control points say which faces these are."""
BLOCK = 2
"""Control values are computed in blocks over so many coordinates, which fill the registers."""
BATCH = 8
"""The polynomials of so many vertices are computed side by side."""
LARGE = 1e300
"""All control values are less than this."""
STEPS, ZERO = 40, 1e-10
"""Multipliers are given up after STEPS control points, or where the square of the distance of their rows' hull from 0 is below ZERO."""
EARLY, HOPELESS = 16, 4.0
"""A proof is given up when, after EARLY pieces, what they have proved lets one expect HOPELESS times as many pieces as are allowed."""
DEPTH = 40
"""At most so many pieces wait while others are tried."""
WHOLE = 0.1
"""A piece is as precise as this part of the cell, at least."""
SLIGHT = 1e-6
"""f counts for nothing where it has less than this part of the largest multiplier."""
OUTSIDE = 1e-7
"""A point of the polytope may be beyond a face by this, relative to the magnitude of the face's values."""


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
def _at(den: Array, place: int, values: Array) -> None:
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
def _range(values: Array) -> tuple[float, float]:
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
            t = _range(lanes[:blocks])[1]
        else:
            lanes[:stride] = 0.0
            for b in range(blocks):
                for y in range(stride):
                    d0, d1, d2 = f[b, 1, y] - f[b, 0, y], f[b, 2, y] - f[b, 1, y], f[b, 3, y] - f[b, 2, y]
                    lanes[y] = max(lanes[y], 2 * max(abs(d1 - d0), abs(d2 - d1)) + 0.3 * max(max(abs(d0), abs(d1)), abs(d2)))
            t = _range(lanes[:stride])[1]
        if t > most:
            most, axis = t, i
    for i in range(o):
        low, high = _range(c[1 + i])
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
def _alone(c: Array, values: Array) -> float:
    """Fills in the least values that f has in the outside coordinates, (N,), and returns the least of them."""
    values[:] = c[0]
    for i in range(1, len(c)):
        for a in range(len(values)):
            values[a] -= abs(c[i, a])
    return _range(values)[0]


@njit(cache=True)
def leasts(c: Array) -> Array:
    """Returns the least value of each f, (V,), of c (V, 1 + o, N)."""
    least, values = np.empty(len(c)), np.empty(c.shape[2])
    for v in range(len(c)):
        least[v] = _alone(c[v], values)
    return least


@njit(cache=True)
def _first(values: Array, value: float) -> int:
    """Returns the first place of a value that is among the values."""
    for place in range(len(values)):
        if values[place] == value:
            return place
    return 0


@njit(cache=True)
def choose(
    f: Array, c: Array, den: Array, constant: Array, own: Array, outside: Array, scale: Array, z: Array, limit: float, chosen: Array
) -> int:
    """Fills in the faces that may help most, those with multipliers in z first, and returns how many there are, which is 1 at least.

    A face helps where f is negative, if it is negative there as well.

    Args:
        f: (N,) the least values of f in the outside coordinates.
        c, den, constant: as for :func:`lowest`.
        own, outside: (k, m), (o, m) of the faces.
        scale: (1 + m,) the magnitude of f and of each face.
        limit: f is looked at where it is not larger than this.
        chosen: gets their numbers.
    """
    N, m, k, o = c.shape[1], len(constant), den.shape[1], c.shape[0] - 1
    gain, used, t, T = np.zeros(m), np.zeros(m, np.bool_), np.empty(m), np.empty(1 + k)
    count = 0
    for a in range(N):
        if f[a] > limit:
            continue
        _at(den, a, T)
        t[:] = constant
        for e in range(o):
            sign = -1.0 if c[1 + e, a] > 0 else 1.0
            for j in range(m):
                t[j] += sign * outside[e, j]
        for j in range(m):
            t[j] *= T[0]
        for e in range(k):
            for j in range(m):
                t[j] += own[e, j] * T[1 + e]
        for j in range(m):
            gain[j] -= min(t[j], 0.0)
        count += 1
        if count == LOWEST:
            break
    for j in range(m):
        gain[j] /= scale[1 + j]
    n = 0
    for j in range(m):
        if z[1 + j] > 0 and n < FACES:
            chosen[n] = j
            used[j] = True
            n += 1
    first = n
    for j in range(m):
        if gain[j] > 0 and not used[j]:
            n = _ranked(gain, chosen, first, n, j, FACES)
    return max(n, 1)


@njit(cache=True)
def _ranked(gain: Array, chosen: Array, first: int, n: int, j: int, most: int) -> int:
    """Puts a number where it belongs among those from ``first`` on, of which the one with the largest gain is first."""
    place = n
    while place > first and gain[chosen[place - 1]] < gain[j]:
        place -= 1
    if place >= most:
        return n
    n = min(n + 1, most)
    for i in range(n - 1, place, -1):
        chosen[i] = chosen[i - 1]
    chosen[place] = j
    return n


@njit(cache=True)
def multipliers(
    c: Array,
    den: Array,
    constant: Array,
    own: Array,
    outside: Array,
    rest: Array,
    scale: Array,
    needed: Array,
    place: int,
    z: Array,
    spot: Array,
) -> int:
    """Looks for z >= 0 with z_0 f - sum_j z_j g_j > 0 at all control points, by Wolfe's algorithm over their rows.

    Args:
        c, den, constant, own, outside, rest: as for :func:`lowest`.
        scale: (1 + m,) the magnitude of f and of each face.
        needed: (1 + m,) control values have to be larger than z times this.
        place: of the least control value of f, which is not as large as needed.
        z: (1 + m,) gets z_0 = 1 and the multipliers, in single precision; or z_0 = 0, where the faces alone do.
        spot: (k + o + r,) gets the mean of the control points whose rows come to 0, when REFUTED: at it no face is negative, and f is not
            positive, as far as control points tell. The own coordinates are as they are, the others in [-1, 1].

    Returns:
        PROVED, REFUTED or UNDECIDED.
    """
    m, k, o, r = len(constant), den.shape[1], c.shape[0] - 1, rest.shape[1]
    D, T = 1 + m, np.empty(1 + k)
    points, G, w = np.zeros((2 * D + 2, D)), np.zeros((2 * D + 2, 2 * D + 2)), np.zeros(2 * D + 2)
    where, origin = np.zeros((2 * D + 2, k + o + r + 1)), np.zeros(2 * D + 2, np.int64)
    slopes, x, row = np.zeros(k + o), np.zeros(D), np.zeros(D)
    z[:] = 0.0
    z[0] = 1.0
    n = 0
    for step in range(STEPS):
        if step:
            least, place = lowest(z, c, den, constant, own, outside, rest, slopes)
            if least > _dot(z, needed):
                return PROVED
        _at(den, place, T)
        row[0] = c[0, place]
        for i in range(k):
            spot[i] = T[1 + i]
        for i in range(o):
            spot[k + i] = -1.0 if z[0] * c[1 + i, place] - slopes[k + i] * T[0] > 0 else 1.0
            row[0] += spot[k + i] * c[1 + i, place]
        for i in range(r):
            t = 0.0
            for j in range(m):
                t += z[1 + j] * rest[j, i]
            spot[k + o + i] = 1.0 if t > 0 else -1.0
        for j in range(m):
            t = constant[j] * T[0]
            for i in range(k):
                t += own[j, i] * T[1 + i]
            for i in range(o):
                t += spot[k + i] * outside[j, i] * T[0]
            for i in range(r):
                t += spot[k + o + i] * rest[j, i] * T[0]
            row[1 + j] = -t
        free = unused(origin, n)
        for i in range(k):
            where[free, i] = spot[i]
        for i in range(k, k + o + r):
            where[free, i] = spot[i] * T[0]
        where[free, k + o + r] = T[0]
        for j in range(D):
            points[free, j] = row[j] / scale[j]
        n = _joined(points, G, w, origin, n, free, -1)
        # Coordinates that came out negative get rows of their own, until none does.
        for _ in range(2 * D):
            for j in range(D):
                x[j] = 0.0
            for i in range(n):
                for j in range(D):
                    x[j] += w[i] * points[origin[i], j]
            size = 0.0
            for j in range(D):
                size = max(size, abs(x[j]))
            low, negative = -1e-9 * size, -1
            for j in range(D):
                if x[j] < low:
                    low, negative = x[j], j
            if negative < 0 or n > 2 * D:
                break
            free = unused(origin, n)
            for j in range(D):
                points[free, j] = 0.0
            points[free, negative] = 1.0
            for i in range(k + o + r + 1):
                where[free, i] = 0.0
            n = _joined(points, G, w, origin, n, free, negative)
        if _dot(x, x) < ZERO:
            total = 0.0
            spot[:] = 0.0
            for i in range(n):
                total += w[i] * where[origin[i], k + o + r]
                for a in range(k + o + r):
                    spot[a] += w[i] * where[origin[i], a]
            if total <= 0:
                return UNDECIDED
            spot /= total
            return REFUTED
        if n > 2 * D:
            return UNDECIDED
        for j in range(D):
            z[j] = max(x[j], 0.0) / scale[j]
        # The multipliers are stored in single precision.
        largest = z[1]
        for j in range(1, m):
            largest = max(largest, z[1 + j])
        positive = z[0] > SLIGHT * largest
        unit = z[0] if positive else largest
        z[0] = 1.0 if positive else 0.0
        for j in range(m):
            z[1 + j] = np.float32(z[1 + j] / unit)
    return UNDECIDED


@njit(cache=True)
def _dot(a: Array, b: Array) -> float:
    """Returns a scalar product; for few elements this is faster than BLAS, which needs Python's lock."""
    t = 0.0
    for j in range(len(a)):
        t += a[j] * b[j]
    return t


@njit(cache=True)
def _joined(points: Array, G: Array, w: Array, origin: Array, n: int, slot: int, axis: int) -> int:
    """Adds the point in a slot to the n points of a hull, moves their weights, and returns how many are left.

    Args:
        axis: the point is the unit vector of this coordinate, or -1.
    """
    if axis < 0:
        for i in range(n):
            t = 0.0
            for j in range(points.shape[1]):
                t += points[origin[i], j] * points[slot, j]
            G[i, n] = G[n, i] = t
        G[n, n] = points[slot] @ points[slot]
    else:
        for i in range(n):
            G[i, n] = G[n, i] = points[origin[i], axis]
        G[n, n] = 1.0
    origin[n] = slot
    w[n] = 1.0 if n == 0 else 0.0
    return weigh(G, w, origin, n + 1)


@njit(cache=True)
def _violated(gain: Array, chosen: Array, n: int, worst: Array) -> int:
    """Adds the faces that are violated most to the chosen ones, and returns how many these are then."""
    count = 0
    for j in range(len(gain)):
        if gain[j] > 0:
            count = _ranked(gain, worst, 0, count, j, MORE)
    for j in worst[:count]:
        if n < len(chosen) and not (chosen[:n] == j).any():
            chosen[n] = j
            n += 1
    return n


@njit(cache=True)
def _parts(chosen: Array, n: int, local: Array, own: Array, outside: Array, rest: Array) -> tuple[Array, Array, Array, Array]:
    """Returns the constants and slopes of the first n chosen faces, one row for each, of those that stand in columns."""
    constant, to_own, to_outside, to_rest = np.empty(n), np.empty((n, len(own))), np.empty((n, len(outside))), np.empty((n, len(rest)))
    for x in range(n):
        j = chosen[x]
        constant[x] = local[j]
        for i in range(len(own)):
            to_own[x, i] = own[i, j]
        for i in range(len(outside)):
            to_outside[x, i] = outside[i, j]
        for i in range(len(rest)):
            to_rest[x, i] = rest[i, j]
    return constant, to_own, to_outside, to_rest


@njit(cache=True)
def prove(
    c: Array,
    den: Array,
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
    stack: Array,
) -> int:
    """Proves that f > 0 wherever all g_j >= 0, on a box that is halved where one set of multipliers is not enough.

    Every piece gets multipliers with z_0 f - sum_j z_j g_j > 0 at its control points, or z_0 = 0 where the piece misses the polytope.

    Where a joint turns by more than 180 degrees, the denominator has negative control values, and what is proved there with a face need not
    be when the face is moved in. Such a piece is halved in this joint, unless f alone will do.

    Args:
        c, den: as for :func:`lowest`.
        ends: as for :func:`evaluate`.
        constant, own, outside, rest: (m,), (k, m), (o, m), (r, m) of the faces, in the coordinates of the cell.
        precision: control values must be larger than this multiple of the magnitude of what they are made of.
        most: give up after this many pieces.
        codes, counts, faces, values: streams of the proof (certifier.proof.partition), written from ``lengths`` on.
        lengths: (3,) of codes, counts and faces; they are advanced.
        point: (k + o + r,) gets a point of the polytope where f < 0, when REFUTED: own coordinates as they are, the others in [-1, 1].
        halvings: (k + o,) counts how often each coordinate was halved.
        stack: (DEPTH, 1 + o, N) is overwritten.

    Returns:
        PROVED, REFUTED or UNDECIDED.
    """
    N, m, k, o, r = c.shape[1], len(constant), den.shape[1], c.shape[0] - 1, rest.shape[0]
    D = 1 + m
    stack_den, stack_z = np.empty((DEPTH, 2, k, 4)), np.empty((DEPTH, D))
    center, half = np.zeros((DEPTH, o)), np.ones((DEPTH, o))
    stack[0], stack_den[0], stack_z[0, :], stack_z[0, 0] = c, den, 0.0, 1.0
    slopes, local, g_out, f = np.zeros(k + o), np.zeros(m), np.zeros((o, m)), np.empty(N)
    scale, whole, least, some, enough, few = np.zeros(D), np.zeros(D), np.zeros(D), np.zeros(D), np.zeros(D), np.zeros(D)
    gain, chosen, held, worst, reach = np.zeros(m), np.zeros(m, np.int64), np.zeros(m, np.int64), np.zeros(MORE, np.int64), np.zeros(k)
    z, spot = np.zeros(D), np.zeros(k + o + r)
    level, done = np.zeros(DEPTH, np.int64), 0.0
    top, count = 1, 0
    while top:
        n = 0
        top -= 1
        count += 1
        cc, now = stack[top], stack_den[top]
        low, high = _range(cc[0])
        size, weight = max(high, -low), 1.0
        wide = -1
        for i in range(k):
            largest, reach[i] = 0.0, 0.0
            for x in range(4):
                if now[0, i, x] < 0:
                    wide = i
                largest = max(largest, abs(now[0, i, x]))
                reach[i] = max(reach[i], abs(now[1, i, x]))
            weight *= largest
            reach[i] /= largest
        local[:] = constant
        for i in range(o):
            for j in range(m):
                local[j] += outside[i, j] * center[top, i]
                g_out[i, j] = outside[i, j] * half[top, i]
        scale[0] = size
        bound = scale[1:]
        bound[:] = np.abs(local)
        for i in range(k):
            for j in range(m):
                bound[j] += abs(own[i, j]) * reach[i]
        for i in range(o):
            for j in range(m):
                bound[j] += abs(g_out[i, j])
        for i in range(r):
            for j in range(m):
                bound[j] += abs(rest[i, j])
        bound *= weight
        z[:] = stack_z[top]
        if wide >= 0:
            z[1:] = 0.0
        if count == 1:
            whole[:] = scale
        # The verifier's bound of rounding errors is about the whole cell.
        least[:] = precision * np.maximum(scale, WHOLE * whole)
        least_of_f = _alone(cc, f)
        n = 0
        for j in range(m):
            if z[1 + j] != 0.0:
                held[n] = j
                n += 1
        found = False
        if n:
            some[0] = z[0]
            for x in range(n):
                some[1 + x] = z[1 + held[x]]
            parts = _parts(held, n, local, own, g_out, rest)
            found = lowest(some[: 1 + n], cc, now, *parts, slopes)[0] > _dot(z, least)
        if not found:
            z[:] = 0.0
            z[0] = 1.0
            found = least_of_f > least[0]
        n = 0
        if not found and m and wide < 0:
            n = choose(f, cc, now, local, own, g_out, scale, stack_z[top], 0.5 * least_of_f, chosen)
            place = _first(f, least_of_f)
            for _ in range(ATTEMPTS):
                some[0], enough[0] = scale[0], least[0]
                for x in range(n):
                    some[1 + x], enough[1 + x] = scale[1 + chosen[x]], least[1 + chosen[x]]
                parts = _parts(chosen, n, local, own, g_out, rest)
                kind = multipliers(cc, now, *parts, some[: 1 + n], enough[: 1 + n], place, few[: 1 + n], spot)
                if kind == PROVED:
                    z[:] = 0.0
                    z[0] = few[0]
                    z[1 + chosen[:n]] = few[1 : 1 + n]
                    found = True
                if kind != REFUTED:
                    break
                # The spot is a mean of control points, which may lie outside of the piece.
                within = np.abs(spot[k:]).max() <= 1 if o + r else True
                for i in range(k):
                    within = within and ends[0, i] <= spot[i] <= ends[1, i]
                if not within:
                    break
                for i in range(o):
                    spot[k + i] = center[top, i] + half[top, i] * spot[k + i]
                gain[:] = constant
                for i in range(k):
                    for j in range(m):
                        gain[j] += own[i, j] * spot[i]
                for i in range(o):
                    for j in range(m):
                        gain[j] += outside[i, j] * spot[k + i]
                for i in range(r):
                    for j in range(m):
                        gain[j] += rest[i, j] * spot[k + o + i]
                inside = True
                for j in range(m):
                    gain[j] = -(gain[j] * weight / bound[j] + OUTSIDE)
                    inside = inside and gain[j] <= 0
                if inside:
                    if evaluate(c, spot, ends) < 0:
                        point[:] = spot
                        return REFUTED
                    break
                before = n
                n = _violated(gain, chosen, n, worst)
                if n == before:
                    break
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
            done += 0.5 ** level[top]
            continue
        if count >= EARLY and count > HOPELESS * done * most:
            return UNDECIDED
        if count >= most or top + 2 > DEPTH or level[top] == PIECE_DEPTH or lengths[0] >= len(codes):
            return UNDECIDED
        axis = wide if wide >= 0 else steepest(cc, k)
        halvings[axis] += 1
        codes[lengths[0]] = axis
        lengths[0] += 1
        stack_z[top, 0] = 1.0
        if n and few[0] > SLIGHT * few[: 1 + n].max():
            for j in range(n):
                stack_z[top, 1 + chosen[j]] = np.float32(few[1 + j] / few[0])
        stack_z[top + 1] = stack_z[top]
        center[top + 1], half[top + 1] = center[top], half[top]
        level[top] += 1
        level[top + 1] = level[top]
        stack_den[top + 1] = now
        if axis < k:
            halve(cc, axis, k, stack[top + 1])
            upper, lower = now[:, axis].copy(), np.empty((2, 4))
            halve(upper, 0, 1, lower)
            stack_den[top + 1, :, axis], now[:, axis] = lower, upper
        else:
            i = axis - k
            stack[top + 1] = cc
            for a in range(N):
                t = 0.5 * cc[1 + i, a]
                stack[top + 1, 0, a] = cc[0, a] - t
                stack[top, 0, a] = cc[0, a] + t
                stack[top, 1 + i, a] = stack[top + 1, 1 + i, a] = t
            half[top, i] *= 0.5
            half[top + 1, i] = half[top, i]
            center[top + 1, i] = center[top, i] - half[top, i]
            center[top, i] += half[top, i]
        top += 2
    return PROVED
