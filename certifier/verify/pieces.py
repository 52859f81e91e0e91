"""The polynomial pieces of a motion are evaluated here in doubles, and their derivatives bounded, with what rounding does.

De Casteljau's algorithm evaluates a piece, a polynomial of degree m whose control points are at most M in magnitude. With u = 2^-53, a step
from a to b, a + t (b - a), is wrong by less than 8 u M: b - a is at most 2 M and is rounded, so is its product with t, and so is the sum,
which makes 5 u M and terms of higher order. What was wrong in a and b is averaged. So after m steps a coordinate is wrong by less than 8 m
u M, and what is a tangent's counts twice in its angle.

A k-th derivative is k + 1 of the values before the last k steps, differenced k times and multiplied by m (m - 1) ... (m - k + 1).

- For k of 1, both values are wrong by 8 (m - 1) u M, and their difference is rounded by 2 u M and multiplied: m (16 (m - 1) + 4) u M.
- For k of 2, two such differences, each wrong by (16 (m - 2) + 2) u M, are subtracted, rounded by 4 u M, and multiplied in two roundings of
  8 u M together: m (m - 1) (32 (m - 2) + 16) u M.

Both are less than 2^5 u m (m - 1)^k M where m is 2 or more. Where m is 1, the first derivative is one difference of two doubles, which is
wrong by a part of itself, 2 u, and the second one is 0.

The same differences of the control points, whose hull bounds a derivative, are rounded once for every difference and every product. By the
same count they are wrong by at most 16, 48 and 128 times u m (m - 1)^(k - 1) M for k of 2 to 4, less than 2^8 u m (m - 1)^(k - 1) M.
Underflow does not matter: a difference of doubles is exact where it would, and the products with integers are not less.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from certifier.model import Array, Scene
from certifier.proof.motion import Motion, Space
from certifier.verify.angles import cosines_and_sines
from certifier.verify.chains import UP


class Pieces:
    """Evaluates a motion at times of its P pieces.

    Attributes:
        inexact: by how much the position of a joint is wrong at most where it is computed, in radians or metres.
        slid: (P, n) how far each joint's position is from 0 at most on a piece and in the tube about it, rounded upwards.
    """

    def __init__(self, scene: Scene, motion: Motion, rho: float) -> None:
        self._scene, self._motion = scene, motion
        self._turns = scene.revolute & (motion.space is Space.S)
        self._base = scene.q_star if motion.space is Space.S else np.zeros(scene.n)
        self._bezier = np.moveaxis(motion.bezier, 1, 0)
        self._degree = degree = motion.degree
        largest, base = float(np.abs(motion.controls).max()), float(np.abs(self._base).max(initial=0.0))
        # 2^-49 m M is what a coordinate of a tangent is wrong by, twice; 2^-49 of the sum is more than what adding q* to a slide rounds.
        self.inexact = 2.0**-49 * (degree + 1) * (largest + base)
        self._wrong = [2.0**-45 * degree * (degree - 1) ** k * largest for k in range(1, 4)]
        farthest = replace(motion, controls=np.abs(motion.controls + self._base)).bezier.max(axis=1)
        self.slid = (farthest * UP + self.inexact + rho) * UP
        self._hulls = self._bounds()

    def positions(self, piece: np.ndarray, time: Array) -> tuple[Array, Array, Array]:
        """Returns the joints' positions at times of pieces, (T, n), and their cosines and sines; in s, those of revolute joints as s.

        Besides what the coordinate itself is wrong by, they are wrong by less than 2^-47. In q, they are those of doubles, wrong by 2^-49.
        In s, with a tangent x, (1 - x^2)/(1 + x^2) and 2 x/(1 + x^2) are wrong by less than 5 u: 1 - x^2 by (x^2 + 1) u, and each other
        step by a part. Those of q* are wrong by 2^-49. So the sums of two products are wrong by less than 2 (2^-49 + 5 u) + 3 u.
        """
        x, _, _ = self.at(piece, time)
        if self._motion.space is Space.Q:
            cosines, sines = cosines_and_sines(np.where(self._scene.revolute, x, 0.0))
        else:
            c, s = cosines_and_sines(self._base)
            square = x * x
            cosine, sine = (1.0 - square) / (1.0 + square), 2.0 * x / (1.0 + square)
            cosines, sines = c * cosine - s * sine, s * cosine + c * sine
        return x + self._base, cosines, sines

    def at(self, piece: np.ndarray, time: Array) -> tuple[Array, Array, Array]:
        """Returns the coordinates, their rates and the rates' changes at times of pieces, (N, n) each."""
        m, points = self._degree, self._bezier[:, piece]
        rates = changes = np.zeros(points.shape[1:])
        while len(points) > 1:
            steps = points[1:] - points[:-1]
            if len(steps) == 2:
                changes = m * (m - 1) * (steps[1] - steps[0])
            rates = m * steps[0]
            points = points[:-1] + time[:, None] * steps
        return points[0], rates, changes

    def _bounds(self) -> list[Array]:
        """Returns bounds of the first four derivatives of the coordinates on every piece, (P, n) each, from their control points."""
        m, steps, bounds = self._degree, self._bezier, []
        for k in range(4):
            steps = (m - k) * (steps[1:] - steps[:-1])
            wrong = self._wrong[k - 1] if k else 0.0
            bounds.append(np.abs(steps).max(axis=0) + wrong if len(steps) else np.broadcast_to(0.0, steps.shape[1:]))
        return bounds

    def rates(self, piece: np.ndarray, t0: Array, t1: Array) -> tuple[Array, Array]:
        """Returns bounds of |dq/dt| and |d2q/dt2| in intervals of pieces, (I, n) each, rounded upwards.

        A function is at most what it is at the ends of an interval and h^2/8 of its second derivative's bound. For a tangent of half an
        angle, q = q* + 2 atan(x), the bounds are 2 |x'|/(1 + x^2) and 2 |x''|/(1 + x^2) + 4 |x'|^2 |x|/(1 + x^2)^2.
        """
        (x0, rate0, change0), (x1, rate1, change1) = self.at(piece, t0), self.at(piece, t1)
        first, second, third, fourth = (bound[piece] for bound in self._hulls)
        bulge = ((t1 - t0) ** 2 / 8)[:, None]
        rates = np.minimum(first, np.maximum(np.abs(rate0), np.abs(rate1)) + bulge * third + self._wrong[0])
        changes = np.minimum(second, np.maximum(np.abs(change0), np.abs(change1)) + bulge * fourth + self._wrong[1])
        if self._motion.space is Space.Q:
            return rates * UP, changes * UP
        off = self.inexact + bulge * changes * UP
        least = np.where(x0 * x1 > 0, np.minimum(np.abs(x0), np.abs(x1)) - off, 0.0).clip(0.0)
        most = np.maximum(np.abs(x0), np.abs(x1)) + off
        norm = 1 + least**2
        turning, bending = 2 * rates / norm, 2 * changes / norm + 4 * rates**2 * most / norm**2
        return np.where(self._turns, turning, rates) * UP, np.where(self._turns, bending, changes) * UP
