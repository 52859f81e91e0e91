"""The closest approach of a pair along a motion: a compiled branch and bound over intervals of time.

Nothing here is trusted: the search looks for planes that prove nearly as large a distance, and the verifier checks them.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.motion.chains import Side
from certifier.motion.intervals import NARROWEST, RESOLUTION, acceleration, bound_rates, evaluate, gap_along, moved, place, positions
from certifier.motion.nearest import separation

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
def approach(
    a: Side,
    b: Side,
    controls: Array,
    hulls: Array,
    inexact: tuple[float, float],
    turns: Array,
    q_star: Array,
    reach: float,
    rho: float,
    least: float,
) -> tuple[float, int, float]:
    """Returns the least distance of the padded bodies along a motion, less what a tube takes of it, or ``least`` if it is less.

    An interval is left aside where a plane shows a little more than :func:`proved_of` the least distance that is known. Otherwise it is
    halved.

    Args:
        controls, hulls, inexact, turns, q_star, reach, rho: as for certifier.motion.intervals.divide.
        least: metres; what is not less is of no interest.

    Returns:
        the distance in metres, and the piece and the time where it occurs; the piece is -1 where it is ``least``. No distance is less than
        :func:`proved_of` it, but for rounding.
    """
    n, V, W = controls.shape[2], len(a.vertices), len(b.vertices)
    # The vertices of the interval's beginning come first, then those of its end.
    A, B, X, Y = np.empty((2 * V, 3)), np.empty((2 * W, 3)), np.empty((3, 4)), np.empty((3, 4))
    q, rates, changes, normal, other, stack = np.empty(n), np.empty(n), np.empty(n), np.zeros(3), np.empty(3), np.empty(64)
    here, there = np.empty((3, n)), np.empty((3, n))
    where, when = -1, 0.0
    for piece in range(len(controls)):
        t0, top = 0.0, 1
        stack[0] = 1.0
        taken = reach
        for side in (a, b):
            for k in range(len(side.chain.joints)):
                taken += rho * side.levers[piece, k]
        evaluate(controls[piece], 0.0, here)
        positions(here[0], turns, q_star, q)
        place(a, q, X, Y, A[:V])
        place(b, q, X, Y, B[:W])
        while top:
            t1 = stack[top - 1]
            evaluate(controls[piece], t1, there)
            positions(there[0], turns, q_star, q)
            place(a, q, X, Y, A[V:])
            place(b, q, X, Y, B[W:])
            bound_rates(here, there, hulls[piece], t1 - t0, inexact, turns, rates, changes)
            bent = acceleration(a, a.levers[piece], rates, changes) + acceleration(b, b.levers[piece], rates, changes)
            need = taken + (t1 - t0) ** 2 / 8.0 * bent + proved_of(least) + ROOM
            settled = gap_along(normal, A, B) > need or separation(A, B, normal) > need
            if not settled:
                now, then = separation(A[:V], B[:W], other) - taken, separation(A[V:], B[W:], other) - taken
                if min(now, then) < least:
                    where, when, least = piece, t0 if now < then else t1, min(now, then)
                reached = moved(a, a.levers[piece], rates) + moved(b, b.levers[piece], rates)
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
