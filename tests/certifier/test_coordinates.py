"""Coordinates of joints, against ball arithmetic with many more digits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flint import arb, ctx
from hypothesis import assume, given
from hypothesis import strategies as st

from certifier.coordinates import ConfigurationSpace
from certifier.model import WORLD, Joint, JointKind

DIGITS = 1000
EDGE = math.nextafter(math.pi, 0.0)
CENTERS = st.floats(-3.0, 3.0) | st.just(0.0)
OFFSETS = st.floats(-EDGE, EDGE) | st.sampled_from([-EDGE, EDGE, -np.radians(170), np.radians(170), 0.0])
TANGENTS = st.floats(-1e8, 1e8) | st.sampled_from([0.0, 1e-300, math.tan(np.radians(85)), -math.tan(np.radians(85))])


@pytest.fixture(autouse=True)
def _digits():
    with ctx.workdps(DIGITS):
        yield


def twins(center: float) -> ConfigurationSpace:
    """A revolute and a prismatic joint about the same q*."""
    return ConfigurationSpace(np.array([center, center]), np.array([True, False]))


def exactly(s: float) -> arb:
    """Returns q - q* of a revolute joint."""
    return 2 * arb(s).atan()


def near(found: np.ndarray, turns: arb, slides: float, ulps: float = 4.0, size: float = 0.0) -> bool:
    """Returns whether the first number is near the exact one, and the second is its twin's to the last bit."""
    error = abs(arb(float(found[0])) - turns)
    return bool(error <= ulps * float(np.finfo(float).eps) * (abs(turns) + size) + arb(5e-324)) and found[1] == slides


@given(CENTERS, TANGENTS)
def test_from_s_to_q(center, s):
    space = twins(center)
    assert near(space.offset(np.array([s, s])), exactly(s), s)
    assert near(space.to_q([s, s]), center + exactly(s), center + s, size=abs(center) + math.pi)


@given(CENTERS, OFFSETS)
def test_from_q_to_s(center, offset):
    """The rounding of q - q* moves s by the slope times as much."""
    q, space = center + offset, twins(center)
    difference = q - center
    half = arb(difference) / 2
    assert near(space.at_offset(np.array([difference] * 2)), half.tan(), difference)
    assert near(space.to_s([q, q]), half.tan(), difference)
    assert near(space.nearest_s(np.array([q, q])), half.tan(), difference, ulps=0.5)


@given(CENTERS, OFFSETS)
def test_there_and_back(center, offset):
    q, space = np.full(2, center + offset), twins(center)
    np.testing.assert_allclose(space.to_q(space.to_s(q)), q, rtol=0, atol=1e-14)
    assert abs(space.offset(space.at_offset(np.full(2, offset))) - offset).max() <= 4 * np.spacing(abs(offset))


@given(CENTERS, OFFSETS)
def test_outer_limits_are_the_nearest_doubles_that_leave_nothing_out(center, offset):
    limit = center + offset
    difference = arb(limit) - arb(center)
    assume(abs(difference) < math.pi)
    for lower, upper, exactly in zip(*twins(center).outer_s(*np.full((2, 2), limit)), ((difference / 2).tan(), difference), strict=True):
        assert arb(lower) <= exactly <= arb(upper)
        assert not arb(math.nextafter(upper, -math.inf)) >= exactly
        assert not arb(math.nextafter(lower, math.inf)) <= exactly


@given(TANGENTS)
def test_slope_denominator_and_cosine(s):
    space, step = twins(0.3), arb(2) ** -300
    at = np.array([s, s])
    quotient = ((arb(s) + step).atan() - arb(s).atan()) * 2 / step
    assert near(space.slope(at), quotient, 1.0)
    assert near(space.denominator(at), 1 + arb(s) ** 2, 1.0)
    assert near(space.cosine(at), (exactly(s) / 2).cos(), 1.0)


@given(TANGENTS, TANGENTS)
def test_between_two_points(a, b):
    lower, upper = sorted((a, b))
    space = twins(-1.0)
    ends = np.full(2, lower), np.full(2, upper)
    assert near(space.turn(*ends), exactly(upper) - exactly(lower), upper - lower, size=2 * math.pi)
    assert lower <= space.middle(*ends)[1] == (lower + upper) / 2 <= upper
    middle = float(space.middle(*ends)[0])
    assert abs(exactly(middle) - (exactly(lower) + exactly(upper)) / 2) <= 1e-15 * 2 * math.pi


@given(CENTERS)
def test_which_positions_have_an_s(center):
    space = twins(center)
    for side in (-1.0, 1.0):
        assert space.has_s(np.full(2, center + side * 3.1415)).tolist() == [True, True]
        assert space.has_s(np.full(2, center + side * 3.1416)).tolist() == [False, True]
    assert twins(0.0).has_s(np.full(2, math.pi)).tolist() == [False, True]


def test_arrays_of_any_shape_and_some_of_the_joints():
    rng = np.random.default_rng(0)
    space = ConfigurationSpace(rng.normal(size=5), np.array([True, False, True, True, False]))
    s, other = rng.normal(size=(2, 3, 4, 5))
    for joints in ([3, 1, 4], 2):
        part = space.of(joints)
        for name in ("to_q", "to_s", "offset", "at_offset", "slope", "denominator", "cosine", "has_s"):
            np.testing.assert_array_equal(getattr(part, name)(s[..., joints]), getattr(space, name)(s)[..., joints])
        for name in ("turn", "middle"):
            found = getattr(part, name)(s[..., joints], other[..., joints])
            np.testing.assert_array_equal(found, getattr(space, name)(s, other)[..., joints])
    assert space.scale(0.5).tolist() == [1.0, 0.5, 1.0, 1.0, 0.5]


@pytest.mark.parametrize(("kind", "unit", "shown", "half"), [("revolute", "rad", "deg", 180.0), ("prismatic", "m", "m", math.pi)])
def test_units(kind, unit, shown, half):
    joint = Joint("a/j", JointKind(kind), WORLD, "a/b", np.array([0.0, 0.0, 1.0]), np.eye(4), np.eye(4), 0, -1.0, 1.0)
    assert (joint.unit, joint.shown[0], math.pi * joint.shown[1]) == (unit, shown, half)
