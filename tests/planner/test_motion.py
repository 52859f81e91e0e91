"""Motions: what is said to be covered is so in exact fractions, and hairs' breadths are told apart."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from flint import arb, ctx, fmpq
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.model import Array, Joint, JointKind, Scene, StoredRegion
from ciris import FreeSet
from planner.library import Library
from planner.motion.cover import Cover, cover
from planner.motion.curve import Curve
from planner.motion.path import follow
from planner.motion.space import Space
from planner.motion.straight_s import StraightInS
from tests.free_sets import OPEN, PROVED, written
from tests.planner.regions import box, cut_boxes, library

SEEDS = st.integers(0, 2**32 - 1)
HAIR = 1e-12


def arm(n: int, lower: float = -2.0, upper: float = 2.0, own: tuple[float | None, float | None] | None = None) -> Scene:
    """n revolute joints after each other, without bodies."""
    eye, axis = np.eye(4), np.array([0.0, 0.0, 1.0])
    names = ["world", *(f"m/link{i}" for i in range(n))]
    joints = tuple(Joint(f"m/turn{i}", JointKind.REVOLUTE, names[i], names[i + 1], axis, eye, eye, i, lower, upper, own) for i in range(n))
    return Scene("arm", joints, tuple(names), (), (), (), np.zeros(n))


def in_s(stored: Library, a: list[float], b: list[float]) -> Cover:
    return cover(StraightInS(stored, np.array(a), np.array(b)))


def in_q(stored: Library, scene: Scene, a: Array, b: Array) -> Curve:
    return Curve(stored, scene, Space.Q, np.array([a, b]))


def exact_interval(stored: Library, region: int, a: Array, b: Array) -> tuple[Fraction, Fraction] | None:
    """Where the line is in the region, face by face in fractions."""
    begin, end = Fraction(0), Fraction(1)
    polytope = stored.polytope(region)
    for c, d in zip(polytope.C.tolist(), polytope.d.tolist(), strict=True):
        p, r = (Fraction(d) - sum(Fraction(x) * Fraction(y) for x, y in zip(c, s, strict=True)) for s in (a.tolist(), b.tolist()))
        if p < 0 and r < 0:
            return None
        if p < 0:
            begin = max(begin, p / (p - r))
        if r < 0:
            end = min(end, p / (p - r))
    return (begin, end) if begin <= end else None


@given(seed=SEEDS, n=st.integers(1, 4), count=st.integers(1, 12))
def test_a_cover_in_s_is_the_one_that_fractions_give(seed: int, n: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    stored, a, b = cut_boxes(rng, n, count, spread=0.5), rng.uniform(-0.6, 0.6, n), rng.uniform(-0.6, 0.6, n)
    intervals = {r: found for r in range(count) if (found := exact_interval(stored, r, a, b)) is not None}
    t, pieces = Fraction(0), []
    while True:
        here = [interval[1] for interval in intervals.values() if interval[0] <= t <= interval[1]]
        if not here or (max(here) == t and t < 1):
            break
        pieces.append((float(t), float(max(here))))
        t = max(here)
        if t == 1:
            break
    found = cover(StraightInS(stored, a, b))
    assert [(piece.begin, piece.end) for piece in found.pieces] == pieces
    assert found.uncovered == (None if pieces and pieces[-1][1] == 1 else float(t))
    for piece in found.pieces:
        begin, end = intervals[piece.region]
        assert float(begin) <= piece.begin <= piece.end == float(end)


def test_regions_that_touch_cover_and_a_hair_between_them_does_not() -> None:
    left = box("left", [0.0, 0.0], [1.0, 1.0])
    touching, apart = box("right", [1.0, 0.0], [2.0, 1.0]), box("right", [np.nextafter(1.0, 2.0), 0.0], [2.0, 1.0])
    assert [piece.end for piece in in_s(library(left, touching), [0.5, 0.5], [1.5, 0.5]).pieces] == [0.5, 1.0]
    missed = in_s(library(left, apart), [0.5, 0.5], [1.5, 0.5])
    assert (missed.uncovered, len(missed.pieces)) == (0.5, 1)


@pytest.mark.parametrize(("above", "covered"), [(0.0, True), (HAIR, False), (-HAIR, True), (2.0**-53, False)])
def test_a_line_along_a_face_is_in_the_region_only_if_not_a_hair_beyond(above: float, covered: bool) -> None:
    half = 0.5 + above
    stored = library(box("a", [0.0, 0.0], [1.0, 0.5]))
    assert half != 0.5 or above == 0
    assert (in_s(stored, [0.1, half], [0.9, half]).uncovered is None) is covered


def test_a_line_through_a_corner_has_one_point_in_the_region_and_is_covered_through_it() -> None:
    """Two regions that have one corner in common, and a line that goes exactly through it."""
    stored = library(box("a", [0.0, 0.0], [1.0, 1.0]), box("b", [1.0, 1.0], [2.0, 2.0]))
    found = in_s(stored, [0.5, 0.5], [1.5, 1.5])
    assert [(piece.begin, piece.end, piece.region) for piece in found.pieces] == [(0.0, 0.5, 0), (0.5, 1.0, 1)]
    assert in_s(stored, [0.5, 0.5], [1.5, 1.5 + HAIR]).uncovered == pytest.approx(0.5)


def test_a_point_that_stays_and_an_end_on_a_face_are_covered() -> None:
    stored = library(box("a", [0.0, 0.0], [1.0, 1.0]))
    assert in_s(stored, [1.0, 1.0], [1.0, 1.0]).uncovered is None
    assert in_s(stored, [0.5, 0.5], [1.0, 0.5]).uncovered is None
    assert in_s(stored, [-HAIR, 0.5], [0.5, 0.5]).uncovered == 0.0
    assert in_s(stored, [1.5, 0.5], [1.5, 0.5]) == Cover((), 0.0)
    assert in_s(Library(2), [0.0, 0.0], [1.0, 0.0]) == Cover((), 0.0)


def beyond(stored: Library, region: int, scene: Scene, a: Array, b: Array, t: float) -> bool:
    """Whether the point of the line straight in q at t is certainly outside of the region, by ball arithmetic of 200 bits."""
    with ctx.workprec(200):
        ways = [arb(x) + (arb(y) - arb(x)) * arb(t) - arb(q) for x, y, q in zip(a.tolist(), b.tolist(), scene.q_star.tolist(), strict=True)]
        s = [(way / 2).tan() for way in ways]
        polytope = stored.polytope(region)
        values = (sum((arb(x) * y for x, y in zip(c, s, strict=True)), arb(0)) for c in polytope.C.tolist())
        return any(value > arb(d) for value, d in zip(values, polytope.d.tolist(), strict=True))


@settings(max_examples=60)
@given(seed=SEEDS, n=st.integers(1, 4), count=st.integers(1, 8))
def test_no_point_of_a_piece_in_q_is_outside_of_its_region_and_no_piece_could_go_on_much(seed: int, n: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    stored, scene = cut_boxes(rng, n, count, spread=0.4), arm(n)
    a, b = rng.uniform(-0.8, 0.8, n), rng.uniform(-0.8, 0.8, n)
    found = cover(in_q(stored, scene, a, b))
    for piece in found.pieces:
        for t in [*np.linspace(piece.begin, piece.end, 30), piece.begin, piece.end]:
            assert not beyond(stored, piece.region, scene, a, b, float(t))
    if found.uncovered is not None:
        after = min(found.uncovered + 1e-9, 1.0)
        assert all(beyond(stored, region, scene, a, b, after) for region in range(count))


def test_a_curve_that_leaves_a_region_between_its_ends_is_not_covered() -> None:
    """In s, the motion straight in q bends across the face on which both of its ends lie, on one of its two sides."""
    scene = arm(2)
    a, b = np.array([0.2, 0.4]), np.array([1.2, 0.9])
    s = scene.to_s(np.array([a, b]))
    normal = np.array([-(s[1] - s[0])[1], (s[1] - s[0])[0]])
    middle = scene.to_s((a + b) / 2) @ normal
    level = s[0] @ normal
    assert abs(middle - level) > 1e-3
    eye, limits = np.eye(2), np.full(4, 1.5)
    for sign in (1.0, -1.0):
        C, d = np.concatenate([sign * normal[None], eye, -eye]), np.concatenate([[sign * level + 1e-9], limits])
        stored = library(StoredRegion("half", "exact", C, d, np.full(2, -1.5), np.full(2, 1.5)))
        assert (cover(in_q(stored, scene, a, b)).uncovered is None) == (sign * middle < sign * level)


@pytest.mark.parametrize(("off", "covered"), [(HAIR, True), (-HAIR, False)])
def test_a_motion_in_q_that_ends_a_hair_before_a_face_is_covered_and_a_hair_beyond_is_not(off: float, covered: bool) -> None:
    scene, end = arm(1), 0.7
    stored = library(box("a", [-1.0], [float(np.tan(end / 2)) + off]))
    found = cover(in_q(stored, scene, np.array([0.1]), np.array([end])))
    assert (found.uncovered is None) is covered
    if not covered:
        assert found.uncovered == pytest.approx(1.0, abs=1e-10)


def test_a_motion_in_q_is_covered_across_regions_that_overlap_by_little() -> None:
    stored = library(box("a", [-1.0], [0.2]), box("b", [0.2 - 1e-10], [1.0]), box("c", [1.0 + 1e-10], [1.2]))
    scene = arm(1)
    found = cover(in_q(stored, scene, np.array([0.0]), np.array([1.0])))
    assert found.uncovered is None
    assert [piece.region for piece in found.pieces] == [0, 1]
    assert found.pieces[0].end == found.pieces[1].begin == pytest.approx(2 * np.arctan(0.2), abs=1e-9)
    far = cover(in_q(stored, scene, np.array([0.0]), np.array([1.7])))
    assert far.uncovered == pytest.approx(2 * np.arctan(1.0) / 1.7, abs=1e-9)


def test_a_joint_that_turns_is_covered_in_any_turn_and_stops_at_its_window() -> None:
    half, pi = np.deg2rad(170), np.pi
    scene = arm(1, -half, half, (-4 * pi, 4 * pi))
    stored = library(box("all", [float(scene.s_lower[0])], [float(scene.s_upper[0])]))

    def goes(a: float, b: float) -> float | None:
        return cover(in_q(stored, scene, np.array([a]), np.array([b]))).uncovered

    assert goes(-1.0, 2.0) is None
    assert goes(2 * pi - 1.0, 2 * pi + 2.0) is None
    assert goes(-2 * pi - 1.0, -2 * pi + 2.0) is None
    assert goes(0.0, 4.0) == pytest.approx(half / 4)
    assert goes(2 * pi, 2 * pi + 4.0) == pytest.approx(half / 4)
    assert goes(2 * pi, 0.0) == pytest.approx(half / (2 * pi))
    assert goes(half - 1e-9, half - 1e-9) is None
    assert goes(np.deg2rad(175), 0.0) == 0.0
    limited = arm(1, -half, half, (None, 2 * pi + 1.0))
    assert cover(in_q(stored, limited, np.array([2 * pi]), np.array([2 * pi + 2.0]))).uncovered == pytest.approx(0.5)


def test_a_path_is_followed_from_waypoint_to_waypoint_with_its_times() -> None:
    scene = arm(2)
    stored = library(box("a", [-0.5, -0.5], [0.5, 0.5]), box("b", [0.3, -0.5], [1.0, 0.5]))
    waypoints = np.array([[0.0, 0.0], [0.25, 0.25], [0.75, 0.0], [0.75, 0.25]])
    found = follow(stored, scene, Space.S, waypoints, [0.0, 1.0, 5.0, 6.0])
    assert found.uncovered is None
    assert [(part.begin, part.end, stored.ids[part.region]) for part in found.stretches] == [(0.0, 3.0, "a"), (3.0, 6.0, "b")]
    gone = follow(stored, scene, Space.S, np.array([[0.0, 0.0], [0.0, 2.0]]), [10.0, 14.0])
    assert gone.uncovered is not None
    assert (gone.uncovered.time, gone.uncovered.segment) == (11.0, 0)
    np.testing.assert_allclose(gone.uncovered.q, [0.0, 2 * np.arctan(0.5)])
    assert gone.uncovered.next is not None
    assert (stored.ids[gone.uncovered.next.region], gone.uncovered.next.distance) == ("b", pytest.approx(0.3))


def test_a_path_beyond_the_limits_says_where_and_has_no_next_region() -> None:
    scene = arm(1, -1.0, 1.0)
    stored = library(box("all", [float(scene.s_lower[0])], [float(scene.s_upper[0])]))
    found = follow(stored, scene, Space.Q, np.array([[0.0], [0.5], [1.5]]), [0.0, 1.0, 2.0])
    assert found.uncovered is not None
    assert (found.uncovered.segment, found.uncovered.time) == (1, pytest.approx(1.5))
    outside = follow(stored, scene, Space.Q, np.array([[2.0], [0.0]]), [0.0, 1.0]).uncovered
    assert outside is not None
    assert (outside.time, outside.s, outside.next) == (0.0, None, None)


@given(seed=SEEDS, along=st.integers(0, 2))
def test_lines_along_axes_and_through_corners_miss_no_box(seed: int, along: int) -> None:
    """All numbers are eighths, so that lines touch faces, edges and corners exactly."""
    rng = np.random.default_rng(seed)
    corners = rng.integers(-4, 5, size=(8, 2, 3)) / 8
    stored = library(*(box(f"r{i}", low, high + 0.125) for i, (low, high) in enumerate(np.sort(corners, axis=1))))
    a, b = rng.integers(-4, 5, size=(2, 3)) / 8
    b[:along] = a[:along]
    line = StraightInS(stored, a, b)
    for t in np.arange(0, 17) / 16:
        held = [r for r in range(8) if stored.polytope(r).contains(a + t * (b - a))]
        found = line.furthest(fmpq(*float(t).as_integer_ratio()))
        assert (found is None) == (not held)
        assert found is None or found[0] in held


def test_a_path_stays_in_the_region_that_it_is_in_for_as_long_as_that_contains_it() -> None:
    """Many waypoints in what two regions have in common; without that, each segment would begin in whichever region comes first."""
    stored = library(box("b", [0.2, 0.0], [1.0, 1.0]), box("a", [0.0, 0.0], [0.8, 1.0]))
    s = np.column_stack([np.linspace(0.1, 0.9, 41), np.full(41, 0.5)])
    found = follow(stored, arm(2), Space.Q, 2 * np.arctan(s), [float(i) for i in range(41)])
    assert [part.region for part in found.stretches] == [1, 0]
    assert found.stretches[0].end == 34.0, "the next segment ends on its face"


def test_a_map_and_a_region_share_a_line_and_the_map_takes_whole_segments(tmp_path: Path) -> None:
    scene = arm(3)
    stored = library(box("a", [-0.5] * 3, [0.1] * 3))
    tree = (0, 0.1, OPEN, PROVED)  # The map proves what is beyond 0.1, and the region ends at 2 atan 0.1.
    free = FreeSet.load(written(tmp_path / "cell.npz", [[tree]]))
    path = np.array([[-0.4, 0.0, 0.0], [0.4, 0.0, 0.0], [0.8, 0.1, 0.0], [-0.4, 0.0, 0.0], [-1.2, 0.0, 0.0]])
    found = follow(stored, scene, Space.Q, path, [0.0, 8.0, 10.0, 22.0, 30.0], free=free)
    ends = [(part.begin, part.end, part.region) for part in found.stretches]
    beyond = 2 * np.arctan(0.1)
    assert [part[2] for part in ends] == [0, 1, 0]
    np.testing.assert_allclose(ends[0][:2], [0.0, 10 * (0.4 + beyond)], atol=1e-6)
    np.testing.assert_allclose(ends[1], [10 * (0.4 + beyond), 10.0 + 12 * 0.7 / 1.2, 1], atol=1e-6)
    assert found.uncovered is not None
    assert found.uncovered.segment == 3
    assert follow(stored, scene, Space.S, np.tan(path / 2), range(5), free=free).stretches[0].region == 0
