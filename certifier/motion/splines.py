"""Polynomials of time, as users give them, become control points of pieces of one degree in Bernstein form.

A B-spline becomes Bezier pieces by its blossom: the control points of a span are the values of the spline's symmetric multi-affine form at
the ends of the span, and are averages of the spline's own control points. L. Ramshaw, Blossoms are polar forms, CAGD 6 (1989).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from certifier.document import LARGEST
from certifier.errors import RegionError
from certifier.model import Array
from certifier.positions import MAGNITUDE, check_magnitude
from certifier.proof.limits import DEGREE


@dataclass(frozen=True)
class Curve:
    """A curve is made of polynomial pieces of one degree m, one after the other.

    Attributes:
        controls: (P m + 1, n) control points; those of piece k are from number k m to (k + 1) m.
        degree: m.
        times: (P + 1,) when the pieces begin and end; None where nothing says so.
    """

    controls: Array
    degree: int
    times: Array | None


def curve(document: Mapping[str, Any]) -> Curve | None:
    """Returns the curve that is given by ``bezier``, or by ``knots`` and ``control_points``; None where none of them is there.

    Raises:
        RegionError: as the functions below, or ``curve_shape`` where there is too much or too little.
    """
    pieces, knots, points = (document.get(name) for name in ("bezier", "knots", "control_points"))
    if pieces is None and knots is None and points is None:
        return None
    if (pieces is None) == (knots is None) or (knots is None) != (points is None):
        hint = "give either bezier, or knots and control_points"
        raise RegionError("curve_shape", "the curve is not given in one way", field="bezier", hint=hint)
    return bezier_pieces(pieces) if knots is None else b_spline(knots, points)


def bezier_pieces(given: Any) -> Curve:
    """Returns the curve of Bezier pieces of one degree, nested lists or an array of numbers, (P, m + 1, n).

    Raises:
        RegionError: ``curve_shape``, ``motion_not_finite``, or ``curve_not_continuous`` with the piece.
    """
    pieces = _numbers(given, 3, MAGNITUDE, "bezier", "give (P, m + 1, n) numbers: the control points of each piece")
    degree = pieces.shape[1] - 1
    if not 1 <= degree <= DEGREE:
        problem = f"a piece has {degree + 1} control points, and 2 to {DEGREE + 1} are allowed"
        raise RegionError("curve_shape", problem, field="bezier", hint="all pieces are of one degree; raise the lower ones")
    broken = np.flatnonzero((pieces[1:, 0] != pieces[:-1, -1]).any(axis=1))
    if len(broken):
        k = int(broken[0]) + 1
        hint = f"its first control point must be the last one of piece {k - 1}, to the last digit"
        problem = f"piece {k} does not begin where piece {k - 1} ends; pieces count from 0"
        raise RegionError("curve_not_continuous", problem, field=f"bezier[{k}][0]", hint=hint)
    return Curve(_joined(pieces), degree, None)


def b_spline(knots: Any, control_points: Any) -> Curve:
    """Returns the curve of a B-spline between the ends of its domain, with its control points rounded to doubles.

    Args:
        knots: (N + m + 1,) not descending; the domain of the spline goes from number m to number N.
        control_points: (N, n), N > m.

    Raises:
        RegionError: ``curve_shape``, ``motion_not_finite``, ``knots``, or ``curve_not_continuous``.
    """
    t = _numbers(knots, 1, LARGEST, "knots", "give numbers, as many as control points, the degree and 1")
    points = _numbers(control_points, 2, MAGNITUDE, "control_points", "give (N, n) numbers, one row for each control point")
    degree = len(t) - len(points) - 1
    if not 1 <= degree <= min(DEGREE, len(points) - 1):
        problem = f"{len(t)} knots and {len(points)} control points are those of no spline of a degree from 1 to {DEGREE}"
        hint = "give as many knots as control points, the degree and 1, and more control points than the degree"
        raise RegionError("curve_shape", problem, field="knots", hint=hint)
    if (np.diff(t) < 0).any():
        k = int(np.argmax(np.diff(t) < 0)) + 1
        raise RegionError("knots", f"knot {k} is less than the one before; knots count from 0", field=f"knots[{k}]", hint="sort them")
    domain = t[degree : len(points) + 1]
    times = np.unique(domain)
    if len(times) < 2:
        problem = f"the domain of the spline, from knot {degree} to {len(points)}, has no length"
        raise RegionError("knots", problem, field="knots", hint=f"repeat a knot at most {degree + 1} times")
    values, repeated = np.unique(t, return_counts=True)
    jumps = values[(repeated > degree) & (values > times[0]) & (values < times[-1])]
    if len(jumps):
        problem = f"the spline of degree {degree} may jump at its knot {jumps[0]:g}, which is repeated more than {degree} times"
        raise RegionError("curve_not_continuous", problem, field="knots", hint="divide the motion there")
    spans = degree + np.flatnonzero(np.diff(domain) > 0)
    return Curve(_joined(_blossomed(t, points, degree, spans)), degree, times)


def _blossomed(t: Array, points: Array, degree: int, spans: np.ndarray) -> Array:
    """Returns the Bezier control points, (P, m + 1, n), of the spans from knots of these numbers, (P,), to the next ones."""
    pieces = []
    for j in range(degree + 1):
        d = points[spans[:, None] + np.arange(-degree, 1)]
        for r in range(1, degree + 1):
            at = t[spans + 1] if r <= j else t[spans]
            k = spans[:, None] + np.arange(r - degree, 1)
            weight = ((at[:, None] - t[k]) / (t[k + degree + 1 - r] - t[k]))[:, :, None]
            low, high = np.minimum(d[:, :-1], d[:, 1:]), np.maximum(d[:, :-1], d[:, 1:])
            d = np.clip((1 - weight) * d[:, :-1] + weight * d[:, 1:], low, high)
        pieces.append(d[:, 0])
    return np.stack(pieces, axis=1)


def _joined(pieces: Array) -> Array:
    """Returns the control points, (P m + 1, n), of pieces (P, m + 1, n); where two of them meet, the next one's count."""
    return np.concatenate([pieces[:, :-1].reshape(-1, pieces.shape[2]), pieces[-1:, -1]])


def _numbers(given: Any, dimensions: int, most: float, field: str, hint: str) -> Array:
    try:
        numbers = np.array(given, dtype=float)
    except (TypeError, ValueError):
        numbers = None
    if numbers is None or numbers.ndim != dimensions or not numbers.size:
        shape = "no lists of numbers of one length" if numbers is None else f"of shape {numbers.shape}"
        raise RegionError("curve_shape", f"the numbers are {shape}", field=field, hint=hint)
    check_magnitude(numbers, field, most, "motion_not_finite")
    return numbers
