"""Whole turns of joint positions, against exact arithmetic, and positions that no double tells from others."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flint import arb, ctx
from hypothesis import given
from hypothesis import strategies as st

from certifier.errors import RegionError
from certifier.model import WORLD, Joint, JointKind, Polytope, Scene
from certifier.positions import MAGNITUDE, check_magnitude

HUGE = [np.nextafter(MAGNITUDE, np.inf), 1e7, 9185166224891948.0, 1e300, math.inf, -math.inf, math.nan]


def turning(center: float = 0.0) -> Scene:
    """A joint that turns without end."""
    window = np.deg2rad(170)
    axis = np.array([0.0, 0.0, 1.0])
    joint = Joint("a/j", JointKind.REVOLUTE, WORLD, "a/b", axis, np.eye(4), np.eye(4), 0, center - window, center + window, (None, None))
    return Scene("s", (joint,), (WORLD, "a/b"), (), (), (), np.array([center]))


@given(st.floats(-MAGNITUDE, MAGNITUDE), st.floats(-4.0, 4.0))
def test_whole_turns_are_taken_off_to_the_last_digit(angle: float, center: float) -> None:
    (found,) = turning(center).in_windows([angle]).tolist()
    with ctx.workprec(200):
        turns = ((arb(angle) - arb(found)) / (2 * arb.pi())).mid()
        whole = round(float(turns))
        off = abs(float((arb(angle) - 2 * arb.pi() * whole - arb(found)).mid()))
    assert off <= math.ulp(found)
    assert abs(found - center) <= math.pi + 1e-9
    assert whole or found == angle, "nothing is done to what is in the window"


@pytest.mark.parametrize("angle", HUGE)
def test_a_position_whose_turns_a_double_cannot_hold_is_refused(angle: float) -> None:
    with pytest.raises(RegionError) as refusal:
        turning().in_windows([[0.0], [angle]], "seed.contain")
    assert (refusal.value.code, refusal.value.field) == ("number_too_large", "seed.contain[1][0]")


def test_numbers_at_the_limit_are_taken() -> None:
    check_magnitude([[MAGNITUDE, -MAGNITUDE], [0.0, 5e-324]], "q")
    check_magnitude([], "q")


@pytest.mark.parametrize(("C", "d"), [([[1e300]], [1.0]), ([[1.0]], [1e300]), ([[1.0]], [math.inf]), ([[math.nan]], [1.0])])
def test_a_polytope_whose_sums_overflow_is_refused(C: list[list[float]], d: list[float]) -> None:
    with pytest.raises(RegionError) as refusal:
        Polytope.given(C, d)
    assert refusal.value.code == "polytope_not_finite"
