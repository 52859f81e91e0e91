"""A motion that is straight in s is cut with every region exactly.

A polytope and a line have one interval in common. Its ends are rational numbers, because the faces and the ends of the line are. So
two intervals that only touch have a point in common, and a gap is found however small it is. Floating point with bounds on its rounding
decides which few faces matter; the rest is done in fractions.
"""

from __future__ import annotations

import numpy as np
from flint import fmpq

from certifier.model import Array
from planner.library import Library

_EPS = np.finfo(float).eps
_OFF = 1e-14
"""Quotients of differences between 0 and 1 are off by less than this."""


class StraightInS:
    """The line s(t) = a + t (b - a), 0 <= t <= 1, taken literally for the doubles a and b, (n,)."""

    def __init__(self, library: Library, a: Array, b: Array) -> None:
        self._a, self._b = _exact(a), _exact(b)
        found = ((region, self._common(library.faces[library.rows(region)], a, b)) for region in _through_boxes(library, a, b))
        self._intervals = {region: interval for region, interval in found if interval is not None}

    def furthest(self, t: fmpq) -> tuple[int, fmpq] | None:
        """Returns the region that contains the line from t on for longest, and the parameter where that ends; None where none does."""
        here = [(region, end) for region, (begin, end) in self._intervals.items() if begin <= t <= end]
        return max(here, key=lambda found: found[1]) if here else None

    def _common(self, faces: Array, a: Array, b: Array) -> tuple[fmpq, fmpq] | None:
        """Returns the parameters between which the line satisfies all faces, (m, n + 1), ends included; None where it never does."""
        matter = _that_matter(faces, a, b)
        if matter is None:
            return None
        begin, end = fmpq(0), fmpq(1)
        for face in matter.tolist():
            c, d = _exact(face[:-1]), fmpq(*face[-1].as_integer_ratio())
            at_a, at_b = (d - sum((x * y for x, y in zip(c, s, strict=True)), fmpq(0)) for s in (self._a, self._b))
            if at_a < 0 and at_b < 0:
                return None
            if at_a < 0:
                begin = max(begin, at_a / (at_a - at_b))
            elif at_b < 0:
                end = min(end, at_a / (at_a - at_b))
        return (begin, end) if begin <= end else None


def _exact(values: Array | list[float]) -> list[fmpq]:
    return [fmpq(*float(value).as_integer_ratio()) for value in values]


def _through_boxes(library: Library, a: Array, b: Array) -> list[int]:
    """Returns the regions whose boxes the line from a to b may meet; every box that it meets is among them."""
    way = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort([(library.lower - a) / way, (library.upper - a) / way], axis=0)
    stays = way == 0
    ends[:, :, stays] = np.where((library.lower <= a) & (a <= library.upper), [[[-np.inf]], [[np.inf]]], np.inf)[:, :, stays]
    begin, end = ends[0].max(axis=1, initial=0.0), ends[1].min(axis=1, initial=1.0)
    found: list[int] = np.flatnonzero(begin <= end + _OFF).tolist()
    return found


def _that_matter(faces: Array, a: Array, b: Array) -> Array | None:
    """Returns the faces (k, n + 1), of all (m, n + 1), that may bound the interval in which the line from a to b satisfies all of them.

    A face that the whole line satisfies bounds nothing, nor does one that another face certainly forestalls. None where the line certainly
    violates some face everywhere.
    """
    C, d = faces[:, :-1], faces[:, -1]
    at_a, at_b = d - C @ a, d - C @ b
    size = np.abs(d) + np.abs(C) @ np.maximum(np.abs(a), np.abs(b))
    error = 4 * (faces.shape[1] + 2) * _EPS * size + 1e-300
    if (np.maximum(at_a, at_b) < -error).any():
        return None
    crossed = np.flatnonzero(np.minimum(at_a, at_b) <= error)
    at_a, at_b, error = at_a[crossed], at_b[crossed], error[crossed]
    # Where the ends are clearly on different sides, |t - exact t| <= 2 error / (|at_a - at_b| - 2 error).
    clear = np.minimum(np.abs(at_a), np.abs(at_b)) > error
    spread = np.where(clear, np.abs(at_a - at_b), np.inf)
    t, off = np.where(clear, at_a / np.where(clear, at_a - at_b, 1.0), 0.0), 4 * error / (spread - 2 * error) + 1e-15
    entering, leaving = clear & (at_a < 0), clear & (at_b < 0)
    latest, earliest = (t - off)[entering].max(initial=-np.inf), (t + off)[leaving].min(initial=np.inf)
    if latest > earliest:
        return None
    return faces[crossed[~(entering & (t + off < latest) | leaving & (t - off > earliest))]]
