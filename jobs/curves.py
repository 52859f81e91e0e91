"""This module holds what requests say about curves: Bezier pieces and B-splines."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from jobs.fields import Numbers, Points

BEZIER = (
    "(k, m + 1, n), the control points of every polynomial piece, all of one degree m from 1 to 15. A piece begins exactly where the one "
    "before ends."
)
KNOTS = (
    "(k + m + 1,), the knots of a B-spline of degree m, not descending; they are its times. It goes from knot number m to number k; knots "
    "count from 0."
)
CONTROL_POINTS = "(k, n), the control points of the B-spline; its Bezier pieces, rounded to doubles, are the motion."
Bezier = Annotated[list[Annotated[Points, Field(min_length=2, max_length=16)]], Field(min_length=1, fail_fast=True)]
Knots = Annotated[Numbers, Field(min_length=4, max_length=2016)]
ControlPoints = Annotated[Points, Field(min_length=2, max_length=2000)]


def one_curve(q: object, s: object, bezier: object, knots: object, control_points: object) -> None:
    """Refuses a motion that is given in no way, in two ways, or by one half of a B-spline."""
    if (knots is None) != (control_points is None):
        raise ValueError("a B-spline needs both knots and control_points")
    if sum(way is not None for way in (q, s, bezier, knots)) != 1:
        raise ValueError("give either q or s, or else bezier, or knots and control_points")
