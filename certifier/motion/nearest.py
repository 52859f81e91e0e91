"""The distance of two convex hulls, to the last digits: a motion may pass by an obstacle at a micrometre.

E. G. Gilbert, D. W. Johnson and S. S. Keerthi, A fast procedure for computing the distance between complex objects in three-dimensional
space, IEEE Journal on Robotics and Automation 4 (1988). The nearest point of a triangle is found as by C. Ericson, Real-Time Collision
Detection (2004), section 5.1.5.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array

STEPS = 100
CONVERGED = 1e-10
"""A distance is known when it may be larger by this part of itself at most."""
_ROUNDED = 1e-14
"""A plane separates without doubt where it does by more than this part of how far the points are from 0."""


@njit(cache=True)
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _on_segment(a: Array, b: Array, z: Array) -> int:
    """Fills in the point z of a segment that is nearest to 0, and returns which ends it needs: bit 0 for a, bit 1 for b."""
    x, y, w = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    along, length = -(a[0] * x + a[1] * y + a[2] * w), x * x + y * y + w * w
    if along <= 0.0 or length == 0.0:
        z[0], z[1], z[2] = a[0], a[1], a[2]
        return 1
    if along >= length:
        z[0], z[1], z[2] = b[0], b[1], b[2]
        return 2
    part = along / length
    z[0], z[1], z[2] = a[0] + part * x, a[1] + part * y, a[2] + part * w
    return 3


@njit(cache=True)
def _on_triangle(a: Array, b: Array, c: Array, z: Array, work: Array) -> int:
    """Fills in the point z of a triangle that is nearest to 0, and returns which corners it needs, by bits.

    Args:
        work: (3,) is overwritten.
    """
    x, y, w = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    u, v, r = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    n0, n1, n2 = y * r - w * v, w * u - x * r, x * v - y * u
    square = n0 * n0 + n1 * n1 + n2 * n2
    d1, d2 = -(x * a[0] + y * a[1] + w * a[2]), -(u * a[0] + v * a[1] + r * a[2])
    d3, d4 = -(x * b[0] + y * b[1] + w * b[2]), -(u * b[0] + v * b[1] + r * b[2])
    d5, d6 = -(x * c[0] + y * c[1] + w * c[2]), -(u * c[0] + v * c[1] + r * c[2])
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if va > 0.0 and vb > 0.0 and vc > 0.0 and square > 0.0:
        # The foot of the plane's normal has the plane's direction to the last digit, however near 0 it is.
        part = (n0 * a[0] + n1 * a[1] + n2 * a[2]) / square
        z[0], z[1], z[2] = part * n0, part * n1, part * n2
        return 7
    used = _on_segment(a, b, z)
    best = _dot(z, z)
    bits = _on_segment(a, c, work)
    if _dot(work, work) < best:
        best, used = _dot(work, work), (bits & 1) | ((bits & 2) << 1)
        z[0], z[1], z[2] = work[0], work[1], work[2]
    bits = _on_segment(b, c, work)
    if _dot(work, work) < best:
        used = bits << 1
        z[0], z[1], z[2] = work[0], work[1], work[2]
    return used


@njit(cache=True)
def _on_tetrahedron(P: Array, every: bool, z: Array, work: Array) -> int:
    """Fills in the point z of a tetrahedron, (4, 3), that is nearest to 0, and returns which corners it needs; 15 where 0 is inside.

    Args:
        every: look for it on every face, also on those on whose inner side 0 is.
        work: (2, 3) is overwritten.
    """
    used, best, other = 15, np.inf, work[1]
    for missing in range(4):
        a, b, c, d = P[(missing + 1) % 4], P[(missing + 2) % 4], P[(missing + 3) % 4], P[missing]
        x, y, w = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        u, v, r = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        n0, n1, n2 = y * r - w * v, w * u - x * r, x * v - y * u
        inner = n0 * (d[0] - a[0]) + n1 * (d[1] - a[1]) + n2 * (d[2] - a[2])
        if not every and inner * -(n0 * a[0] + n1 * a[1] + n2 * a[2]) > 0.0:
            continue  # 0 is on the inner side of this face
        bits = _on_triangle(a, b, c, other, work[0])
        square = _dot(other, other)
        if square < best:
            best = square
            z[0], z[1], z[2] = other[0], other[1], other[2]
            i, j, k = (missing + 1) % 4, (missing + 2) % 4, (missing + 3) % 4
            used = ((bits & 1) << i) | (((bits >> 1) & 1) << j) | (((bits >> 2) & 1) << k)
    return used


@njit(cache=True)
def separation(A: Array, B: Array, normal: Array) -> float:
    """Returns how far the hulls of A (V, 3) and B (W, 3) are apart along the direction that is filled in, which is the best one found.

    Args:
        normal: (3,) gets a unit vector n from B to A; what is returned is min over A of n'v - max over B of n'w. It is 0 or negative, and
            the vector is of no use, where the hulls meet.
    """
    for i in range(3):
        normal[i] = A[0, i] - B[0, i]
    return _separation(A, B, normal, -1.0, np.inf)


@njit(cache=True)
def farther(A: Array, B: Array, reach: float, normal: Array) -> bool:
    """Says whether the hulls of A (V, 3) and B (W, 3) are more than ``reach`` metres apart.

    Args:
        normal: (3,) the direction to try first, from B to A, or 0; it gets the best one found. One that was enough when the hulls were
            elsewhere often is again.
    """
    if normal[0] == 0.0 and normal[1] == 0.0 and normal[2] == 0.0:
        for i in range(3):
            normal[i] = A[0, i] - B[0, i]
    return _separation(A, B, normal, reach, reach) > reach


@njit(cache=True)
def _separation(A: Array, B: Array, normal: Array, least: float, most: float) -> float:
    """Does what :func:`separation` does, until it knows that the hulls are at most ``least`` or more than ``most`` apart.

    Args:
        normal: (3,) the first direction, not 0, of any length; it gets the best one.
    """
    room = np.empty((7, 3))
    P, z, work = room[:4], room[4], room[5:]
    z[0], z[1], z[2] = normal[0], normal[1], normal[2]
    m, best = 0, -np.inf
    for _ in range(STEPS):
        length = np.sqrt(_dot(z, z))
        if length < 1e-300:
            return min(best, 0.0)
        low, high, a, b = np.inf, -np.inf, 0, 0
        for v in range(len(A)):
            t = z[0] * A[v, 0] + z[1] * A[v, 1] + z[2] * A[v, 2]
            if t < low:
                low, a = t, v
        for v in range(len(B)):
            t = z[0] * B[v, 0] + z[1] * B[v, 1] + z[2] * B[v, 2]
            if t > high:
                high, b = t, v
        if (low - high) / length > best:
            best = (low - high) / length
            normal[0], normal[1], normal[2] = z[0] / length, z[1] / length, z[2] / length
        # The first direction may be no difference of two points, so its length says nothing.
        if best > most or (m > 0 and (best >= length * (1.0 - CONVERGED) or length <= least)):
            return best
        x, y, w = A[a, 0] - B[b, 0], A[a, 1] - B[b, 1], A[a, 2] - B[b, 2]
        for i in range(m):
            if P[i, 0] == x and P[i, 1] == y and P[i, 2] == w:
                return best  # rounding lets it go no further
        P[m, 0], P[m, 1], P[m, 2] = x, y, w
        m += 1
        if m == 1:
            z[0], z[1], z[2] = x, y, w
            used = 1
        elif m == 2:
            used = _on_segment(P[0], P[1], z)
        elif m == 3:
            used = _on_triangle(P[0], P[1], P[2], z, work[0])
        else:
            used = _on_tetrahedron(P, False, z, work)
            if used == 15:
                # Of a flat tetrahedron, rounding says on which side 0 is. A plane that separates the hulls knows better.
                if best <= _ROUNDED * (np.sqrt(_dot(A[a], A[a])) + np.sqrt(_dot(B[b], B[b]))):
                    return min(best, 0.0)
                used = _on_tetrahedron(P, True, z, work)
        kept = 0
        for i in range(m):
            if (used >> i) & 1:
                P[kept, 0], P[kept, 1], P[kept, 2] = P[i, 0], P[i, 1], P[i, 2]
                kept += 1
        m = kept
    return best
