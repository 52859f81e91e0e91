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
def _cross(a: Array, b: Array, out: Array) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _on_segment(a: Array, b: Array, z: Array) -> int:
    """Fills in the point z of a segment that is nearest to 0, and returns which ends it needs: bit 0 for a, bit 1 for b."""
    edge = b - a
    along, length = -_dot(a, edge), _dot(edge, edge)
    if along <= 0.0 or length == 0.0:
        z[:] = a
        return 1
    if along >= length:
        z[:] = b
        return 2
    z[:] = a + (along / length) * edge
    return 3


@njit(cache=True)
def _on_triangle(a: Array, b: Array, c: Array, z: Array) -> int:
    """Fills in the point z of a triangle that is nearest to 0, and returns which corners it needs, by bits."""
    ab, ac, normal = b - a, c - a, np.empty(3)
    _cross(ab, ac, normal)
    square = _dot(normal, normal)
    d1, d2, d3, d4, d5, d6 = -_dot(ab, a), -_dot(ac, a), -_dot(ab, b), -_dot(ac, b), -_dot(ab, c), -_dot(ac, c)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if va > 0.0 and vb > 0.0 and vc > 0.0 and square > 0.0:
        # The foot of the plane's normal has the plane's direction to the last digit, however near 0 it is.
        z[:] = (_dot(normal, a) / square) * normal
        return 7
    other = np.empty(3)
    used = _on_segment(a, b, z)
    best = _dot(z, z)
    bits = _on_segment(a, c, other)
    if _dot(other, other) < best:
        best, z[:], used = _dot(other, other), other, (bits & 1) | ((bits & 2) << 1)
    bits = _on_segment(b, c, other)
    if _dot(other, other) < best:
        z[:], used = other, bits << 1
    return used


@njit(cache=True)
def _on_tetrahedron(P: Array, every: bool, z: Array) -> int:
    """Fills in the point z of a tetrahedron, (4, 3), that is nearest to 0, and returns which corners it needs; 15 where 0 is inside.

    Args:
        every: look for it on every face, also on those on whose inner side 0 is.
    """
    used, best, normal, other = 15, np.inf, np.empty(3), np.empty(3)
    for missing in range(4):
        i, j, k = (missing + 1) % 4, (missing + 2) % 4, (missing + 3) % 4
        _cross(P[j] - P[i], P[k] - P[i], normal)
        if not every and _dot(normal, P[missing] - P[i]) * -_dot(normal, P[i]) > 0.0:
            continue  # 0 is on the inner side of this face
        bits = _on_triangle(P[i], P[j], P[k], other)
        square = _dot(other, other)
        if square < best:
            best, z[:] = square, other
            used = ((bits & 1) << i) | (((bits >> 1) & 1) << j) | (((bits >> 2) & 1) << k)
    return used


@njit(cache=True)
def separation(A: Array, B: Array, normal: Array) -> float:
    """Returns how far the hulls of A (V, 3) and B (W, 3) are apart along the direction that is filled in, which is the best one found.

    Args:
        normal: (3,) gets a unit vector n from B to A; what is returned is min over A of n'v - max over B of n'w. It is 0 or negative, and
            the vector is of no use, where the hulls meet.
    """
    P, z, m, best = np.empty((4, 3)), A[0] - B[0], 0, -np.inf
    for _ in range(STEPS):
        length = np.sqrt(_dot(z, z))
        if length < 1e-300:
            return min(best, 0.0)
        low, high, a, b = np.inf, -np.inf, 0, 0
        for v in range(len(A)):
            t = _dot(z, A[v])
            if t < low:
                low, a = t, v
        for v in range(len(B)):
            t = _dot(z, B[v])
            if t > high:
                high, b = t, v
        if (low - high) / length > best:
            best, normal[:] = (low - high) / length, z / length
        if best >= length * (1.0 - CONVERGED):
            return best
        row = A[a] - B[b]
        for i in range(m):
            if P[i, 0] == row[0] and P[i, 1] == row[1] and P[i, 2] == row[2]:
                return best  # rounding lets it go no further
        P[m] = row
        m += 1
        if m == 1:
            z[:] = P[0]
            used = 1
        elif m == 2:
            used = _on_segment(P[0], P[1], z)
        elif m == 3:
            used = _on_triangle(P[0], P[1], P[2], z)
        else:
            used = _on_tetrahedron(P, False, z)
            if used == 15:
                # Of a flat tetrahedron, rounding says on which side 0 is. A plane that separates the hulls knows better.
                if best <= _ROUNDED * (np.sqrt(_dot(A[a], A[a])) + np.sqrt(_dot(B[b], B[b]))):
                    return min(best, 0.0)
                used = _on_tetrahedron(P, True, z)
        kept = 0
        for i in range(m):
            if (used >> i) & 1:
                P[kept] = P[i]
                kept += 1
        m = kept
    return best
