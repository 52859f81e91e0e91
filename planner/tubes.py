"""Tubes about proved motions: sets of configurations that are free of collision, because a proof says so.

The tube about a straight line in q from c to e holds every q with |q_i - c_i - t (e_i - c_i)| <= rho for all joints i, at one time t from
0 to 1. It is convex. So a straight motion in q lies in it from u0 to u1 where its points at u0 and at u1 do. The times at which it does
follow from linear inequalities; then both points are checked, with room for what doubles round.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array

_ROUNDED = 1e-14
"""What a few operations round is a smaller part of the largest number in them."""
_INSIDE = 1e-12
"""The times at which a motion enters and leaves a tube, from 0 to 1, are moved inside by this, and the tube is this part narrower."""


@dataclass(frozen=True, eq=False)
class Tube:
    """A proved motion: straight in q between configurations path (k, n), with a tube of half the width rho, in radians or metres."""

    id: str
    path: Array
    rho: float


class Tubes:
    """Holds the tubes of M straight lines, as far as they are within the joint limits. It never changes.

    Args:
        limits: the lower and the upper limits of the joints, (n,) each, radians or metres. A proof about a tube goes beyond them.

    Attributes:
        motions: the tubes that were given.
        motion: (M,) number of the tube that each line belongs to.
        place: (M,) number of the line within its tube's path.
    """

    def __init__(self, limits: tuple[Array, Array], motions: Sequence[Tube]) -> None:
        n = len(limits[0])
        self._limits, self.motions = limits, tuple(motions)
        counts = [len(tube.path) - 1 for tube in motions]
        self.motion = np.repeat(np.arange(len(motions)), counts)
        self.place = np.concatenate([np.zeros(0, dtype=np.intp), *(np.arange(count) for count in counts)])
        self._begin = np.concatenate([np.zeros((0, n)), *(tube.path[:-1] for tube in motions)])
        self._end = np.concatenate([np.zeros((0, n)), *(tube.path[1:] for tube in motions)])
        self._rho = np.repeat([tube.rho for tube in motions], counts)[:, None]
        self._lower, self._upper = np.minimum(self._begin, self._end) - self._rho, np.maximum(self._begin, self._end) + self._rho

    def __len__(self) -> int:
        return len(self.motions)

    def at(self, q: Array) -> tuple[NDArray[np.intp], Array]:
        """Returns the lines in whose tubes q, (n,), is proved to be, (h,), and the times on them, (h,) from 0 to 1."""
        lines = self._near(q, q)
        if not self._permits(q):
            lines = lines[:0]
        inside, times = _within(self._begin[lines], self._end[lines], self._rho[lines], q[None, None])
        return lines[inside[0]], times[0, inside[0]]

    def spans(self, a: Array, b: Array) -> tuple[NDArray[np.intp], Array]:
        """Returns in the tubes of which lines the straight motion in q from a to b, (n,) each, is proved to be for a while.

        Returns:
            The lines, (h,), and from when to when, (h, 2), from 0 to 1.
        """
        lines = self._near(a, b)
        if not (self._permits(a) and self._permits(b)):
            lines = lines[:0]
        inside, spans = self._spans(lines, a, b)
        return lines[inside], spans[inside]

    def _near(self, a: Array, b: Array) -> NDArray[np.intp]:
        """Returns the lines whose boxes meet the box of the motion from a to b, (h,)."""
        lower, upper = np.minimum(a, b), np.maximum(a, b)
        return np.flatnonzero(((self._lower <= upper) & (lower <= self._upper)).all(axis=1))

    def _permits(self, q: Array) -> bool:
        """Says whether q, (n,), is within the joint limits."""
        return bool(((self._limits[0] <= q) & (q <= self._limits[1])).all())

    def _spans(self, lines: NDArray[np.intp], a: Array, b: Array) -> tuple[NDArray[np.bool_], Array]:
        """Returns whether the motion is in the tubes for a while, (h,), and from when to when, (h, 2)."""
        if not len(lines):
            return np.zeros(0, dtype=bool), np.zeros((0, 2))
        begin, end, rho = self._begin[lines], self._end[lines], self._rho[lines]
        here, step, way = a - begin, np.broadcast_to(b - a, begin.shape), end - begin
        tight = rho * (1 - _INSIDE) - 4 * _ROUNDED * (np.abs(a) + np.abs(b) + np.abs(begin) + np.abs(end))  # the check at the end passes
        moves = way != 0
        # At the time u of the motion, the line's time t is at least low + u rate and at most high + u rate, for every joint that it moves.
        pace = np.where(moves, way, 1.0)
        sides = (here - tight) / pace, (here + tight) / pace
        bound = [(np.minimum(*sides), -np.inf, 0.0), (np.maximum(*sides), np.inf, 1.0)]
        low, high = (np.column_stack([np.where(moves, side, none), np.full(len(lines), last)]) for side, none, last in bound)
        rate = np.column_stack([np.where(moves, step / pace, 0.0), np.zeros(len(lines))])
        # A joint that rests on the line bounds u alone.
        at_rest = [(np.where(moves, -1.0, sign * here - tight), np.where(moves, 0.0, sign * step)) for sign in (1, -1)]
        against = low[:, :, None] - high[:, None, :], rate[:, :, None] - rate[:, None, :]
        rows = [(alpha.reshape(len(lines), -1), beta.reshape(len(lines), -1)) for alpha, beta in (against, *at_rest)]
        spans = np.column_stack(_solved(*(np.concatenate(part, axis=1) for part in zip(*rows, strict=True))))
        ends = a + spans.T[:, :, None] * (b - a)
        return (spans[:, 0] <= spans[:, 1]) & _within(begin, end, rho, ends)[0].all(axis=0), spans


def _solved(alpha: Array, beta: Array) -> tuple[Array, Array]:
    """Returns the least and the largest u from 0 to 1, (h,) each, with alpha + u beta <= 0 in all columns; none where least > largest."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        at = -alpha / beta
    last = np.where(beta > 0, at, np.where((beta == 0) & (alpha > 0), -np.inf, np.inf)).min(axis=1, initial=np.inf)
    first = np.where(beta < 0, at, -np.inf).max(axis=1, initial=-np.inf)
    first, last = np.clip(first, -1.0, 2.0), np.clip(last, -1.0, 2.0)
    return np.where(first > 0, first + _INSIDE, 0.0), np.where(last < 1, last - _INSIDE, 1.0)


def follows(tube: Tube, path: Array) -> bool:
    """Says whether a path, (k, n) and straight in q between its points, is proved to be in a tube."""
    anywhere = np.full(path.shape[1], np.inf)
    tubes = Tubes((-anywhere, anywhere), [tube])
    within, _ = _within(tube.path[:-1], tube.path[1:], np.array(tube.rho), path[:, None])
    between = (within[:-1] & within[1:]).any(axis=1)  # the tube about a line is convex
    return all(_covers(tubes.spans(path[k], path[k + 1])[1]) for k in np.flatnonzero(~between))


def _within(begin: Array, end: Array, rho: Array, points: Array) -> tuple[NDArray[np.bool_], Array]:
    """Returns which points are in the tube about which line from ``begin`` to ``end``, (M, n) each, (K, M), and the lines' times, (K, M).

    Args:
        rho: (M, 1) half the widths, or one for all.
        points: (K, M, n), or (K, 1, n) for the same points at all lines.
    """
    way, here = end - begin, points - begin
    moves = way != 0
    pace = np.where(moves, way, 1.0)
    one, other = (here - rho) / pace, (here + rho) / pace
    low = np.where(moves, np.minimum(one, other), 0.0).max(axis=2, initial=0.0)
    high = np.where(moves, np.maximum(one, other), 1.0).min(axis=2, initial=1.0)
    times = np.clip((low + high) / 2, 0.0, 1.0)
    size = 2 * np.abs(points) + np.abs(begin) + np.abs(end)
    return (np.abs(here - times[:, :, None] * way) + _ROUNDED * size <= rho).all(axis=2), times


def _covers(spans: Array) -> bool:
    """Says whether spans of time, (h, 2), cover all from 0 to 1, each beginning where another one still lasts."""
    reached = 0.0
    for first, last in spans[np.argsort(spans[:, 0], kind="stable")].tolist():
        if first > reached:
            return False
        reached = max(reached, last)
    return bool(len(spans) and reached == 1.0)
