"""A motion as arrays for the compiled loops of this room: its coordinates, bounds of the joints' rates, and where the links are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.model import Array, Scene
from certifier.motion.bodies import Bodies, place_links
from certifier.proof.motion import Motion, Space

INEXACT = 2.0**-44
"""Bounds of a polynomial's derivatives leave this part of its control points, more for higher degrees, for what the verifier rounds."""
FINEST, ROOM = 1 << 6, 1 << 24
"""The links' poses are kept for at most this many equal steps of each piece, and in at most about this many bytes."""


class Curve(NamedTuple):
    """Holds a motion of P pieces of degree m.

    Attributes:
        controls: (P, m + 1, n) control points of the pieces.
        hulls: (P, 4, n) bounds of the first four derivatives of the coordinates on every piece.
        inexact: what the verifier adds to rates and to changes for what they may be wrong by.
        turns: (n,) whether the coordinate is the tangent of half an angle from q*.
        q_star: (n,) 0 for a motion in q.
    """

    controls: Array
    hulls: Array
    inexact: tuple[float, float]
    turns: np.ndarray
    q_star: Array


class Poses(NamedTuple):
    """Keeps the links' poses at times of a motion that were asked about before.

    Attributes:
        R, p: (K + 1, L, 3, 3) and (K + 1, L, 3). The last ones are those that were asked about last, where they are not kept.
        known: (K,) whether they are filled in.
    """

    R: Array
    p: Array
    known: np.ndarray


def curve_of(scene: Scene, motion: Motion) -> Curve:
    """Returns the arrays of a motion."""
    in_s = motion.space is Space.S
    controls = np.array(motion.bezier, order="C")  # a copy: arrays that are read-only would have all compiled again
    largest = float(np.abs(motion.controls).max())
    inexact = [INEXACT * motion.degree * (motion.degree - 1) ** k * largest for k in (1, 2, 3)]
    steps, hulls = controls, []
    for k in range(4):
        steps = (motion.degree - k) * np.diff(steps, axis=1)
        hulls.append(np.abs(steps).max(axis=1, initial=0.0) + (inexact[k - 1] if k else 0.0))  # as much larger as the verifier's
    q_star = scene.q_star if in_s else np.zeros(scene.n)
    return Curve(controls, np.ascontiguousarray(np.stack(hulls, axis=1)), (inexact[0], inexact[1]), scene.revolute & in_s, q_star)


def poses_of(bodies: Bodies, curve: Curve) -> Poses:
    """Returns room for the links' poses, none of which is filled in."""
    links, pieces = len(bodies.parents), len(curve.controls)
    steps = FINEST
    while steps and pieces * (steps + 1) * links * 12 * 8 > ROOM:
        steps //= 2
    kept = pieces * (steps + 1) if steps else 0
    return Poses(np.empty((kept + 1, links, 3, 3)), np.empty((kept + 1, links, 3)), np.zeros(kept, dtype=np.bool_))


@njit(cache=True)
def pose(bodies: Bodies, curve: Curve, poses: Poses, piece: int, time: float, coordinates: Array, q: Array) -> int:
    """Returns under which number ``poses`` has those at a time of a piece, until the next call. It fills in q, (n,).

    Args:
        coordinates: (n,) of the motion at this time.
    """
    kept = len(poses.known)
    steps = kept // len(curve.controls) - 1
    slot = kept
    if kept and time * steps == np.floor(time * steps):
        slot = piece * (steps + 1) + int(time * steps)
        if poses.known[slot]:
            return slot
        poses.known[slot] = True
    positions(coordinates, curve.turns, curve.q_star, q)
    place_links(bodies, q, poses.R[slot], poses.p[slot])
    return slot


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
def bound_rates(curve: Curve, piece: int, here: Array, there: Array, width: float, rates: Array, changes: Array) -> None:
    """Fills in bounds of |dq/dt| and |d2q/dt2| in an interval of a piece; for tangents of half angles, q = q* + 2 atan(x).

    Args:
        here, there: (3, n) as :func:`evaluate` fills them in, at both ends of the interval.
    """
    bulge, hull, inexact = width * width / 8.0, curve.hulls[piece], curve.inexact
    for i in range(len(rates)):
        rate = min(hull[0, i], max(abs(here[1, i]), abs(there[1, i])) + bulge * hull[2, i] + inexact[0])
        change = min(hull[1, i], max(abs(here[2, i]), abs(there[2, i])) + bulge * hull[3, i] + inexact[1])
        rates[i], changes[i] = rate, change
        if curve.turns[i]:
            x0, x1, off = here[0, i], there[0, i], bulge * change
            least = 0.0 if x0 * x1 <= 0.0 else max(0.0, min(abs(x0), abs(x1)) - off)
            norm = 1.0 + least * least
            rates[i] = 2.0 * rate / norm
            changes[i] = 2.0 * change / norm + 4.0 * rate * rate * (max(abs(x0), abs(x1)) + off) / (norm * norm)
