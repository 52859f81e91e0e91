"""Polynomials in Bernstein form are proved positive on a polytope, one box of it after the other.

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

PROVED, REFUTED, UNDECIDED = 1, 0, -1
FACES, MORE, ATTEMPTS = 10, 4, 4
"""A piece is tried with FACES faces, then with MORE of those that its last answer violated, in so many attempts."""
LOWEST = 32
"""So many of the lowest control points say which faces these are."""
BLOCK = 2
"""Control values are computed in blocks over so many coordinates, which fill the registers."""
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
    N, k, o, V = len(X), len(own), len(outside), len(vertices)
    first, last = ends[2].copy(), ends[3].copy()
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
    return c


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
        for b in range(n - 1, -1, -1):
            p, q = product[b], linear[b]
            for x in range(4):
                product[4 * b + x] = p * den[0, i, x]
                linear[4 * b + x] = q * den[0, i, x] + p * (slopes[i] * den[1, i, x])
        n *= 4
    return product, linear


@njit(cache=True, fastmath=True)
def _block(
    z0: float, c: Array, begin: int, p: float, q: float, product: Array, linear: Array, slopes: Array, k: int, values: Array
) -> float:
    """Fills in the control values of one block, over the last own coordinates, and returns the least of them."""
    n = len(values)
    for y in range(n):
        values[y] = z0 * c[0, begin + y] - (q * product[y] + p * linear[y])
    for i in range(c.shape[0] - 1):
        slope = slopes[k + i] * p
        for y in range(n):
            values[y] -= abs(z0 * c[1 + i, begin + y] - slope * product[y])
    least = np.inf
    for y in range(n):
        least = min(least, values[y])
    return float(least)


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
    N, m, k, o = c.shape[1], len(constant), den.shape[1], c.shape[0] - 1
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
    if not np.isfinite(z[0] + base + np.abs(slopes).sum()):
        return -np.inf, 0
    first = max(k - BLOCK, 0)
    products, linears = _expanded(den, slopes, 0, first, base)
    product, linear = _expanded(den, slopes, first, k, 0.0)
    n = len(product)
    values = np.empty(n)
    least, block = np.inf, 0
    for b in range(N // n):
        t = _block(z[0], c, b * n, products[b], linears[b], product, linear, slopes, k, values)
        if t < least:
            least, block = t, b
    _block(z[0], c, block * n, products[block], linears[block], product, linear, slopes, k, values)
    return least, block * n + int(values.argmin())


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


@njit(cache=True)
def choose(c: Array, den: Array, constant: Array, own: Array, outside: Array, rest: Array, scale: Array, z: Array, chosen: Array) -> int:
    """Fills in the faces that may help most, those with multipliers in z first, and returns how many there are, which is 1 at least.

    A face helps where f is negative, if it is negative there as well.

    Args:
        c, den, constant, own, outside, rest: as for :func:`lowest`.
        scale: (1 + m,) the magnitude of f and of each face.
        chosen: gets their numbers.
    """
    N, m, k, o = c.shape[1], len(constant), den.shape[1], c.shape[0] - 1
    values = c[0].copy()
    for i in range(o):
        values -= np.abs(c[1 + i])
    bad, T = np.zeros(LOWEST, np.int64), np.empty((LOWEST, 1 + k))
    count, limit = 0, 0.5 * values.min()
    for a in range(N):
        if values[a] <= limit and count < LOWEST:
            bad[count] = a
            _at(den, a, T[count])
            count += 1
    gain, used = np.zeros(m), np.zeros(m, np.bool_)
    for j in range(m):
        for i in range(count):
            t = constant[j]
            for e in range(o):
                t += -outside[j, e] if c[1 + e, bad[i]] > 0 else outside[j, e]
            t *= T[i, 0]
            for e in range(k):
                t += own[j, e] * T[i, 1 + e]
            gain[j] -= min(t, 0.0)
        gain[j] /= scale[1 + j]
    n = 0
    for j in range(m):
        if z[1 + j] > 0 and n < FACES:
            chosen[n] = j
            used[j] = True
            n += 1
    for j in np.argsort(-gain):
        if n < FACES and gain[j] > 0 and not used[j]:
            chosen[n] = j
            n += 1
    return max(n, 1)


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
    z: Array,
    spot: Array,
) -> int:
    """Looks for z >= 0 with z_0 f - sum_j z_j g_j > 0 at all control points, by Wolfe's algorithm over their rows.

    Args:
        c, den, constant, own, outside, rest: as for :func:`lowest`.
        scale: (1 + m,) the magnitude of f and of each face.
        needed: (1 + m,) control values have to be larger than z times this.
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
    for _ in range(STEPS):
        least, place = lowest(z, c, den, constant, own, outside, rest, slopes)
        if least > (z * needed).sum():
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
        for i in range(o + r):
            spot[k + i] *= T[0]
        for j in range(D):
            row[j] /= scale[j]
        free = unused(origin, n)
        points[free] = row
        where[free, : k + o + r] = spot
        where[free, k + o + r] = T[0]
        n = _joined(points, G, w, origin, n, free)
        # Coordinates that came out negative get rows of their own, until none does.
        for _ in range(2 * D):
            x[:] = 0.0
            for i in range(n):
                for j in range(D):
                    x[j] += w[i] * points[origin[i], j]
            low, negative = -1e-9 * np.abs(x).max(), -1
            for j in range(D):
                if x[j] < low:
                    low, negative = x[j], j
            if negative < 0 or n > 2 * D:
                break
            free = unused(origin, n)
            points[free] = 0.0
            points[free, negative] = 1.0
            where[free] = 0.0
            n = _joined(points, G, w, origin, n, free)
        if x @ x < ZERO:
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
        largest = z[1:].max()
        positive = z[0] > SLIGHT * largest
        unit = z[0] if positive else largest
        z[0] = 1.0 if positive else 0.0
        for j in range(m):
            z[1 + j] = np.float32(z[1 + j] / unit)
    return UNDECIDED


@njit(cache=True)
def _joined(points: Array, G: Array, w: Array, origin: Array, n: int, slot: int) -> int:
    """Adds the point in a slot to the n points of a hull, moves their weights, and returns how many are left."""
    D = points.shape[1]
    for i in range(n):
        t = 0.0
        for j in range(D):
            t += points[origin[i], j] * points[slot, j]
        G[i, n] = G[n, i] = t
    G[n, n] = points[slot] @ points[slot]
    origin[n] = slot
    w[n] = 1.0 if n == 0 else 0.0
    return weigh(G, w, origin, n + 1)


@njit(cache=True)
def _violated(values: Array, chosen: Array, n: int) -> int:
    """Adds the faces that are violated most to the chosen ones, and returns how many these are then."""
    for j in np.argsort(values)[:MORE]:
        if values[j] < 0 and n < len(chosen) and not (chosen[:n] == j).any():
            chosen[n] = j
            n += 1
    return n


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
        c, den, constant, own, outside, rest: as for :func:`lowest`.
        ends: as for :func:`evaluate`.
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
    N, m, k, o, r = c.shape[1], len(constant), den.shape[1], c.shape[0] - 1, rest.shape[1]
    D = 1 + m
    stack_den, stack_z = np.empty((DEPTH, 2, k, 4)), np.empty((DEPTH, D))
    center, half = np.zeros((DEPTH, o)), np.ones((DEPTH, o))
    stack[0], stack_den[0], stack_z[0, :], stack_z[0, 0] = c, den, 0.0, 1.0
    slopes, local, g_out = np.zeros(k + o), np.zeros(m), np.zeros((m, o))
    scale, whole, least, some, enough, few = np.zeros(D), np.zeros(D), np.zeros(D), np.zeros(D), np.zeros(D), np.zeros(D)
    values_at, chosen, reach = np.zeros(m), np.zeros(m, np.int64), np.zeros(k)
    z, spot = np.zeros(D), np.zeros(k + o + r)
    level, done = np.zeros(DEPTH, np.int64), 0.0
    top, count = 1, 0
    while top:
        n = 0
        top -= 1
        count += 1
        cc, now = stack[top], stack_den[top]
        size, weight = max(cc[0].max(), -cc[0].min()), 1.0
        wide = -1
        for i in range(k):
            if now[0, i].min() < 0:
                wide = i
            largest = np.abs(now[0, i]).max()
            weight *= largest
            reach[i] = np.abs(now[1, i]).max() / largest
        for j in range(m):
            local[j] = constant[j]
            for i in range(o):
                local[j] += outside[j, i] * center[top, i]
                g_out[j, i] = outside[j, i] * half[top, i]
        scale[0] = size
        for j in range(m):
            t = abs(local[j])
            for i in range(k):
                t += abs(own[j, i]) * reach[i]
            for i in range(o):
                t += abs(g_out[j, i])
            for i in range(r):
                t += abs(rest[j, i])
            scale[1 + j] = t * weight
        z[:] = stack_z[top]
        if wide >= 0:
            z[1:] = 0.0
        if count == 1:
            whole[:] = scale
        # The verifier's bound of rounding errors is about the whole cell.
        least[:] = precision * np.maximum(scale, WHOLE * whole)
        found = lowest(z, cc, now, local, own, g_out, rest, slopes)[0] > (z * least).sum()
        if not found and z[1:].any():
            z[:] = 0.0
            z[0] = 1.0
            found = lowest(z, cc, now, local, own, g_out, rest, slopes)[0] > least[0]
        if not found and m and wide < 0:
            n = choose(cc, now, local, own, g_out, rest, scale, stack_z[top], chosen)
            for _ in range(ATTEMPTS):
                some[0], some[1 : 1 + n] = scale[0], scale[1 + chosen[:n]]
                enough[0], enough[1 : 1 + n] = least[0], least[1 + chosen[:n]]
                parts = (local[chosen[:n]], own[chosen[:n]], g_out[chosen[:n]], rest[chosen[:n]])
                kind = multipliers(cc, now, *parts, some[: 1 + n], enough[: 1 + n], few[: 1 + n], spot)
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
                for j in range(m):
                    t = constant[j]
                    for i in range(k):
                        t += own[j, i] * spot[i]
                    for i in range(o):
                        t += outside[j, i] * spot[k + i]
                    for i in range(r):
                        t += rest[j, i] * spot[k + o + i]
                    values_at[j] = min(t * weight / scale[1 + j] + OUTSIDE, 0.0)
                if values_at.min() >= 0:
                    if evaluate(c, spot, ends) < 0:
                        point[:] = spot
                        return REFUTED
                    break
                before = n
                n = _violated(values_at, chosen, n)
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
        if count >= most or top + 2 > DEPTH or lengths[0] >= len(codes):
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
            halve(cc, axis, k, stack[top + 1], cc)
            halve(now[:, axis], 0, 1, stack_den[top + 1, :, axis], now[:, axis])
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
