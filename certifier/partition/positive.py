"""Polynomials in Bernstein form are proved positive on a polytope, one box of it after the other (certifier.partition.bernstein).

Everything uses one thread. Nothing here is trusted: the verifier checks what is found.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.partition.bernstein import alone, at, evaluate, extremes, halve, lowest, steepest
from certifier.partition.wolfe import unused, weigh
from certifier.polytopes.simplex import dot
from certifier.proof.limits import PIECE_DEPTH

PROVED, REFUTED, UNDECIDED = 1, 0, -1
FACES, MORE, ATTEMPTS = 10, 4, 4
"""A piece is tried with FACES faces, then with MORE of those that its last answer violated, in so many attempts."""
LOWEST = 32
"""So many of the lowest control points say which faces these are."""
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
        low, high = extremes(cc[0])
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
        least_of_f = alone(cc, f)
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
            found = lowest(some[: 1 + n], cc, now, *parts, slopes)[0] > dot(z, least)
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
