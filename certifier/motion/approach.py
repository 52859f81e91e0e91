"""The closest approach of the pairs along a motion: a compiled branch and bound over intervals of time.

Nothing here is trusted: the search looks for planes that prove nearly as large a distance, and the verifier checks them.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.motion.curve import bound_rates
from certifier.motion.intervals import NARROWEST, RESOLUTION, Ground, apart_at_first, gap_along, see, sizes, widening
from certifier.motion.nearest import separation
from certifier.motion.views import acceleration, moved

SHARE, METRES = 0.1, 1e-4
"""A clearance is proved to this part of itself, and to this many metres, whichever is less."""
ROOM = 2 * RESOLUTION
"""All distances are larger than the one that is to be proved by this many metres, so that none of them counts as a contact then."""
FINEST = 2 * ROOM
"""A clearance is proved no finer than to this many metres."""


@njit(cache=True)
def proved_of(distance: float) -> float:
    """Returns how large a distance is to be proved where one of ``distance`` occurs, in metres."""
    return distance - max(FINEST, min(SHARE * distance, METRES))


@njit(cache=True)
def closest(ground: Ground, rho: float) -> tuple[float, int, int, float, float]:
    """Returns the least distance of padded bodies along a motion, less what a tube takes of it, in metres.

    Args:
        rho: the tube, radians or metres.

    Returns:
        the distance; the pair, the piece and the time where it occurs, with a piece of -1 where no pair is; and what the tube takes of it.
        No distance is less than :func:`proved_of` it, but for rounding.
    """
    first = np.array([apart_at_first(ground, pair) for pair in range(len(ground.chosen))])
    least, nearest, where, when, taken = np.inf, -1, -1, 0.0, 0.0
    for pair in np.argsort(first):
        found, piece, time = _closest(ground, pair, rho, least)
        if piece >= 0:
            least, nearest, where, when, taken = found, pair, piece, time, rho * widening(ground, pair)
    return least, nearest, where, when, taken


@njit(cache=True)
def _closest(ground: Ground, pair: int, rho: float, least: float) -> tuple[float, int, float]:
    """Returns the least distance of a pair along a motion, less what a tube takes of it, or ``least`` if it is less.

    An interval is left aside where a plane shows a little more than :func:`proved_of` the least distance that is known. Otherwise it is
    halved.

    Returns:
        the distance in metres, and the piece and the time where it occurs; the piece is -1 where it is ``least``.
    """
    views, curve, levers = ground.views, ground.curve, ground.levers
    side_a, side_b = views.sides[ground.chosen[pair]]
    n, (V, W) = curve.controls.shape[2], sizes(ground.bodies, pair)
    # The vertices of the interval's beginning come first, then those of its end.
    A, B = np.empty((2 * V, 3)), np.empty((2 * W, 3))
    q, rates, changes, normal, other, stack = np.empty(n), np.empty(n), np.empty(n), np.zeros(3), np.empty(3), np.empty(64)
    here, there = np.empty((3, n)), np.empty((3, n))
    taken = ground.bodies.reaches[pair] + rho * widening(ground, pair)
    where, when = -1, 0.0
    for piece in range(len(curve.controls)):
        t0, top = 0.0, 1
        stack[0] = 1.0
        see(ground, pair, piece, 0.0, here, q, A[:V], B[:W])
        while top:
            t1 = stack[top - 1]
            see(ground, pair, piece, t1, there, q, A[V:], B[W:])
            bound_rates(curve, piece, here, there, t1 - t0, rates, changes)
            bent = acceleration(views, side_a, levers, rates, changes) + acceleration(views, side_b, levers, rates, changes)
            need = taken + (t1 - t0) ** 2 / 8.0 * bent + proved_of(least) + ROOM
            settled = gap_along(normal, A, B) > need or separation(A, B, normal) > need
            if not settled:
                now, then = separation(A[:V], B[:W], other) - taken, separation(A[V:], B[W:], other) - taken
                if min(now, then) < least:
                    where, when, least = piece, t0 if now < then else t1, min(now, then)
                reached = moved(views, side_a, levers, rates) + moved(views, side_b, levers, rates)
                settled = t1 - t0 <= NARROWEST or (t1 - t0) * reached <= RESOLUTION
            if settled:
                A[:V] = A[V:]
                B[:W] = B[W:]
                here[:] = there
                t0, top = t1, top - 1
                continue
            stack[top] = (t0 + t1) / 2.0
            top += 1
    return least, where, when
