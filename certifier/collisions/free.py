"""Compiled loops that say whether configurations, and straight lines between them, are free of collisions.

A line is free where every pair is apart all along it. In an interval of time of length h, a vertex stays within h^2/8 times the bound of
its acceleration of the chord between its places at both ends (certifier.motion.intervals). So one plane that separates the places at both
ends, with room for that, is enough for the interval; otherwise it is halved. Nothing is missed between samples.

All is floating point, and proves nothing: certifier.jobs.motion does.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.collisions.bodies import Bodies
from certifier.model import Array
from certifier.motion.nearest import separation

CLOSE = 1e-6
"""Bodies that are nearer than about this, in metres, on a line may count as touching."""
_FIRST = np.array([1.0, 0.5, 0.25, 0.75])
"""Most lines that touch something do so at one of these times."""


@njit(cache=True)
def place_links(bodies: Bodies, q: Array, R: Array, p: Array) -> None:
    """Fills in the links' rotations R, (L, 3, 3), and positions p, (L, 3), in the world at joint positions q, (n,)."""
    R[0] = np.eye(3)
    p[0] = 0.0
    X = np.empty((3, 3))
    for link in range(1, len(bodies.parents)):
        parent, value, u = bodies.parents[link], q[bodies.joints[link]], bodies.axes[link]
        fixed, offset = bodies.rotations[link], bodies.offsets[link]
        for i in range(3):
            a, b, d = R[parent, i, 0], R[parent, i, 1], R[parent, i, 2]
            p[link, i] = p[parent, i] + a * offset[0] + b * offset[1] + d * offset[2]
            for j in range(3):
                X[i, j] = a * fixed[0, j] + b * fixed[1, j] + d * fixed[2, j]
        if bodies.slides[link]:
            for i in range(3):
                p[link, i] += value * (X[i, 0] * u[0] + X[i, 1] * u[1] + X[i, 2] * u[2])
                for j in range(3):
                    R[link, i, j] = X[i, j]
        else:
            c, s = np.cos(value), np.sin(value)
            x, y, z, v = u[0], u[1], u[2], 1.0 - c
            for i in range(3):
                a, b, d = X[i, 0], X[i, 1], X[i, 2]
                R[link, i, 0] = a * (c + v * x * x) + b * (v * x * y + s * z) + d * (v * x * z - s * y)
                R[link, i, 1] = a * (v * x * y - s * z) + b * (c + v * y * y) + d * (v * y * z + s * x)
                R[link, i, 2] = a * (v * x * z + s * y) + b * (v * y * z - s * x) + d * (c + v * z * z)


@njit(cache=True)
def _far(bodies: Bodies, pair: int, R: Array, p: Array, more: float) -> bool:
    """Says whether the balls around a pair's geometries are more than ``more`` metres apart."""
    a, b = bodies.pairs[pair, 0], bodies.pairs[pair, 1]
    here, there = bodies.links[a], bodies.links[b]
    square = 0.0
    for i in range(3):
        apart = p[here, i] - p[there, i]
        for k in range(3):
            apart += R[here, i, k] * bodies.centers[a, k] - R[there, i, k] * bodies.centers[b, k]
        square += apart * apart
    least = bodies.sizes[a] + bodies.sizes[b] + bodies.reaches[pair] + more
    return square > least * least


@njit(cache=True)
def _place(bodies: Bodies, pair: int, R: Array, p: Array, points: Array) -> None:
    """Fills in where the vertices of b are in the frame of the link of a, (W, 3)."""
    a, b = bodies.pairs[pair, 0], bodies.pairs[pair, 1]
    here, there, begin = bodies.links[a], bodies.links[b], bodies.first[b]
    Q, t = np.empty((3, 3)), np.empty(3)
    for i in range(3):
        t[i] = 0.0
        for k in range(3):
            t[i] += R[here, k, i] * (p[there, k] - p[here, k])
            Q[i, k] = R[here, 0, i] * R[there, 0, k] + R[here, 1, i] * R[there, 1, k] + R[here, 2, i] * R[there, 2, k]
    for v in range(len(points)):
        x, y, z = bodies.vertices[begin + v, 0], bodies.vertices[begin + v, 1], bodies.vertices[begin + v, 2]
        for i in range(3):
            points[v, i] = Q[i, 0] * x + Q[i, 1] * y + Q[i, 2] * z + t[i]


@njit(cache=True)
def _distance(bodies: Bodies, pair: int, R: Array, p: Array) -> float:
    """Returns how far a pair's padded bodies are apart, metres; 0 or less where they touch."""
    a, b = bodies.pairs[pair, 0], bodies.pairs[pair, 1]
    points = np.empty((bodies.first[b + 1] - bodies.first[b], 3))
    _place(bodies, pair, R, p, points)
    return separation(bodies.vertices[bodies.first[a] : bodies.first[a + 1]], points, np.empty(3)) - bodies.reaches[pair]


@njit(cache=True)
def _touches(bodies: Bodies, q: Array, R: Array, p: Array, order: np.ndarray) -> bool:
    """Says whether a pair touches at q, whose links' poses are filled in. A pair that does comes first in ``order``."""
    place_links(bodies, q, R, p)
    for k in range(len(order)):
        if not _far(bodies, order[k], R, p, 0.0) and _distance(bodies, order[k], R, p) <= 0.0:
            _to_front(order, k)
            return True
    return False


@njit(cache=True)
def _to_front(order: np.ndarray, k: int) -> None:
    pair = order[k]
    for i in range(k, 0, -1):
        order[i] = order[i - 1]
    order[0] = pair


@njit(cache=True)
def free_at(bodies: Bodies, q: Array, order: np.ndarray) -> bool:
    """Says whether no pair touches at joint positions q, (n,).

    Args:
        order: (P,) the pairs in the order in which they are looked at. One that touches is moved to the front.
    """
    links = len(bodies.parents)
    return not _touches(bodies, q, np.empty((links, 3, 3)), np.empty((links, 3)), order)


@njit(cache=True)
def free_at_all(bodies: Bodies, q: Array, order: np.ndarray) -> np.ndarray:
    """Says at which of the joint positions q, (N, n), no pair touches; (N,). For ``order`` see :func:`free_at`."""
    links = len(bodies.parents)
    R, p, found = np.empty((links, 3, 3)), np.empty((links, 3)), np.empty(len(q), dtype=np.bool_)
    for i in range(len(q)):
        found[i] = not _touches(bodies, q[i], R, p, order)
    return found


@njit(cache=True)
def free_along(bodies: Bodies, q0: Array, q1: Array, order: np.ndarray, close: float) -> bool:
    """Says whether no pair touches on the straight line in q from q0 to q1, (n,) each.

    Args:
        order: as for :func:`free_at`.
        close: pairs that come nearer than about this, in metres, may count as touching.
    """
    links, way = len(bodies.parents), q1 - q0
    middle, middle_p = np.empty((links, 3, 3)), np.empty((links, 3))
    for time in _FIRST:
        if _touches(bodies, q0 + time * way, middle, middle_p, order):
            return False
    start, start_p, end, end_p = np.empty((links, 3, 3)), np.empty((links, 3)), np.empty((links, 3, 3)), np.empty((links, 3))
    place_links(bodies, q0, start, start_p)
    place_links(bodies, q1, end, end_p)
    place_links(bodies, q0 + 0.5 * way, middle, middle_p)
    R, p = np.empty((links, 3, 3)), np.empty((links, 3))
    normal, other, stack = np.empty(3), np.empty(3), np.empty(64)
    for k in range(len(order)):
        pair = order[k]
        moved, bent = _bounds(bodies, pair, way)
        if _far(bodies, pair, middle, middle_p, moved / 2.0):
            continue
        a, b, reach = bodies.pairs[pair, 0], bodies.pairs[pair, 1], bodies.reaches[pair]
        A, W = bodies.vertices[bodies.first[a] : bodies.first[a + 1]], bodies.first[b + 1] - bodies.first[b]
        B = np.empty((2 * W, 3))  # first where b is at the beginning of an interval, then where it is at the end
        _place(bodies, pair, start, start_p, B[:W])
        t0, top = 0.0, 1
        stack[0] = 1.0
        while top:
            t1 = stack[top - 1]
            if t1 == 1.0:
                _place(bodies, pair, end, end_p, B[W:])
            else:
                place_links(bodies, q0 + t1 * way, R, p)
                _place(bodies, pair, R, p, B[W:])
            if separation(A, B, normal) > reach + (t1 - t0) ** 2 / 8.0 * bent:
                B[:W] = B[W:]
                t0, top = t1, top - 1
                continue
            if separation(A, B[W:], other) <= reach or (t1 - t0) * moved <= close:
                _to_front(order, k)
                return False
            stack[top] = (t0 + t1) / 2.0
            top += 1
    return True


@njit(cache=True)
def _bounds(bodies: Bodies, pair: int, way: Array) -> tuple[float, float]:
    """Returns bounds of the speed and the acceleration of the vertices of b in the link of a on a line, metres."""
    moved, bent, turning = 0.0, 0.0, 0.0
    for c in range(bodies.begins[pair], bodies.begins[pair + 1]):
        rate = abs(way[bodies.chains[c]])
        moved += bodies.levers[c] * rate
        if bodies.sliding[c]:
            bent += 2.0 * turning * rate
        else:
            bent += bodies.levers[c] * rate * (rate + 2.0 * turning)
            turning += rate
    return moved, bent
