"""Curved motions: no point of what is said to be covered is outside, and hairs' breadths are told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flint import arb, ctx
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly, PPoly

from certifier.errors import RegionError
from certifier.model import Array, JointKind, Scene, StoredRegion
from planner.library import Library
from planner.motion.cover import cover
from planner.motion.curve import Curve, _largest, at
from planner.motion.path import follow
from planner.motion.space import Space
from planner.motion.straight_s import StraightInS
from tests.planner.regions import box, cut_boxes, library
from tests.planner.test_motion import arm

SEEDS = st.integers(0, 2**32 - 1)


def sliding(scene: Scene, which: Array) -> Scene:
    """The scene with some joints that slide."""
    kinds = (JointKind.PRISMATIC if slides else JointKind.REVOLUTE for slides in which.tolist())
    return replace(scene, joints=tuple(replace(joint, kind=kind) for joint, kind in zip(scene.joints, kinds, strict=True)))


def beyond(stored: Library, region: int, scene: Scene, space: Space, controls: Array, t: float) -> bool:
    """Whether a point is certainly outside of the region, by Bernstein's polynomials in ball arithmetic of 200 bits."""
    with ctx.workprec(200):
        m, s = len(controls) - 1, []
        for i in range(scene.n):
            x = arb(0)
            for k, value in enumerate(controls[:, i].tolist()):
                x += _weight(m, k, t) * arb(value)
            turns = space is Space.Q and bool(scene.revolute[i])
            x = x - arb(float(scene.q_star[i])) if space is Space.Q else x
            s.append((x / 2).tan() if turns else x)
        polytope = stored.polytope(region)
        values = (sum((arb(x) * y for x, y in zip(c, s, strict=True)), arb(0)) for c in polytope.C.tolist())
        return any(value > arb(d) for value, d in zip(values, polytope.d.tolist(), strict=True))


def _weight(m: int, k: int, t: float) -> arb:
    weight = arb(1)
    for i in range(k):
        weight *= arb(m - i) / arb(i + 1)
    return weight * arb(t) ** k * (1 - arb(t)) ** (m - k)


def raised(controls: Array, degree: int) -> Array:
    """The control points of the same polynomial of a higher degree."""
    while len(controls) <= degree:
        part = np.arange(len(controls) + 1)[:, None] / len(controls)
        none = np.zeros((1, controls.shape[1]))
        controls = part * np.concatenate([none, controls]) + (1 - part) * np.concatenate([controls, none])
    return controls


@settings(max_examples=100)
@given(seed=SEEDS, n=st.integers(1, 4), count=st.integers(1, 8), degree=st.integers(1, 6), space=st.sampled_from(Space))
def test_no_point_of_a_piece_is_outside_of_its_region_and_no_piece_could_go_on_much(
    seed: int, n: int, count: int, degree: int, space: Space
) -> None:
    rng = np.random.default_rng(seed)
    stored, scene = cut_boxes(rng, n, count, spread=0.4), sliding(arm(n), rng.random(n) < 0.3)
    scene = replace(scene, q_star=rng.uniform(-0.2, 0.2, n))
    controls = rng.uniform(-0.9, 0.9, (degree + 1, n))
    found = cover(Curve(stored, scene, space, controls))
    for piece in found.pieces:
        for t in [*np.linspace(piece.begin, piece.end, 30), *rng.uniform(piece.begin, piece.end, 10)]:
            assert not beyond(stored, piece.region, scene, space, controls, float(t))
    if found.uncovered is not None:
        after = min(found.uncovered + 1e-7, 1.0)
        assert all(beyond(stored, region, scene, space, controls, after) for region in range(count))


@settings(max_examples=60)
@given(seed=SEEDS, n=st.integers(1, 4), degree=st.sampled_from([2, 3, 7, 15]), space=st.sampled_from(Space))
def test_a_straight_motion_of_any_degree_has_the_answer_of_degree_1(seed: int, n: int, degree: int, space: Space) -> None:
    rng = np.random.default_rng(seed)
    stored, scene, ends = cut_boxes(rng, n, 6, spread=0.4), arm(n), rng.uniform(-0.8, 0.8, (2, n))
    straight = cover(Curve(stored, scene, Space.Q, ends) if space is Space.Q else StraightInS(stored, *ends))
    curved = cover(Curve(stored, scene, space, raised(ends, degree)))
    assert (straight.uncovered is None) == (curved.uncovered is None)
    assert (curved.uncovered or 0.0) == pytest.approx(straight.uncovered or 0.0, abs=1e-7)
    # Where a region ends, its proof may go on by hairs.
    long = [piece for piece in curved.pieces if piece.end - piece.begin > 1e-7]
    expected = [piece for piece in straight.pieces if piece.end - piece.begin > 1e-7]
    assert len(long) == len(expected)
    for one, other in zip(long, expected, strict=True):
        assert (one.begin, one.end) == pytest.approx((other.begin, other.end), abs=1e-7)


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize(("off", "covered"), [(1e-11, True), (-1e-11, False)])
def test_a_parabola_that_tops_a_hair_before_a_face_is_covered_and_a_hair_beyond_is_not(space: Space, off: float, covered: bool) -> None:
    """The control point in the middle is far outside of the region."""
    scene, top = arm(1), 0.7
    height = float(np.tan(top / 2)) if space is Space.Q else top
    stored = library(box("a", [-1.0], [height + off]))
    found = cover(Curve(stored, scene, space, np.array([[0.1], [2 * top - 0.1], [0.1]])))
    assert (found.uncovered is None) is covered
    if not covered:
        assert found.uncovered == pytest.approx(0.5, abs=1e-4)


def test_a_curve_that_leaves_and_comes_back_stops_where_it_leaves() -> None:
    stored = library(box("a", [-1.0, -1.0], [1.0, 0.5]))
    controls = np.array([[0.0, 0.0], [0.2, 1.5], [0.5, 0.0]])
    found = cover(Curve(stored, arm(2), Space.S, controls))
    assert found.uncovered == pytest.approx((1 - np.sqrt(1 / 3)) / 2, abs=1e-7)
    assert [piece.region for piece in found.pieces] == [0]


def test_a_joint_that_turns_is_covered_in_any_turn_and_stops_at_its_window_and_its_limits() -> None:
    half, pi = np.deg2rad(170), np.pi
    scene = arm(1, -half, half, (-4 * pi, 4 * pi))
    stored = library(box("all", [float(scene.s_lower[0])], [float(scene.s_upper[0])]))

    def goes(*controls: float, scene: Scene = scene) -> float | None:
        return cover(Curve(stored, scene, Space.Q, np.array(controls)[:, None])).uncovered

    for turn in (-2 * pi, 0.0, 2 * pi):
        assert goes(turn - 1.0, turn + 4.0, turn + 2.0) is None
        assert goes(turn - 1.0, turn + 1.0, turn + 3.0, turn + 5.0) == pytest.approx((half + 1) / 6, abs=1e-7)
        assert goes(turn, turn - pi, turn - 2 * pi) == pytest.approx(half / (2 * pi), abs=1e-7)
    assert goes(0.0, 40.0, 0.0) == pytest.approx((1 - np.sqrt(1 - half / 20)) / 2, abs=1e-7)
    assert goes(np.deg2rad(175), 0.0, 0.0) == 0.0
    limited = arm(1, -half, half, (None, 2 * pi + 1.0))
    assert goes(2 * pi, 2 * pi + 1.9, 2 * pi, scene=limited) is None
    assert goes(2 * pi, 2 * pi + 2.1, 2 * pi, scene=limited) == pytest.approx((1 - np.sqrt(1 - 2 / 2.1)) / 2, abs=1e-6)
    assert goes(2 * pi, 2 * pi + 0.5, 2 * pi + 1.0, scene=limited) is None


def test_what_is_huge_is_not_covered_by_rounding() -> None:
    """Numbers whose cancellation doubles do not see, and angles that doubles cannot tell."""
    half = np.deg2rad(170)
    scene = arm(1, -half, half, (None, None))
    stored = library(box("a", [-0.5], [0.5]))
    for controls in ([0.0, 1e17, 0.0], [0.0, 1e9, -1e9, 0.0]):
        found = cover(Curve(stored, scene, Space.Q, np.array(controls)[:, None]))
        assert found.uncovered is not None
        assert found.uncovered < 1e-6
        assert cover(Curve(stored, scene, Space.S, np.array(controls)[:, None])).uncovered is not None
    for controls in ([1e17, 1e17], [1e60, 1.0, -1e60]):
        assert cover(Curve(stored, scene, Space.S, np.array(controls)[:, None])).uncovered is not None
        with pytest.raises(RegionError, match="no number of at most"):
            Curve(stored, scene, Space.Q, np.array(controls)[:, None])


def test_a_path_of_pieces_is_followed_with_its_times() -> None:
    scene = arm(2)
    stored = library(box("a", [-0.5, -0.5], [0.5, 0.5]), box("b", [0.3, -0.5], [1.0, 0.5]))
    controls = np.array([[0.0, 0.0], [0.2, 0.9], [0.4, 0.0], [0.6, -0.4], [0.6, 0.3]])
    found = follow(stored, scene, Space.S, controls, [0.0, 1.0, 5.0], 2)
    assert found.uncovered is None
    assert (found.stretches[0].begin, found.stretches[-1].end) == (0.0, 5.0)
    assert [stored.ids[part.region] for part in found.stretches] == ["a", "b"]
    gone = follow(stored, scene, Space.Q, np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 2.0]]), [10.0, 14.0], 2)
    assert gone.uncovered is not None
    part = np.sqrt(np.arctan(0.5))
    assert (gone.uncovered.time, gone.uncovered.segment) == (pytest.approx(10 + 4 * part, abs=1e-6), 0)
    np.testing.assert_allclose(gone.uncovered.q, [0.0, 2 * np.arctan(0.5)], atol=1e-6)


@given(seed=SEEDS, degree=st.integers(0, 14), end=st.sampled_from([0.0, 2.0**-60, 2.0**-41, 0.01, 0.3, 1.0]), late=st.booleans())
def test_a_polynomial_is_as_large_in_a_part_as_its_bound_says_or_less(seed: int, degree: int, end: float, late: bool) -> None:
    """In short parts the bound is nearly reached; parts may be at the very end."""
    rng = np.random.default_rng(seed)
    controls, begin = rng.normal(size=(degree + 1, 2)), 1.0 - end if late else float(rng.uniform(0, 1 - end))
    bound, at_most = _largest(controls, begin, begin + end), np.abs(controls).max(axis=0)
    sizes = [np.abs([float(_weight(degree, k, t)) for k in range(degree + 1)] @ controls) for t in np.linspace(begin, begin + end, 20)]
    assert (np.max(sizes, axis=0) <= bound * (1 + 1e-12) + 1e-15).all()
    assert (bound <= at_most * (1 + 1e-12)).all()
    if end <= 2.0**-41:
        assert bound == pytest.approx(sizes[0], abs=1e-9)
    assert _largest(controls[:0], begin, begin + end).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("space", Space)
def test_a_curve_that_swings_between_the_walls_of_a_region_takes_few_parts(space: Space) -> None:
    """Chebyshev's polynomial of degree 15 between -1 and 1, whose control points are 20 000 times as large."""
    power = np.polynomial.Chebyshev.basis(15, domain=[0, 1]).convert(kind=np.polynomial.Polynomial, domain=[-1, 1], window=[-1, 1]).coef
    controls = np.repeat(BPoly.from_power_basis(PPoly(power[::-1, None], [0, 1])).c[:, :1], 2, axis=1) / 2
    assert np.abs(controls).max() > 1e4
    for half, covered in ((0.51, True), (0.49, False)):
        limit = half if space is Space.S else float(np.tan(half / 2))
        curve = Curve(library(box("a", [-limit] * 2, [limit] * 2)), arm(2), space, controls)
        found = cover(curve)
        assert (found.uncovered is None) is covered
        assert curve._at.cache_info().misses < 1000


@given(seed=SEEDS, degree=st.integers(1, 15))
def test_de_casteljau_is_bernstein_s_sum(seed: int, degree: int) -> None:
    rng = np.random.default_rng(seed)
    controls, t = rng.normal(size=(degree + 1, 2)), float(rng.uniform())
    weights = [float(_weight(degree, k, t)) for k in range(degree + 1)]
    np.testing.assert_allclose(at(controls, t), weights @ controls, atol=1e-13)


def test_a_face_across_a_bend_is_proved_on_one_side_alone() -> None:
    """A curve in s touches the plane through its ends from one side only."""
    scene, controls = arm(2), np.array([[0.0, 0.0], [0.3, 0.4], [0.6, 0.0]])
    eye, limits = np.eye(2), np.full(4, 1.5)
    for sign in (1.0, -1.0):
        C, d = np.concatenate([[[0.0, sign]], eye, -eye]), np.concatenate([[1e-9], limits])
        stored = library(StoredRegion("half", "exact", C, d, np.full(2, -1.5), np.full(2, 1.5)))
        assert (cover(Curve(stored, scene, Space.S, controls)).uncovered is None) is (sign < 0)
