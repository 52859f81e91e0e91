"""Compiled loops that say whether configurations, and straight lines between them, are free of collisions.

A line is free where every pair is apart all along it. In an interval of time of length h, a vertex stays within h^2/8 times the bound of
its acceleration of the chord between its places at both ends (certifier.motion.intervals). So one plane that separates the places at both
ends, with room for that, is enough for the interval; otherwise it is halved. Nothing is missed between samples.

All is floating point, and proves nothing: certifier.jobs.motion does.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.collisions.seen import Seen
from certifier.model import Array
from certifier.motion.bodies import Bodies, place, place_links
from certifier.motion.nearest import farther, separation
from certifier.motion.views import acceleration, moved

CLOSE = 1e-6
"""Bodies that are nearer than about this, in metres, on a line may count as touching."""
STEPS = 16
"""The links' poses are kept at this many equal steps of a line."""


@njit(cache=True)
def _far(bodies: Bodies, seen: Seen, pair: int, R: Array, p: Array, more: float) -> bool:
    """Says whether the balls around a pair's geometries are more than ``more`` metres apart."""
    a, b = seen.pairs[pair, 0], seen.pairs[pair, 1]
    here, there = bodies.links[a], bodies.links[b]
    square = 0.0
    for i in range(3):
        apart = p[here, i] - p[there, i]
        for k in range(3):
            apart += R[here, i, k] * bodies.centers[a, k] - R[there, i, k] * bodies.centers[b, k]
        square += apart * apart
    least = bodies.sizes[a] + bodies.sizes[b] + seen.reaches[pair] + more
    return square > least * least


@njit(cache=True)
def _distance(bodies: Bodies, seen: Seen, pair: int, R: Array, p: Array) -> float:
    """Returns how far a pair's padded bodies are apart, metres; 0 or less where they touch."""
    A, B = _vertices(bodies, seen, pair, R, p)
    return separation(A, B, np.empty(3)) - seen.reaches[pair]


@njit(cache=True)
def _vertices(bodies: Bodies, seen: Seen, pair: int, R: Array, p: Array) -> tuple[Array, Array]:
    """Returns where the vertices of a pair's geometries are in the frame of the first one's link, (V, 3) and (W, 3)."""
    a, b = seen.pairs[pair, 0], seen.pairs[pair, 1]
    points = np.empty((bodies.first[b + 1] - bodies.first[b], 3))
    place(bodies, b, bodies.links[a], R, p, points)
    return bodies.vertices[bodies.first[a] : bodies.first[a + 1]], points


@njit(cache=True)
def _touches(bodies: Bodies, seen: Seen, q: Array, R: Array, p: Array, order: np.ndarray, normals: Array) -> bool:
    """Says whether a pair touches at q, whose links' poses are filled in. A pair that does comes first in ``order``.

    Args:
        normals: (P, 3) the directions along which each pair was apart the last time, or 0. They are tried first, and replaced.
    """
    place_links(bodies, q, R, p)
    for k in range(len(order)):
        pair = order[k]
        if _far(bodies, seen, pair, R, p, 0.0):
            continue
        A, B = _vertices(bodies, seen, pair, R, p)
        if not farther(A, B, seen.reaches[pair], normals[pair]):
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
def distance_at(bodies: Bodies, seen: Seen, pair: int, q: Array, R: Array, p: Array) -> float:
    """Returns how far a pair's padded bodies are apart at joint positions q, (n,), metres; 0 or less where they touch.

    Args:
        R, p: (L, 3, 3) and (L, 3) are overwritten.
    """
    place_links(bodies, q, R, p)
    return _distance(bodies, seen, pair, R, p)


@njit(cache=True)
def touching_at(bodies: Bodies, seen: Seen, q: Array, order: np.ndarray) -> int:
    """Returns the first pair that is found to touch at joint positions q, (n,), or -1. For ``order`` see :func:`free_at`."""
    return -1 if free_at(bodies, seen, q, order) else order[0]


@njit(cache=True)
def free_at(bodies: Bodies, seen: Seen, q: Array, order: np.ndarray) -> bool:
    """Says whether no pair touches at joint positions q, (n,).

    Args:
        order: (P,) the pairs in the order in which they are looked at. One that touches is moved to the front.
    """
    links = len(bodies.parents)
    return not _touches(bodies, seen, q, np.empty((links, 3, 3)), np.empty((links, 3)), order, np.zeros((len(order), 3)))


@njit(cache=True)
def free_at_all(bodies: Bodies, seen: Seen, q: Array, order: np.ndarray) -> np.ndarray:
    """Says at which of the joint positions q, (N, n), no pair touches; (N,). For ``order`` see :func:`free_at`."""
    links = len(bodies.parents)
    R, p, found = np.empty((links, 3, 3)), np.empty((links, 3)), np.empty(len(q), dtype=np.bool_)
    normals = np.zeros((len(seen.pairs), 3))
    for i in range(len(q)):
        found[i] = not _touches(bodies, seen, q[i], R, p, order, normals)
    return found


@njit(cache=True)
def free_along(bodies: Bodies, seen: Seen, q0: Array, q1: Array, order: np.ndarray, close: float) -> bool:
    """Says whether no pair touches on the straight line in q from q0 to q1, (n,) each.

    Args:
        order: as for :func:`free_at`.
        close: pairs that come nearer than about this, in metres, may count as touching.
    """
    links, way = len(bodies.parents), q1 - q0
    rates, changes = np.abs(way), np.zeros(len(way))
    # The links' poses at the times k / STEPS are computed once for all pairs; those at other times come last.
    R, p, known = np.empty((STEPS + 2, links, 3, 3)), np.empty((STEPS + 2, links, 3)), np.zeros(STEPS + 2, dtype=np.bool_)
    middle = STEPS // 2  # most lines that touch something do so there as well
    known[middle] = True
    if _touches(bodies, seen, q0 + 0.5 * way, R[middle], p[middle], order, np.zeros((len(order), 3))):
        return False
    place_links(bodies, q0, R[0], p[0])
    normal, other, stack, moving = np.empty(3), np.empty(3), np.empty(64), np.empty((2 * len(bodies.vertices), 3))
    for k in range(len(order)):
        pair = order[k]
        view = seen.moving[pair]
        distance, bent = moved(seen.views, view, seen.levers, rates), acceleration(seen.views, view, seen.levers, rates, changes)
        if _far(bodies, seen, pair, R[middle], p[middle], distance / 2.0):
            continue
        a, b, reach = seen.pairs[pair, 0], seen.pairs[pair, 1], seen.reaches[pair]
        A, W, frame = bodies.vertices[bodies.first[a] : bodies.first[a + 1]], bodies.first[b + 1] - bodies.first[b], bodies.links[a]
        B = moving[: 2 * W]  # first where b is at the beginning of an interval, then where it is at the end
        place(bodies, b, frame, R[0], p[0], B[:W])
        normal[:], other[:] = 0.0, 0.0
        t0, top = 0.0, 1
        stack[0] = 1.0
        while top:
            t1 = stack[top - 1]
            kept = t1 * STEPS == np.floor(t1 * STEPS)
            slot = int(t1 * STEPS) if kept else STEPS + 1
            if not (kept and known[slot]):
                place_links(bodies, q0 + t1 * way, R[slot], p[slot])
                known[slot] = kept
            place(bodies, b, frame, R[slot], p[slot], B[W:])
            if farther(A, B, reach + (t1 - t0) ** 2 / 8.0 * bent, normal):
                B[:W] = B[W:]
                t0, top = t1, top - 1
                continue
            if not farther(A, B[W:], reach, other) or (t1 - t0) * distance <= close:
                _to_front(order, k)
                return False
            stack[top] = (t0 + t1) / 2.0
            top += 1
    return True
