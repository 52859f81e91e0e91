"""Curves as users give them: B-splines against scipy's, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly, BSpline, CubicSpline, PPoly

from certifier.errors import RegionError
from certifier.motion.given import motion_of
from certifier.motion.splines import Curve, b_spline, bezier_pieces, curve
from certifier.proof.motion import Motion, Space
from tests.certifier.motions import coordinates
from tests.certifier.scenes import planar_arm


def values(found: Curve, piece: int, part: float) -> np.ndarray:
    return coordinates(Motion(Space.Q, found.controls, found.degree), piece, [part])[0]


@settings(max_examples=300)
@given(seed=st.integers(0, 2**32 - 1), degree=st.integers(1, 9), more=st.integers(1, 9), clamped=st.booleans(), fine=st.booleans())
def test_the_pieces_of_a_spline_are_the_spline(seed, degree, more, clamped, fine):
    """Knots may be repeated, and need not be so at the ends. Where neighbours meet they share a point, and no control point is far out."""
    rng = np.random.default_rng(seed)
    count = degree + more
    knots = np.sort(rng.uniform(-1, 3, count + degree + 1) if fine else rng.integers(0, 2 * more + 4, count + degree + 1).astype(float))
    if clamped:
        knots[: degree + 1], knots[-degree - 1 :] = knots[degree], knots[-degree - 1]
    points = rng.normal(size=(count, 3))
    start, end = knots[degree], knots[count]
    inner = np.unique(knots[(knots > start) & (knots < end)], return_counts=True)[1]
    assume(start < end and inner.max(initial=0) <= degree)
    found, truth = b_spline(knots.tolist(), points.tolist()), BSpline(knots, points, degree)
    assert found.degree == degree
    assert found.times.tolist() == np.unique(knots[degree : count + 1]).tolist()
    assert len(found.controls) == (len(found.times) - 1) * degree + 1
    assert (found.controls.max(axis=0) <= points.max(axis=0)).all()
    assert (found.controls.min(axis=0) >= points.min(axis=0)).all()
    for k in range(len(found.times) - 1):
        for part in (0.0, 0.25, 0.7):
            time = found.times[k] + part * (found.times[k + 1] - found.times[k])
            assert values(found, k, part) == pytest.approx(truth(time), abs=1e-9)
        assert values(found, k, 1.0) == pytest.approx(truth(np.nextafter(found.times[k + 1], start)), abs=1e-6)


def test_a_spline_that_is_one_bezier_piece_keeps_its_control_points():
    points = np.random.default_rng(0).normal(size=(5, 2))
    found = b_spline([0.0] * 5 + [2.5] * 5, points)
    assert (found.controls.tolist(), found.degree, found.times.tolist()) == (points.tolist(), 4, [0.0, 2.5])


def test_bezier_pieces_share_their_ends():
    """A cubic spline of scipy through waypoints, in Bernstein's form; its ends are made equal to the last digit first."""
    times = np.array([0.0, 1.0, 2.5, 3.0])
    through = CubicSpline(times, np.random.default_rng(1).normal(size=(4, 2)))
    pieces = np.moveaxis(BPoly.from_power_basis(PPoly(through.c, through.x)).c, 1, 0)
    pieces[:-1, -1] = pieces[1:, 0]
    found = bezier_pieces(pieces)
    assert (found.degree, found.times, found.controls.shape) == (3, None, (10, 2))
    for k in range(3):
        for part in (0.0, 0.3, 1.0):
            assert values(found, k, part) == pytest.approx(through(times[k] + part * (times[k + 1] - times[k])), abs=1e-12)
    assert np.array_equal(Motion(Space.Q, found.controls, 3).bezier, pieces)


SQUARE = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1]]


@pytest.mark.parametrize(
    ("document", "code", "field"),
    [
        ({"bezier": []}, "curve_shape", "bezier"),
        ({"bezier": SQUARE}, "curve_shape", "bezier"),
        ({"bezier": [SQUARE, SQUARE[:2]]}, "curve_shape", "bezier"),
        ({"bezier": [SQUARE[:1]]}, "curve_shape", "bezier"),
        ({"bezier": [[[0.0, 0.0]] * 17]}, "curve_shape", "bezier"),
        ({"bezier": [[[0.0, 0.0], [0.0, np.inf]]]}, "motion_not_finite", "bezier[0][1][1]"),
        ({"bezier": [[[0.0, 0.0], [0.0, 1e7]]]}, "motion_not_finite", "bezier[0][1][1]"),
        ({"bezier": [SQUARE, SQUARE]}, "curve_not_continuous", "bezier[1][0]"),
        ({"bezier": [[[0.0, 0.0], [0.1, 0.1]], [[0.1, np.nextafter(0.1, 1)], [0.0, 0.0]]]}, "curve_not_continuous", "bezier[1][0]"),
        ({"bezier": [[[0.0], [0.1]]]}, "motion_shape", "bezier"),
        ({"bezier": [[*SQUARE, [2.5, 0.0]]]}, "outside_limits", "bezier[0][3][0]"),
        ({"bezier": [SQUARE], "knots": [0, 0, 1, 1], "control_points": SQUARE}, "curve_shape", "bezier"),
        ({"knots": [0, 0, 1, 1]}, "curve_shape", "bezier"),
        ({"control_points": SQUARE}, "curve_shape", "bezier"),
        ({"knots": [0, 0, 0, 1, 1], "control_points": SQUARE[0]}, "curve_shape", "control_points"),
        ({"knots": [[0, 1]], "control_points": SQUARE}, "curve_shape", "knots"),
        ({"knots": [0, 1, 2, 3], "control_points": SQUARE}, "curve_shape", "knots"),
        ({"knots": [0, 0, 0, 0, 1, 1, 1], "control_points": SQUARE}, "curve_shape", "knots"),
        ({"knots": [0] * 17 + [1] * 17, "control_points": [[0.0, 0.0]] * 17}, "curve_shape", "knots"),
        ({"knots": [0, 0, 1, 0.5, 1], "control_points": SQUARE}, "knots", "knots[3]"),
        ({"knots": [0, 0, 0, 0, 1, 1], "control_points": SQUARE}, "knots", "knots"),
        ({"knots": [0, 0, 0, 0, 0], "control_points": SQUARE}, "knots", "knots"),
        ({"knots": [0, 0, 1, 1, 2, 2], "control_points": [*SQUARE, [0.0, 0.0]]}, "curve_not_continuous", "knots"),
        ({"knots": [0, 0, np.nan, 1, 1], "control_points": SQUARE}, "motion_not_finite", "knots[2]"),
        ({"knots": [0, 0, 1, 2, 2], "control_points": [[0.0, 0.0], [2.5, 0.0], [0.0, 0.0]]}, "outside_limits", "control_points"),
        ({"knots": [0, 0, 1, 2, 2], "control_points": [[0.0], [0.1], [0.2]]}, "motion_shape", "control_points"),
    ],
    ids=str,
)
def test_what_is_no_curve_is_refused_with_its_place(document, code, field):
    with pytest.raises(RegionError) as refusal:
        motion_of(planar_arm(2), document)
    assert (refusal.value.code, refusal.value.field) == (code, field)


def test_control_points_may_lie_on_the_limits_and_a_document_without_a_curve_has_none():
    scene = planar_arm(2)
    motion = motion_of(scene, {"bezier": [[[2.0, -2.0], [-2.0, 2.0], [2.0, 2.0]]]})
    assert (motion.space, motion.degree, motion.pieces) == (Space.Q, 2, 1)
    in_s = motion_of(scene, {"bezier": [[scene.outer_limits[0], scene.outer_limits[1]]]}, Space.S)
    assert (in_s.space, in_s.degree) == (Space.S, 1)
    knots = [0, 0, 0, 0.3, 0.31, 1, 1, 1]
    assert motion_of(scene, {"knots": knots, "control_points": [[2.0, 2.0]] * 5}).controls.max() == 2.0
    assert curve({"q": [[0.0], [0.1]]}) is None
