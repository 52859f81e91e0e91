"""A motion that is curved in s is proved to be in regions piece by piece.

It is a polynomial in s, or one in q, to which s_i(t) = tan((q_i(t) - q*_i)/2) belongs; one that is straight in q is of degree 1. On a piece
of width w, a function is no more than the larger of its values at the ends, plus w²/8 times the largest size of its second derivative. For
the left side of a face, c's(t), that size is at most sum |c_i| |s_i''|. So a face holds on all of a piece if

    max(c's(t0), c's(t1)) + w²/8 sum |c_i| max |s_i''| + rounding <= d.

Of a polynomial in q, |s_i''| <= (2 v_i² |s_i| + |q_i''|/2) (1 + s_i²) with v_i = |q_i'|/2, and |s_i| is largest at an end of the piece, or
at most where an angle w²/8 max |q_i''| beyond it leads. The control points of derivatives on the piece bound q_i', q_i'' and the second
derivative of a polynomial in s. Ball arithmetic bounds s at the ends, and a bound on its rounding is added to the rest.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from flint import arb
from numpy.typing import NDArray

from certifier.model import Array, Scene
from planner.library import Library
from planner.membership import in_boxes
from planner.motion.space import Space

FINEST = 2.0**-40
"""No piece is tried that is shorter than this, in t."""
_HALF_TURN = 3.1415
"""Angles up to this one, from q*, have a tangent of half of them, and so have those that they are rounded to."""
_EPS, _LEAST = float(np.finfo(float).eps), float(np.finfo(float).tiny)
_UP = 1 + 1e-9
"""Bounds are multiplied by this, which is more than their own rounding takes away."""


def at(controls: Array, t: float | arb) -> Array:
    """Returns the polynomial with control points (m + 1, n) at t, (n,), in numbers of their kind. Source: de Casteljau."""
    while len(controls) > 1:
        controls = controls[:-1] + (controls[1:] - controls[:-1]) * t
    return np.asarray(controls[0])


class _Point(NamedTuple):
    """A point of a curve: s and what the curve is itself, q or s, rounded, with bounds on how far they are off, (n,) each."""

    s: Array
    off: Array
    q: Array
    q_off: Array


class Curve:
    """The polynomial with control points (m + 1, n), 0 <= t <= 1, taken literally for these doubles: s, or q in radians or metres.

    In q, a joint that turns a whole turn and more may begin in another turn than its window, and stays in that one.

    Args:
        held: number of a region that may contain all of the curve, and is tried first; None for none.
    """

    def __init__(self, library: Library, scene: Scene, space: Space, controls: Array, held: int | None = None) -> None:
        in_q = space is Space.Q
        self._held = np.array([] if held is None else [held], dtype=np.intp)
        self._library, self._tangent = library, scene.revolute & in_q
        self._base = scene.q_star if in_q else np.zeros(scene.n)
        self._exact = np.array([[arb(x) for x in row] for row in controls.tolist()])
        self._lower, self._upper = scene.own_limits if in_q else (np.full(scene.n, -np.inf), np.full(scene.n, np.inf))
        self._kept = ((self._lower <= controls) & (controls <= self._upper)).all(axis=0)
        self._turned = controls[0] - scene.in_windows(controls[0]) if in_q else np.zeros(scene.n)
        m, steps = len(controls) - 1, np.diff(controls, axis=0)
        self._rates, self._changes = m * steps, m * (m - 1) * np.diff(steps, axis=0)
        self._inexact = 32 * m * (m - 1) * _EPS * np.abs(controls).max(axis=0)
        self._at = cache(self._evaluated)

    def furthest(self, t: float) -> tuple[int, float] | None:
        """Returns a region that is proved to contain the curve from t to about as far as any, and the parameter where the proof ends.

        Pieces are tried one after the other, longer ones after a success and shorter ones after a failure. The regions go on that contain
        all pieces so far. None where no region is proved to contain the point at t.
        """
        begin = float(t)
        if self._contain(self._held, begin, 1.0).any():
            return int(self._held[0]), 1.0
        _, near = in_boxes(self._library, self._at(begin).s[None])
        regions = near[self._contain(near, begin, begin)]
        if not len(regions):
            return None
        width = 1.0 - begin
        while begin < 1.0 and width >= FINEST:
            end = min(begin + width, 1.0)
            still = self._contain(regions, begin, end)
            if still.any():
                regions, begin, width = regions[still], end, 2 * width
            else:
                width /= 2
        return int(regions[0]), begin

    def _contain(self, regions: NDArray[np.intp], begin: float, end: float) -> NDArray[np.bool_]:
        """Returns which of the regions, (r,), are proved to contain the curve from begin to end."""
        bend = self._bend(begin, end)
        if bend is None or not len(regions):
            return np.zeros(len(regions), dtype=bool)
        counts = self._library.first[regions + 1] - self._library.first[regions]
        offsets = np.concatenate([[0], np.cumsum(counts)[:-1]])
        faces = self._library.faces[np.repeat(self._library.first[regions] - offsets, counts) + np.arange(counts.sum())]
        C, d = faces[:, :-1], faces[:, -1]
        one, other = self._at(begin), self._at(end)
        off, size = np.maximum(one.off, other.off), _size(one, other)
        spread = off + _eighth(begin, end) * bend + 4 * (len(size) + 2) * _EPS * size
        absolute = np.abs(C)
        most = np.maximum(C @ one.s, C @ other.s) + absolute @ (spread * _UP) + 4 * _EPS * np.abs(d)
        return np.logical_and.reduceat(most <= d, offsets)

    def _bend(self, begin: float, end: float) -> Array | None:
        """Returns bounds of |s''| from begin to end, (n,); None where a joint is not proved to keep its own limits and its turn."""
        one, other = self._at(begin), self._at(end)
        half_rate = _largest(self._rates, begin, end) / 2 * _UP
        change = (_largest(self._changes, begin, end) + self._inexact) * _UP
        beyond = _eighth(begin, end) * change * _UP
        off = beyond + np.maximum(one.q_off, other.q_off)
        within = (self._lower <= np.minimum(one.q, other.q) - off) & (np.maximum(one.q, other.q) + off <= self._upper)
        center = self._base + self._turned
        angle = np.maximum(np.abs(one.q - center), np.abs(other.q - center)) + off
        size, half = _size(one, other), np.where(self._tangent, np.minimum(beyond / 2, 1.0), 0.0)
        more = half / (1 - half**2 / 2)  # at least the tangent, as sin x <= x and cos x >= 1 - x²/2
        turns = (angle <= _HALF_TURN) & (half < 1) & (size * more < 0.5)
        if not ((within | self._kept) & (turns | ~self._tangent)).all():
            return None
        size = (size + more) / (1 - size * more)
        return np.where(self._tangent, (2 * half_rate**2 * size + change / 2) * (1 + size**2), change)

    def _evaluated(self, t: float) -> _Point:
        point = at(self._exact, arb(t)).tolist()
        ways = [ball - arb(base) for ball, base in zip(point, self._base.tolist(), strict=True)]
        balls = [(way / 2).tan() if tangent else way for way, tangent in zip(ways, self._tangent.tolist(), strict=True)]
        return _Point(*_rounded(balls, 4), *_rounded(point, 16))


def _rounded(balls: list[arb], roundings: int) -> tuple[Array, Array]:
    """Returns the midpoints of balls, (n,), and bounds on how far these are off, with room for ``roundings`` more roundings."""
    mid = np.array([float(ball.mid()) for ball in balls])
    return mid, (np.array([float(ball.rad()) for ball in balls]) + roundings * _EPS * np.abs(mid)) * _UP


def _size(one: _Point, other: _Point) -> Array:
    """Returns bounds of |s| at two points, (n,)."""
    return np.maximum(np.abs(one.s), np.abs(other.s)) + np.maximum(one.off, other.off)


def _largest(controls: Array, begin: float, end: float) -> Array:
    """Returns bounds of a polynomial's size from begin to end, (n,), by its control points (k, n) there; 0 where it has none.

    It is divided at begin, and what is behind that at end, by de Casteljau's algorithm. In units of the degree times eps times the largest
    control point, what the two divisions round is below 8, and what the places round at which it is divided moves its values by below 6.
    """
    wrong = 32 * max(0, len(controls) - 1) * _EPS * np.abs(controls).max(axis=0, initial=0.0)
    if len(controls) > 1:
        controls = _divided(controls[::-1], 1.0 - begin)[::-1]
        controls = _divided(controls, (end - begin) / max(1.0 - begin, _LEAST))
    return np.abs(controls).max(axis=0, initial=0.0) + wrong


def _divided(controls: Array, t: float) -> Array:
    """Returns the control points, (k, n), of a polynomial's part from 0 to t."""
    first = [controls[0]]
    while len(controls) > 1:
        controls = controls[:-1] + (controls[1:] - controls[:-1]) * t
        first.append(controls[0])
    return np.array(first)


def _eighth(begin: float, end: float) -> float:
    return ((end - begin) * _UP) ** 2 / 8
