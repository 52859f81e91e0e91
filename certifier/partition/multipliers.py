"""Multipliers are found here that prove a polynomial in Bernstein form positive on one piece of a polytope.

Wanted is z >= 0 with z_0 f - sum_j z_j g_j > 0 at all control points of the piece, where g_j >= 0 are the faces. The control values are
linear in z, so each control point gives a row, and a z that is positive on all rows exists exactly where 0 is not in the hull of the rows.
Wolfe's algorithm (certifier.partition.wolfe) finds the point x of the hull of some rows that is nearest to 0. This x is positive on those
rows, so it is the next z; the row on which it is lowest comes next. Where a coordinate of x is negative, a unit vector joins the rows,
which keeps z >= 0. Where x is 0, the weights of the rows name a point at which no face is negative and f is not positive.

Nothing here is trusted: the verifier checks what is found.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.partition.bernstein import at, lowest
from certifier.partition.wolfe import unused, weigh
from certifier.polytopes.simplex import dot

PROVED, REFUTED, UNDECIDED = 1, 0, -1
FACES, MORE = 10, 4
"""A piece is tried with at most FACES faces at first. In each further attempt, up to MORE join them that the last answer violates."""
LOWEST = 32
"""This many of the lowest control points say which faces may help."""
STEPS, ZERO = 40, 1e-10
"""Multipliers are given up after STEPS control points, or where the square of the distance of their rows' hull from 0 is below ZERO."""
SLIGHT = 1e-6
"""f counts for nothing where its multiplier is less than this part of the largest one."""
BITS = 14
"""Multipliers are rounded to this many bits, so that a file deflates them better; with fewer, fewer pieces are proved (docs/trials.md)."""
_SPLIT = 2.0 ** (53 - BITS) + 1.0


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
        at(den, a, T)
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
        spot: (k + o + r,) when REFUTED, gets the weighted mean of the control points whose rows cancel: at it no face is negative, and f is
            not positive, as far as control points tell. The own coordinates are as they are, the others in [-1, 1].

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
            if least > dot(z, needed):
                return PROVED
        at(den, place, T)
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
        if dot(x, x) < ZERO:
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
        largest = z[1]
        for j in range(1, m):
            largest = max(largest, z[1 + j])
        positive = z[0] > SLIGHT * largest
        unit = z[0] if positive else largest
        z[0] = 1.0 if positive else 0.0
        for j in range(m):
            z[1 + j] = rounded(z[1 + j] / unit)
    return UNDECIDED


@njit(cache=True)
def rounded(x: float) -> np.float32:
    """Returns a multiplier as a proof stores it: in single precision, with BITS bits (T. J. Dekker, 1971)."""
    t = _SPLIT * x
    return np.float32(t - (t - x))


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
def violated(gain: Array, chosen: Array, n: int, worst: Array) -> int:
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
