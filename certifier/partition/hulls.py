"""Where two bodies are at a configuration, how far apart, and where they are nearest: compiled loops.

Nothing here is trusted: contacts are checked with exact fractions, and planes are proved.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.kinematics import Kinematics
from certifier.model import Array, Volume
from certifier.partition.chords import INSIDE
from certifier.partition.wolfe import unused, weigh
from certifier.polytopes.simplex import WORK, corner

APART = 1e-4
"""A gap is known when it may be larger by this part of itself at most."""
TOUCHING = 1e-10
"""Points nearer than the root of this, relative to the space, are taken to touch."""
DIFFERENCE = 1e-5
"""Slopes are differences over this part of the cell."""
SHORTEST, SLOWEST = 8, 1e-3
"""A step goes the whole way, or a half of it, and so on, SHORTEST ways; the last one is better by less than SLOWEST."""


class Hull(NamedTuple):
    """One body, in the space of a search: the frame of the plane, moved and scaled so that all vertices are in [-1, 1].

    Attributes:
        terms: (F, 3, 4, 4) of the factors of its pose (certifier.kinematics.Factor); the first one is the scaling.
        joints: (F,) their position indices; -1 for a factor that does not move.
        vertices: (V, 3) metres, in the body's own frame.
        radius: in the space of the search.
    """

    terms: Array
    joints: Array
    vertices: Array
    radius: float


def hull(kinematics: Kinematics, frame: str, volume: Volume, radius: float, middle: Array, extent: float) -> Hull:
    """Returns a volume as a body in the space of a search, whose 0 is at ``middle`` in the frame, and whose unit is ``extent`` metres.

    Args:
        radius: metres, padding included.
    """
    scaling = np.eye(4)
    scaling[:3, :3] /= extent
    scaling[:3, 3] = -middle / extent
    still = np.array([scaling, np.zeros((4, 4)), np.zeros((4, 4))])
    path = kinematics.path(frame, volume.body)
    terms = np.array([still, *(factor.terms for factor in path)])
    joints = np.array([-1, *(-1 if factor.index is None else factor.index for factor in path)], dtype=np.int64)
    return Hull(terms, joints, np.ascontiguousarray(volume.vertices), radius / extent)


@njit(cache=True)
def pose(hull: Hull, s: Array, X: Array, Y: Array) -> None:
    """Fills in the pose X (4, 4) times its denominator, which is its last entry; Y (4, 4) is overwritten."""
    X[:] = hull.terms[0, 0]
    for f in range(1, len(hull.joints)):
        j = hull.joints[f]
        for a in range(4):
            for b in range(4):
                t = hull.terms[f, 0, a, b]
                if j >= 0:
                    t += s[j] * (hull.terms[f, 1, a, b] + s[j] * hull.terms[f, 2, a, b])
                Y[a, b] = t
        for a in range(4):
            x0, x1, x2, x3 = X[a, 0], X[a, 1], X[a, 2], X[a, 3]
            for b in range(4):
                X[a, b] = x0 * Y[0, b] + x1 * Y[1, b] + x2 * Y[2, b] + x3 * Y[3, b]


@njit(cache=True)
def place(hull: Hull, s: Array, X: Array, Y: Array, points: Array) -> None:
    """Fills in where the vertices are at one configuration, (V, 3); X and Y, (4, 4), are overwritten."""
    pose(hull, s, X, Y)
    for v in range(len(hull.vertices)):
        p = hull.vertices[v]
        for c in range(3):
            points[v, c] = (X[c, 0] * p[0] + X[c, 1] * p[1] + X[c, 2] * p[2] + X[c, 3]) / X[3, 3]


@njit(cache=True)
def gap(A: Array, B: Array, normal: Array, weights_a: Array, weights_b: Array) -> float:
    """Returns how far two hulls of points, (V, 3) and (W, 3), are apart at least; not positive where they are not known to be.

    Args:
        normal: (3,) gets the unit vector from B to A.
        weights_a, weights_b: (V,), (W,) get those of the nearest points.
    """
    points, G, w, slots, ends = np.zeros((6, 3)), np.zeros((6, 6)), np.zeros(6), np.zeros(6, np.int64), np.zeros((6, 2), np.int64)
    z, m, found = A[0] - B[0], 0, -1.0
    for _ in range(60):
        low, high, a, b = np.inf, -np.inf, 0, 0
        for v in range(len(A)):
            t = z[0] * A[v, 0] + z[1] * A[v, 1] + z[2] * A[v, 2]
            if t < low:
                low, a = t, v
        for v in range(len(B)):
            t = z[0] * B[v, 0] + z[1] * B[v, 1] + z[2] * B[v, 2]
            if t > high:
                high, b = t, v
        square = z[0] * z[0] + z[1] * z[1] + z[2] * z[2]
        if square < TOUCHING:
            found = 0.0
            break
        found = (low - high) / np.sqrt(square)
        if (m and low - high >= (1 - APART) * square) or m > 4:
            break
        row = A[a] - B[b]
        for i in range(m):
            G[i, m] = G[m, i] = points[slots[i]] @ row
        G[m, m] = row @ row
        slot = unused(slots, m)
        points[slot], ends[slot, 0], ends[slot, 1], slots[m] = row, a, b, slot
        w[m] = 0.0 if m else 1.0
        m = weigh(G, w, slots, m + 1)
        z[:] = 0.0
        for i in range(m):
            z += w[i] * points[slots[i]]
    length = np.sqrt(z @ z)
    normal[:] = z / max(length, 1e-300)
    weights_a[:], weights_b[:] = 0.0, 0.0
    for i in range(m):
        weights_a[ends[slots[i], 0]] += w[i]
        weights_b[ends[slots[i], 1]] += w[i]
    return found


@njit(cache=True)
def gaps(a: Hull, b: Hull, X: Array) -> Array:
    """Returns how far the bodies are apart at the configurations, (N,), radii subtracted; see :func:`gap`."""
    A, B, P, Q = np.empty(a.vertices.shape), np.empty(b.vertices.shape), np.empty((4, 4)), np.empty((4, 4))
    normal, weights_a, weights_b = np.empty(3), np.empty(len(A)), np.empty(len(B))
    found = np.empty(len(X))
    for i in range(len(X)):
        place(a, X[i], P, Q, A)
        place(b, X[i], P, Q, B)
        found[i] = gap(A, B, normal, weights_a, weights_b) - a.radius - b.radius
    return found


@njit(cache=True)
def approach(a: Hull, b: Hull, joints: Array, half: Array, C: Array, d: Array, s: Array, steps: int, near: float) -> float:
    """Moves s to where the bodies are nearer on {C s <= d}, until they are as near as ``near``, and returns their gap there.

    In every step a linear program moves to where the bodies would be nearest if the points that are nearest now stayed so.

    Args:
        joints: those that move one body against the other.
        half: (n,) a length for every joint, of which a small part serves for differences.
        C, d: rows of length 1.
    """
    A, B, P, Q = np.empty(a.vertices.shape), np.empty(b.vertices.shape), np.empty((4, 4)), np.empty((4, 4))
    normal, wa, wb, falling = np.empty(3), np.empty(len(A)), np.empty(len(B)), np.zeros(len(s))
    now, basis, edges, columns = np.inf, np.full(len(s), -1), np.empty((len(s), len(s))), np.ascontiguousarray(C.T)
    way, trials, work = np.empty(len(s)), np.empty((SHORTEST, len(s))), np.empty((WORK, len(d)))
    for _ in range(steps):
        place(a, s, P, Q, A)
        place(b, s, P, Q, B)
        now = gap(A, B, normal, wa, wb) - a.radius - b.radius
        if now <= near:
            break
        for j in joints:
            old, step = s[j], DIFFERENCE * half[j]
            falling[j] = 0.0
            for sign in (1.0, -1.0):
                s[j] = old + sign * step
                place(a, s, P, Q, A)
                place(b, s, P, Q, B)
                falling[j] -= sign * ((wa @ A - wb @ B) @ normal) / (2 * step)
            s[j] = old
        if not corner(columns, d, s, falling, basis, edges, work, way):
            break
        length = INSIDE
        for i in range(SHORTEST):
            trials[i] = s + length * way
            length *= 0.5
        found = gaps(a, b, trials)
        best = found.argmin()
        if found[best] >= now - SLOWEST * abs(now):
            break
        s[:] = trials[best]
        now = found[best]
    return now
