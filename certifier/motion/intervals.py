"""The search for planes: compiled loops over the pairs, and for each over intervals of time, halved until one plane is enough for each.

Nothing here is trusted: the verifier checks the planes (certifier.verify.motion).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.motion.bodies import Bodies, place
from certifier.motion.curve import Curve, Poses, bound_rates, evaluate, pose
from certifier.motion.nearest import separation
from certifier.motion.views import Views, acceleration, moved

DONE, CONTACT, NARROW, MANY = range(4)
"""How the search for a pair ends: it is apart all along; it touches; an interval is too narrow to be halved; there are too many."""
RESOLUTION = 1e-7
"""Padded bodies that are at most this far apart, in metres, count as touching."""
NARROWEST = 2.0**-40
"""No interval is narrower than this part of its piece."""
SHRINK = 0.98
"""A tube is this part of what the bodies' distance allows, so that intervals need not become too short."""
ROUNDED = 2.0**-41
"""The planes leave this part of the bodies' sizes, for every joint and two more, for what the verifier rounds."""
_FIRST = 1 << 10
"""At first there is room for this many intervals of all pairs."""


class Ground(NamedTuple):
    """Holds what all pairs share in the search for planes of a motion.

    Attributes:
        levers, lengths: of the views (certifier.motion.views.levers_of).
        chosen: (P,) the choice of every pair, in whose frame its planes are constant.
    """

    bodies: Bodies
    views: Views
    curve: Curve
    poses: Poses
    levers: Array
    lengths: Array
    chosen: np.ndarray


class Planes(NamedTuple):
    """Holds I intervals with a plane each, one after the other.

    Attributes:
        ends: (I,) the times at which they end.
        normals: (I, 3) unit vectors from b to a.
    """

    ends: Array
    normals: Array


class End(NamedTuple):
    """Says how the search for a pair ends.

    Attributes:
        piece, t0, t1: the piece where it does, and the beginning and the end of the interval there.
        distance: how far the padded bodies are apart beyond what they have to, in metres, at the beginning or, for a contact, where they
            touch.
    """

    how: int
    piece: int
    t0: float
    t1: float
    distance: float


@njit(cache=True)
def gap_along(normal: Array, A: Array, B: Array) -> float:
    """Returns how far a plane's normal, (3,), keeps points A, (V, 3), on its side of points B, (W, 3), times the normal's length."""
    low, high = np.inf, -np.inf
    for v in range(len(A)):
        low = min(low, normal[0] * A[v, 0] + normal[1] * A[v, 1] + normal[2] * A[v, 2])
    for v in range(len(B)):
        high = max(high, normal[0] * B[v, 0] + normal[1] * B[v, 1] + normal[2] * B[v, 2])
    return low - high


@njit(cache=True)
def choose(views: Views, levers: Array, rates: Array, changes: Array, chosen: np.ndarray) -> None:
    """Fills in the choice of every pair, (P,), from whose frame the accelerations look least.

    Args:
        rates, changes: (n,) bounds for all of the motion.
    """
    for pair in range(len(chosen)):
        least = np.inf
        for choice in range(views.first[pair], views.first[pair + 1]):
            bent = 0.0
            for view in views.sides[choice]:
                bent += acceleration(views, view, levers, rates, changes)
            if bent < least:
                least, chosen[pair] = bent, choice


@njit(cache=True)
def see(ground: Ground, pair: int, piece: int, time: float, at: Array, q: Array, A: Array, B: Array) -> None:
    """Fills in where a pair's vertices are in their frame at a time of a piece, A (V, 3) and B (W, 3).

    Args:
        at: (3, n) gets what certifier.motion.curve.evaluate fills in.
        q: (n,) is overwritten.
    """
    (a, b), frame = ground.bodies.pairs[pair], ground.views.frames[ground.chosen[pair]]
    evaluate(ground.curve.controls[piece], time, at)
    slot = pose(ground.bodies, ground.curve, ground.poses, piece, time, at[0], q)
    place(ground.bodies, a, frame, ground.poses.R[slot], ground.poses.p[slot], A)
    place(ground.bodies, b, frame, ground.poses.R[slot], ground.poses.p[slot], B)


@njit(cache=True)
def sizes(bodies: Bodies, pair: int) -> tuple[int, int]:
    """Returns how many vertices the geometries of a pair have."""
    a, b = bodies.pairs[pair]
    return bodies.first[a + 1] - bodies.first[a], bodies.first[b + 1] - bodies.first[b]


@njit(cache=True)
def apart_at_first(ground: Ground, pair: int) -> float:
    """Returns the distance of a pair's padded bodies at the beginning of the motion, in metres; 0 or less where they meet."""
    n, (V, W) = ground.curve.controls.shape[2], sizes(ground.bodies, pair)
    A, B = np.empty((V, 3)), np.empty((W, 3))
    see(ground, pair, 0, 0.0, np.empty((3, n)), np.empty(n), A, B)
    return separation(A, B, np.empty(3)) - ground.bodies.reaches[pair]


@njit(cache=True)
def widening(ground: Ground, pair: int) -> float:
    """Returns how much a pair's distance changes at most where every joint moves by 1, in metres."""
    views, total = ground.views, 0.0
    for view in views.sides[ground.chosen[pair]]:
        for k in range(views.begins[view], views.begins[view + 1]):
            total += ground.levers[k]
    return total


@njit(cache=True)
def widest(ground: Ground, kept: float) -> float:
    """Returns a tube beyond which the bodies' distances at the beginning do not let any be, radians or metres; infinity for no limit.

    Args:
        kept: how far apart the padded bodies have to be, metres.
    """
    rho = np.inf
    for pair in range(len(ground.chosen)):
        wide = widening(ground, pair)
        if wide > 0.0:
            rho = min(rho, (apart_at_first(ground, pair) - kept) / wide)
    return rho


@njit(cache=True)
def _slack(ground: Ground, pair: int, reach: float) -> float:
    """Returns how many metres a pair's planes have to leave for what the verifier rounds, and for what is rounded here."""
    views, choice = ground.views, ground.chosen[pair]
    joints, size, way = 2, 0.0, views.ways[views.frames[choice]]
    for k in range(2):
        view = views.sides[choice, k]
        first, end = views.begins[view], views.begins[view + 1]
        joints += end - first
        size += ground.lengths[view] + views.speeds[first:end].sum()  # what the position of a slide is wrong by counts times its speed
        way += views.ways[ground.bodies.links[ground.bodies.pairs[pair, k]]]
    largest = np.abs(ground.curve.controls).max()
    return ROUNDED * (reach + joints * size * (1.0 + largest)) + 2.0**-46 * way


@njit(cache=True)
def _with_room(planes: Planes, found: int) -> Planes:
    """Returns planes, the first of which are those found so far, with room for one more at least."""
    if found < len(planes.ends):
        return planes
    more = Planes(np.empty(2 * found), np.empty((2 * found, 3)))
    more.ends[:found], more.normals[:found] = planes.ends, planes.normals
    return more


@njit(cache=True)
def _divide(
    ground: Ground,
    pair: int,
    kept: float,
    rho: float,
    shrinks: bool,
    until: tuple[int, float],
    planes: Planes,
    first: int,
    most: int,
    counts: np.ndarray,
) -> tuple[End, float, Planes, int]:
    """Divides the motion into intervals with a plane each, from its beginning on, until it ends or the pair touches.

    Args:
        kept, rho, shrinks, until: as for :func:`divide`, which has the last one from the pairs before.
        planes: gets those of the pair from ``first`` on, at most ``most``.
        counts: (P,) is filled in.

    Returns:
        how it ends; rho at the end; the planes, and how many there are.
    """
    views, curve, levers = ground.views, ground.curve, ground.levers
    side_a, side_b = views.sides[ground.chosen[pair]]
    n, (V, W) = curve.controls.shape[2], sizes(ground.bodies, pair)
    # The vertices of the interval's beginning come first, then those of its end.
    A, B = np.empty((2 * V, 3)), np.empty((2 * W, 3))
    q, rates, changes, normal, other, stack = np.empty(n), np.empty(n), np.empty(n), np.zeros(3), np.empty(3), np.empty(64)
    here, there = np.empty((3, n)), np.empty((3, n))
    found, reach, wide = first, ground.bodies.reaches[pair] + kept, widening(ground, pair)
    slack = _slack(ground, pair, reach)
    for piece in range(len(curve.controls)):
        t0, top = 0.0, 1
        stack[0] = 1.0
        see(ground, pair, piece, 0.0, here, q, A[:V], B[:W])
        while top:
            t1 = stack[top - 1]
            see(ground, pair, piece, t1, there, q, A[V:], B[W:])
            bound_rates(curve, piece, here, there, t1 - t0, rates, changes)
            bent = acceleration(views, side_a, levers, rates, changes) + acceleration(views, side_b, levers, rates, changes)
            need = reach + slack + (t1 - t0) ** 2 / 8.0 * bent
            apart = gap_along(normal, A, B) > need + rho * wide
            if not apart:
                gap = separation(A, B, normal)
                if gap <= need + rho * wide and shrinks:
                    for known in (separation(A[:V], B[:W], other) - reach, separation(A[V:], B[W:], other) - reach):
                        if known > RESOLUTION and wide > 0.0:
                            rho = min(rho, SHRINK * known / wide)
                apart = gap > need + rho * wide
            if apart:
                if found - first >= most:
                    return End(MANY, piece, t0, t1, separation(A[:V], B[:W], other) - reach), rho, planes, found
                planes = _with_room(planes, found)
                planes.ends[found], planes.normals[found] = t1, normal
                found += 1
                counts[piece] += 1
                if piece == until[0] and t1 >= until[1]:
                    return End(DONE, piece, t0, t1, 0.0), rho, planes, found
                A[:V] = A[V:]
                B[:W] = B[W:]
                here[:] = there
                t0, top = t1, top - 1
                continue
            reached = moved(views, side_a, levers, rates) + moved(views, side_b, levers, rates)
            narrow = t1 - t0 <= NARROWEST
            if narrow or (t1 - t0) * reached <= RESOLUTION:
                now, then = separation(A[:V], B[:W], other) - reach, separation(A[V:], B[W:], other) - reach
                if now <= RESOLUTION:
                    return End(CONTACT, piece, t0, t0, now), rho, planes, found
                if then <= RESOLUTION:
                    return End(CONTACT, piece, t0, t1, then), rho, planes, found
                if narrow:
                    return End(NARROW, piece, t0, t1, now), rho, planes, found
            stack[top] = (t0 + t1) / 2.0
            top += 1
    return End(DONE, len(curve.controls) - 1, 1.0, 1.0, 0.0), rho, planes, found


@njit(cache=True)
def divide(
    ground: Ground, kept: float, rho: float, shrinks: bool, most: int, counts: np.ndarray
) -> tuple[int, End, tuple[int, float], float, Planes]:
    """Divides the motion for all pairs, for each of them up to where one before it touches.

    Args:
        kept: the distance that the padded bodies have to keep, metres.
        rho: the tube, radians or metres.
        shrinks: whether the tube becomes smaller where it has to.
        most: how many intervals there may be more than pieces of all pairs.
        counts: (pairs, pieces) of 0; it gets the numbers of intervals.

    Returns:
        the pair that touches first, or -1, and how it ends; the piece and the time in it up to which all pairs have planes; rho at the end;
        the planes of all pairs, one after the other.
    """
    pieces = len(ground.curve.controls)
    until, certified = (pieces - 1, 1.0), (pieces - 1, 1.0)
    planes, found = Planes(np.empty(_FIRST), np.empty((_FIRST, 3))), 0
    stopped, stop = -1, End(DONE, pieces - 1, 1.0, 1.0, 0.0)
    for pair in range(len(ground.chosen)):
        first = found
        end, rho, planes, found = _divide(ground, pair, kept, rho, shrinks, until, planes, first, most + pieces, counts[pair])
        most -= max(0, found - first - pieces)
        if end.how != DONE:
            if (end.piece, end.t0) < certified:
                certified = (end.piece, end.t0)
            time = end.t1 if end.how == CONTACT else end.t0
            if stopped < 0 or (end.piece, time) < (stop.piece, stop.t1 if stop.how == CONTACT else stop.t0):
                until, stopped, stop = (end.piece, end.t1), pair, end
    return stopped, stop, certified, rho, Planes(planes.ends[:found].copy(), planes.normals[:found].copy())
