"""The search for planes of one pair: compiled loops over intervals of time that are halved until one plane is enough for each.

Nothing here is trusted: the verifier checks the planes (certifier.verify.motion).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.motion.chains import Side
from certifier.motion.nearest import separation

DONE, CONTACT, NARROW, MANY = range(4)
"""How the search for a pair ends: it is apart all along; it touches; an interval is too narrow to be halved; there are too many."""
RESOLUTION = 1e-7
"""Padded bodies that are at most this far apart, in metres, count as touching."""
NARROWEST = 2.0**-40
"""No interval is narrower than this part of its piece."""
SHRINK = 0.98
"""A tube is this part of what the bodies' distance allows, so that intervals need not become too short."""


@njit(cache=True)
def place(side: Side, q: Array, X: Array, Y: Array, points: Array) -> None:
    """Fills in where the vertices are in the planes' frame, (V, 3), at positions q; X and Y, (3, 4), are overwritten."""
    chain = side.chain
    X[:, :3], X[:, 3] = chain.rotations[0], chain.offsets[0]
    for k in range(len(chain.joints)):
        u, value = chain.axes[k], q[chain.joints[k]]
        if chain.slides[k]:
            for i in range(3):
                X[i, 3] += value * (X[i, 0] * u[0] + X[i, 1] * u[1] + X[i, 2] * u[2])
        else:
            c, s = np.cos(value), np.sin(value)
            x, y, z, v = u[0], u[1], u[2], 1.0 - c
            for i in range(3):
                a, b, d = X[i, 0], X[i, 1], X[i, 2]
                X[i, 0] = a * (c + v * x * x) + b * (v * x * y + s * z) + d * (v * x * z - s * y)
                X[i, 1] = a * (v * x * y - s * z) + b * (c + v * y * y) + d * (v * y * z + s * x)
                X[i, 2] = a * (v * x * z + s * y) + b * (v * y * z - s * x) + d * (c + v * z * z)
        R, p = chain.rotations[k + 1], chain.offsets[k + 1]
        for i in range(3):
            a, b, d = X[i, 0], X[i, 1], X[i, 2]
            X[i, 3] += a * p[0] + b * p[1] + d * p[2]
            for j in range(3):
                Y[i, j] = a * R[0, j] + b * R[1, j] + d * R[2, j]
        X[:, :3] = Y[:, :3]
    for v in range(len(side.vertices)):
        p = side.vertices[v]
        for i in range(3):
            points[v, i] = X[i, 0] * p[0] + X[i, 1] * p[1] + X[i, 2] * p[2] + X[i, 3]


@njit(cache=True)
def acceleration(side: Side, levers: Array, rates: Array, changes: Array) -> float:
    """Returns a bound of every vertex' acceleration, in metres, for bounds of the joints' rates and of the rates' changes, (n,)."""
    chain, turning, total = side.chain, 0.0, 0.0
    for k in range(len(chain.joints)):
        rate = rates[chain.joints[k]]
        if chain.slides[k]:
            total += 2.0 * turning * rate + changes[chain.joints[k]]
        else:
            total += levers[k] * (rate * (rate + 2.0 * turning) + changes[chain.joints[k]])
            turning += rate
    return total


@njit(cache=True)
def moved(side: Side, levers: Array, rates: Array) -> float:
    """Returns how far joints that move by this much, (n,), move a vertex at most."""
    total = 0.0
    for k in range(len(side.chain.joints)):
        total += levers[k] * rates[side.chain.joints[k]]
    return total


@njit(cache=True)
def positions(coordinates: Array, turns: Array, q_star: Array, q: Array) -> None:
    """Fills in the joint positions that coordinates, (n,), stand for.

    Args:
        turns: (n,) whether the coordinate is the tangent of half an angle from q*.
        q_star: (n,) 0 for a motion in q.
    """
    for i in range(len(q)):
        q[i] = q_star[i] + (2.0 * np.arctan(coordinates[i]) if turns[i] else coordinates[i])


@njit(cache=True)
def evaluate(controls: Array, time: float, at: Array) -> None:
    """Fills in the coordinates, their rates and the rates' changes, (3, n), at a time of a piece, (m + 1, n). Source: de Casteljau."""
    m, steps = len(controls) - 1, np.empty(len(controls))
    for i in range(controls.shape[1]):
        at[2, i] = 0.0
        for k in range(m + 1):
            steps[k] = controls[k, i]
        for left in range(m, 0, -1):
            if left == 2:
                at[2, i] = m * (m - 1) * ((steps[2] - steps[1]) - (steps[1] - steps[0]))
            elif left == 1:
                at[1, i] = m * (steps[1] - steps[0])
            for k in range(left):
                steps[k] += time * (steps[k + 1] - steps[k])
        at[0, i] = steps[0]


@njit(cache=True)
def bound_rates(
    here: Array, there: Array, hull: Array, width: float, inexact: tuple[float, float], turns: Array, rates: Array, changes: Array
) -> None:
    """Fills in bounds of |dq/dt| and |d2q/dt2| in an interval of a piece; for tangents of half angles, q = q* + 2 atan(x).

    Args:
        here, there: (3, n) as :func:`evaluate` fills them in, at both ends of the interval.
        hull: (4, n) bounds of the first four derivatives on the whole piece.
        inexact: what the verifier adds to rates and to changes for what they may be wrong by.
    """
    bulge = width * width / 8.0
    for i in range(len(rates)):
        rate = min(hull[0, i], max(abs(here[1, i]), abs(there[1, i])) + bulge * hull[2, i] + inexact[0])
        change = min(hull[1, i], max(abs(here[2, i]), abs(there[2, i])) + bulge * hull[3, i] + inexact[1])
        rates[i], changes[i] = rate, change
        if turns[i]:
            x0, x1, off = here[0, i], there[0, i], bulge * change
            least = 0.0 if x0 * x1 <= 0.0 else max(0.0, min(abs(x0), abs(x1)) - off)
            norm = 1.0 + least * least
            rates[i] = 2.0 * rate / norm
            changes[i] = 2.0 * change / norm + 4.0 * rate * rate * (max(abs(x0), abs(x1)) + off) / (norm * norm)


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
def clearance(a: Side, b: Side, q: Array) -> float:
    """Returns the distance of two bodies without their radii at positions q, in metres; 0 or less where they meet."""
    A, B, X, Y = np.empty((len(a.vertices), 3)), np.empty((len(b.vertices), 3)), np.empty((3, 4)), np.empty((3, 4))
    place(a, q, X, Y, A)
    place(b, q, X, Y, B)
    return separation(A, B, np.empty(3))


@njit(cache=True)
def divide(
    a: Side,
    b: Side,
    controls: Array,
    hulls: Array,
    inexact: tuple[float, float],
    turns: Array,
    q_star: Array,
    reach: float,
    slack: float,
    rho: float,
    shrinks: bool,
    until: tuple[int, float],
    ends: Array,
    normals: Array,
    counts: Array,
) -> tuple[int, int, float, float, float, float]:
    """Divides the motion into intervals with a plane each, from its beginning on, until it ends or the pair touches.

    Args:
        controls: (P, m + 1, n) control points of the pieces.
        hulls: (P, 4, n) bounds of the first four derivatives of the coordinates on every piece.
        inexact: as for :func:`bound_rates`.
        turns, q_star: as for :func:`positions`.
        reach: the radii and paddings of both bodies, and the distance that they have to keep beyond these, metres.
        slack: metres that the planes have to leave for what the verifier rounds.
        rho: the tube, radians or metres.
        shrinks: whether the tube becomes smaller where it has to.
        until: the number of the piece and the time in it at which the search ends.
        ends, normals: (I,), (I, 3); they are filled in.
        counts: (P,) is filled in.

    Returns:
        how it ends; the piece where it does; the beginning and the end of the interval there; how far the bodies are apart beyond
        ``reach`` at its beginning or, for a contact, where they touch; and rho at the end.
    """
    n, V, W = controls.shape[2], len(a.vertices), len(b.vertices)
    # The vertices of the interval's beginning come first, then those of its end.
    A, B, X, Y = np.empty((2 * V, 3)), np.empty((2 * W, 3)), np.empty((3, 4)), np.empty((3, 4))
    q, rates, changes, normal, other, stack = np.empty(n), np.empty(n), np.empty(n), np.zeros(3), np.empty(3), np.empty(64)
    here, there = np.empty((3, n)), np.empty((3, n))
    found = 0
    for piece in range(len(controls)):
        t0, top = 0.0, 1
        stack[0] = 1.0
        widening = 0.0
        for k in range(len(a.chain.joints)):
            widening += a.levers[piece, k]
        for k in range(len(b.chain.joints)):
            widening += b.levers[piece, k]
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
            need = reach + slack + (t1 - t0) ** 2 / 8.0 * bent
            apart = gap_along(normal, A, B) > need + rho * widening
            if not apart:
                gap = separation(A, B, normal)
                if gap <= need + rho * widening and shrinks:
                    for known in (separation(A[:V], B[:W], other) - reach, separation(A[V:], B[W:], other) - reach):
                        if known > RESOLUTION and widening > 0.0:
                            rho = min(rho, SHRINK * known / widening)
                apart = gap > need + rho * widening
            if apart:
                if found == len(ends):
                    return MANY, piece, t0, t1, separation(A[:V], B[:W], other) - reach, rho
                ends[found], normals[found] = t1, normal
                found += 1
                counts[piece] += 1
                if piece == until[0] and t1 >= until[1]:
                    return DONE, piece, t0, t1, 0.0, rho
                A[:V] = A[V:]
                B[:W] = B[W:]
                here[:] = there
                t0, top = t1, top - 1
                continue
            reached = moved(a, a.levers[piece], rates) + moved(b, b.levers[piece], rates)
            narrow = t1 - t0 <= NARROWEST
            if narrow or (t1 - t0) * reached <= RESOLUTION:
                now, then = separation(A[:V], B[:W], other) - reach, separation(A[V:], B[W:], other) - reach
                if now <= RESOLUTION:
                    return CONTACT, piece, t0, t0, now, rho
                if then <= RESOLUTION:
                    return CONTACT, piece, t0, t1, then, rho
                if narrow:
                    return NARROW, piece, t0, t1, now, rho
            stack[top] = (t0 + t1) / 2.0
            top += 1
    return DONE, len(controls) - 1, 1.0, 1.0, 0.0, rho
