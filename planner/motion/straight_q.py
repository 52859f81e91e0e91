"""A motion that is straight in q is curved in s, and is proved to be in regions piece by piece.

In a window of less than one turn, every s_i(t) = tan((q_i(t) - q*_i)/2) rises or falls all the way. On a piece of width w, a function
is no more than the larger of its values at the ends, plus w²/8 times the largest size of its second derivative. For the left side of
a face, c's(t), that size is at most sum |c_i| |s_i''|, and |s_i''| = 2 v_i² |s_i| (1 + s_i²) with v_i = (q_i' / 2) is largest at
an end of the piece. So a face holds on all of a piece if

    max(c's(t0), c's(t1)) + w²/8 sum |c_i| max |s_i''| + rounding <= d.

Ball arithmetic bounds s at the ends, and a bound on its rounding is added to the rest.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from flint import arb, fmpq
from numpy.typing import NDArray

from certifier.model import Array, Scene
from planner.library import Library
from planner.membership import in_boxes

FINEST = 2.0**-40
"""No piece is tried that is shorter than this, in t."""
_EPS = np.finfo(float).eps
_UP = 1 + 1e-9
"""Bounds are multiplied by this, which is more than their own rounding takes away."""


class StraightInQ:
    """The line q(t) = a + t (b - a), 0 <= t <= 1, taken literally for the doubles a and b, (n,), radians or metres.

    Args:
        held: number of a region that may contain all of the line, and is tried first; None for none.
    """

    def __init__(self, library: Library, scene: Scene, a: Array, b: Array, held: int | None = None) -> None:
        self._library, self._revolute = library, scene.revolute
        self._held = np.array([] if held is None else [held], dtype=np.intp)
        self._a, self._b, self._q_star = a.tolist(), b.tolist(), scene.q_star.tolist()
        self._half_speed = np.abs(b - a) / 2 * _UP
        self._last = _within_limits(scene, a, b)
        self._s = cache(self._evaluated)

    def furthest(self, t: float) -> tuple[int, float] | None:
        """Returns a region that is proved to contain the line from t to about as far as any, and the parameter where the proof ends.

        Pieces are tried one after the other, longer ones after a success and shorter ones after a failure. The regions go on that contain
        all pieces so far. None where no region is proved to contain the point at t.
        """
        if self._last is None:
            return None
        begin = float(t)
        if self._contain(self._held, begin, 1.0).any() and self._last == 1.0:
            return int(self._held[0]), 1.0
        _, near = in_boxes(self._library, self._s(begin)[0][None])
        regions = near[self._contain(near, begin, begin)]
        if not len(regions):
            return None
        width = self._last - begin
        while begin < self._last and width >= FINEST:
            end = min(begin + width, self._last)
            still = self._contain(regions, begin, end)
            if still.any():
                regions, begin, width = regions[still], end, 2 * width
            else:
                width /= 2
        return int(regions[0]), begin

    def _contain(self, regions: NDArray[np.intp], begin: float, end: float) -> NDArray[np.bool_]:
        """Returns which of the regions, (r,), are proved to contain the line from begin to end."""
        if not len(regions):
            return np.zeros(0, dtype=bool)
        counts = self._library.first[regions + 1] - self._library.first[regions]
        offsets = np.concatenate([[0], np.cumsum(counts)[:-1]])
        faces = self._library.faces[np.repeat(self._library.first[regions] - offsets, counts) + np.arange(counts.sum())]
        C, d = faces[:, :-1], faces[:, -1]
        (at_begin, radius), (at_end, other) = self._s(begin), self._s(end)
        size = np.maximum(np.abs(at_begin), np.abs(at_end)) + np.maximum(radius, other)
        bend = np.where(self._revolute, 2 * self._half_speed**2 * size * (1 + size**2), 0.0)
        spread = np.maximum(radius, other) + ((end - begin) * _UP) ** 2 / 8 * bend + 4 * (len(size) + 2) * _EPS * size
        absolute = np.abs(C)
        most = np.maximum(C @ at_begin, C @ at_end) + absolute @ (spread * _UP) + 4 * _EPS * np.abs(d)
        return np.logical_and.reduceat(most <= d, offsets)

    def _evaluated(self, t: float) -> tuple[Array, Array]:
        """Returns s at t, (n,), and a bound on how far it is off, (n,)."""
        balls = []
        for a, b, q_star, turns in zip(self._a, self._b, self._q_star, self._revolute.tolist(), strict=True):
            way = arb(a) + (arb(b) - arb(a)) * arb(t) - arb(q_star)
            balls.append((way / 2).tan() if turns else way)
        mid = np.array([float(ball.mid()) for ball in balls])
        radius = np.array([float(ball.rad()) for ball in balls])
        return mid, (radius + 4 * _EPS * np.abs(mid)) * _UP


_TURN = tuple(2 * fmpq(numerator, 10**30) for numerator in (3141592653589793238462643383279, 3141592653589793238462643383280))
"""Two pi lies between these."""


def _within_limits(scene: Scene, a: Array, b: Array) -> float | None:
    """Returns the parameter to which every joint stays within its limits, and in the window where it begins; None if one begins outside.

    A joint that turns a whole turn and more may begin in another turn than its window, and stays in that one.
    """
    turns = np.round((a - scene.in_windows(a)) / (2 * np.pi)).astype(int).tolist()
    own_lower, own_upper = scene.own_limits
    last = fmpq(1)
    for i, turn in enumerate(turns):
        begin, end = (fmpq(*float(q[i]).as_integer_ratio()) for q in (a, b))
        shift = sorted(turn * bound for bound in _TURN)
        limits = [
            (-1, scene.q_lower[i], -shift[1]),
            (1, scene.q_upper[i], shift[0]),
            (-1, own_lower[i], fmpq(0)),
            (1, own_upper[i], fmpq(0)),
        ]
        for sign, limit, moved in limits:
            if not np.isfinite(limit):
                continue
            room = sign * fmpq(*float(limit).as_integer_ratio()) + moved - sign * begin
            if room < 0:
                return None
            way = sign * (end - begin)
            if way > room:
                last = min(last, room / way)
    return 1.0 if last == 1 else max(0.0, float(np.nextafter(float(last), 0.0)))
