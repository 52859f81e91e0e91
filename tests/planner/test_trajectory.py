"""Trajectories: whatever is returned is covered and keeps the limits, and where there is none it is said why."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.errors import RegionError
from certifier.model import Array, Scene
from planner.library import Library
from planner.overlap import beside, overlap
from planner.trajectory import plan as planning
from planner.trajectory.curve import optimised
from planner.trajectory.plan import Answer, Apart, Limits, Outside, Trajectory, Unproved, plan
from planner.trajectory.routes import Links, Terminal, routes
from planner.trajectory.timing import timed
from tests.planner.regions import box, cut_boxes, library
from tests.planner.test_motion import arm

SEEDS = st.integers(0, 2**32 - 1)


def links_of(stored: Library, scene: Scene) -> Links:
    pairs = [(a, b) for b in range(len(stored)) for a in beside(stored, b, range(b))]
    found = [(pair, common) for pair in pairs if (common := overlap(stored, *pair)) is not None]
    ends = np.array([pair for pair, _ in found], dtype=np.intp).reshape(-1, 2)
    witness = np.array([common.witness for _, common in found]).reshape(-1, scene.n)
    return Links(ends, witness, np.array([common.depth for _, common in found]), scene.to_q(witness))


def limits(n: int, speed: float = 1.0, acceleration: float = 2.0) -> Limits:
    return Limits(np.full(n, speed), np.full(n, acceleration))


def planned(stored: Library, scene: Scene, start: Array | int, goal: Array | int, given: Limits | None = None) -> Answer:
    return plan(stored, scene, links_of(stored, scene), start, goal, given or limits(scene.n), optimised)


def assert_sound(stored: Library, scene: Scene, found: Trajectory, given: Limits) -> None:
    """Checks by sampling that the pieces contain the straight lines, and by differences that the limits hold."""
    assert found.stretches[0].begin == found.t[0] == 0
    assert found.stretches[-1].end == found.t[-1]
    assert all(a.end == b.begin for a, b in pairwise(found.stretches))
    for part in found.stretches:
        times = np.unique(
            np.concatenate([np.linspace(part.begin, part.end, 200), found.t[(found.t >= part.begin) & (found.t <= part.end)]])
        )
        q = np.column_stack([np.interp(times, found.t, joint) for joint in found.q.T])
        assert stored.polytope(part.region).contains(scene.to_s(q), tolerance=1e-12).all()
    if found.t[-1] == 0:
        assert (found.q == found.q[0]).all()
        return
    assert (np.diff(found.t) > 0).all()
    step = np.diff(found.t)[:, None]
    velocity = np.diff(found.q, axis=0) / step
    rest = np.zeros((1, scene.n))
    between = np.concatenate([step[:1], (step[:-1] + step[1:]) / 2, step[-1:]])
    change = np.diff(np.concatenate([rest, velocity, rest]), axis=0) / between
    assert (np.abs(velocity) <= given.speed * (1 + 1e-9)).all()
    assert (np.abs(change) <= given.acceleration * (1 + 1e-6)).all()


def chain(rng: np.random.Generator, count: int) -> tuple[Library, Array, Array]:
    """Boxes in the plane, each overlapping the next, at random right angles; and a point of the first and of the last."""
    center, boxes = np.array([-0.5, -0.5]), []
    for i in range(count):
        half = rng.uniform(0.05, 0.3, 2)
        boxes.append(box(f"r{i}", (center - half).tolist(), (center + half).tolist()))
        center = center + half * rng.uniform(0.2, 0.9, 2) * rng.choice([-1, 1], 2)
    ends = [each.lower + rng.uniform(0.02, 0.98, 2) * (each.upper - each.lower) for each in (boxes[0], boxes[-1])]
    return library(*boxes), ends[0], ends[1]


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS, count=st.integers(1, 7), speed=st.floats(0.1, 3), acceleration=st.floats(0.1, 10))
def test_what_is_returned_is_covered_and_keeps_the_limits(seed: int, count: int, speed: float, acceleration: float) -> None:
    rng = np.random.default_rng(seed)
    stored, start, goal = chain(rng, count)
    scene, given_limits = arm(2), limits(2, speed, acceleration)
    q = scene.to_q(np.stack([start, goal]))
    found = planned(stored, scene, q[0], q[1], given_limits)
    assert isinstance(found, Trajectory)
    assert_sound(stored, scene, found, given_limits)
    assert (found.q[[0, -1]] == q).all()
    assert found.length >= np.linalg.norm(q[1] - q[0]) * (1 - 1e-12)


@settings(max_examples=15, deadline=None)
@given(seed=SEEDS, n=st.integers(1, 5), count=st.integers(2, 12))
def test_in_many_dimensions_it_is_so_too_or_there_is_no_route(seed: int, n: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    stored, scene = cut_boxes(rng, n, count), arm(n, -3.0, 3.0)
    inner = [scene.to_q(planning.inner(stored, region)) for region in rng.integers(0, count, 2).tolist()]
    found = planned(stored, scene, inner[0], inner[1])
    if isinstance(found, Apart):
        assert found.gap.distance >= 0
        assert not routes(links_of(stored, scene), *(planning._terminal(stored, scene, q) for q in inner), 1)
    else:
        assert isinstance(found, Trajectory)
        assert_sound(stored, scene, found, limits(n))


CORNER = library(box("a", [0.0, 0.0], [1.0, 0.2]), box("b", [0.8, 0.0], [1.0, 1.0]))
"""Two corridors that meet at a right angle."""


def test_the_robot_does_not_stop_at_a_corner() -> None:
    scene = arm(2)
    found = planned(CORNER, scene, scene.to_q([0.05, 0.1]), scene.to_q([0.9, 0.95]))
    assert isinstance(found, Trajectory)
    assert_sound(CORNER, scene, found, limits(2))
    speeds = np.linalg.norm(np.diff(found.q, axis=0), axis=1) / np.diff(found.t)
    middle = (found.t[1:] > 0.2 * found.t[-1]) & (found.t[1:] < 0.8 * found.t[-1])
    assert speeds[middle].min() > 0.3
    assert found.length < 1.1 * np.linalg.norm(np.diff(scene.to_q([[0.05, 0.1], [0.8, 0.2], [0.9, 0.95]]), axis=0), axis=1).sum()


@pytest.mark.parametrize("depth", [1e-2, 1e-4])
def test_regions_that_hardly_overlap_are_gone_through(depth: float) -> None:
    scene, thin = arm(2), library(box("a", [0.0, 0.0], [1.0, 0.2 + depth]), box("b", [0.8, 0.2 - depth], [1.0, 1.0]))
    found = planned(thin, scene, scene.to_q([0.05, 0.1]), scene.to_q([0.9, 0.95]))
    assert isinstance(found, Trajectory)
    assert_sound(thin, scene, found, limits(2))


def test_a_straight_line_that_is_covered_is_taken() -> None:
    scene, q = arm(2), np.array([[0.1, 0.1], [1.4, 0.2]])
    found = planned(CORNER, scene, q[0], q[1])
    assert isinstance(found, Trajectory)
    assert found.length == pytest.approx(np.linalg.norm(q[1] - q[0]))
    assert found.t[-1] == pytest.approx(1.3 + 0.5, rel=0.02), "1.3 rad at 1 rad/s, half a second of that at either end to get there"


def test_without_an_overlap_the_gap_is_said() -> None:
    scene, apart = arm(2), library(box("a", [0.0, 0.0], [1.0, 0.2]), box("b", [1.1, 0.0], [1.3, 1.0]), box("c", [-0.5, 0.0], [0.1, 0.1]))
    found = planned(apart, scene, scene.to_q([0.5, 0.1]), scene.to_q([1.2, 0.9]))
    assert isinstance(found, Apart)
    assert (found.start, found.goal, found.gap.a, found.gap.b) == (2, 1, 0, 1)
    assert found.gap.distance == pytest.approx(0.1)
    assert [found.gap.s_a[0], found.gap.s_b[0]] == pytest.approx([1.0, 1.1])


@pytest.mark.parametrize(("start", "goal", "end"), [([0.5, 0.5], [0.1, 0.1], "start"), ([0.1, 0.1], [0.5, 0.5], "goal")])
def test_an_end_that_is_not_covered_is_named(start: list[float], goal: list[float], end: str) -> None:
    scene = arm(2)
    found = planned(CORNER, scene, scene.to_q(start), scene.to_q(goal))
    assert isinstance(found, Outside)
    assert found.end == end
    assert found.s == pytest.approx([0.5, 0.5])
    beyond = planned(CORNER, scene, np.array([0.1, 0.1]), np.array([9.0, 0.0]))
    assert beyond == Outside("goal", None)


def test_the_ends_may_be_regions() -> None:
    scene = arm(2)
    q = scene.to_q([0.05, 0.1])
    for start, goal in ((q, 1), (1, q)):
        found = planned(CORNER, scene, start, goal)
        assert isinstance(found, Trajectory)
        assert_sound(CORNER, scene, found, limits(2))
        assert 0.7 < np.ptp(scene.to_s(found.q)[:, 0]) < 0.8, "to the nearest point of the other region"
    for start, goal in ((q, 0), (0, 1), (1, 1)):
        there = planned(CORNER, scene, start, goal)
        assert isinstance(there, Trajectory)
        assert_sound(CORNER, scene, there, limits(2))
        assert there.t[-1] == 0


def test_what_drake_says_is_not_believed() -> None:
    """A curve that leaves the regions is refused, and it is said where."""
    scene, asked = arm(2), []

    def wrong(task: dict[str, object]) -> dict[str, object]:
        asked.append(task)
        return {"q": np.array([scene.to_q([0.05, 0.1]), scene.to_q([0.5, 0.5]), scene.to_q([0.9, 0.95])]), "t": np.array([0.0, 1.0, 2.0])}

    found = plan(CORNER, scene, links_of(CORNER, scene), scene.to_q([0.05, 0.1]), scene.to_q([0.9, 0.95]), limits(2), wrong)
    assert isinstance(found, Unproved)
    assert found.uncovered is not None
    assert 0 < found.uncovered.time < 1
    assert [task["steps"] for task in asked] == [fineness["steps"] for fineness in planning.FINENESS]


def test_a_joint_that_starts_a_turn_away_stays_in_that_turn() -> None:
    scene, turn = arm(2, -3.0, 3.0, own=(None, None)), np.array([2 * np.pi, 0.0])
    here = scene.to_q([[0.05, 0.1], [0.9, 0.95]])
    found = planned(CORNER, scene, here[0] + turn, here[1])
    assert isinstance(found, Trajectory)
    assert (found.q[0] == here[0] + turn).all()
    assert found.q[-1] == pytest.approx(here[1] + turn)


def test_limits_hold_for_the_numbers_of_the_answer_many_turns_away() -> None:
    """At a million radians doubles are 1e-10 apart, which is much of a small step."""
    scene, turns = arm(2, -3.0, 3.0, own=(None, None)), np.array([2 * np.pi * 159_000, 0.0])
    begin, end = np.array([0.1, 0.1]), np.array([0.101, 0.1])

    def at_the_limit(_: dict[str, object]) -> dict[str, object]:
        return {"q": np.linspace(begin, end, 101), "t": np.linspace(0.0, 1.000001e-3, 101)}

    given = limits(2, 1.0, 2e5)
    found = plan(CORNER, scene, links_of(CORNER, scene), begin + turns, end, given, at_the_limit)
    assert isinstance(found, Trajectory)
    assert (found.q[0] == begin + turns).all()
    assert (np.abs(np.diff(found.q, axis=0)) <= np.diff(found.t)[:, None] * given.speed).all()
    assert found.t[-1] == pytest.approx(1e-3, rel=1e-5)


def test_an_end_beyond_what_doubles_tell_is_refused() -> None:
    scene = arm(2, -3.0, 3.0, own=(None, None))
    for start, goal in (([9185166224891948.0, 0.1], [0.1, 0.1]), ([0.1, 0.1], [0.1, -1e300])):
        with pytest.raises(RegionError, match=r"q\[0\]\[[01]\]: .* no number of at most 1e\+06"):
            planned(CORNER, scene, np.array(start), np.array(goal))


@given(seed=SEEDS, count=st.integers(2, 12))
def test_the_first_route_is_the_shortest_of_all(seed: int, count: int) -> None:
    """Compared with every route without repeats, by brute force."""
    rng = np.random.default_rng(seed)
    scene, stored = arm(2), cut_boxes(rng, 2, min(count, 7), spread=0.8)
    links = links_of(stored, scene)
    start, goal = Terminal([0], scene.to_q(rng.uniform(-0.5, 0.5, 2))), Terminal([len(stored) - 1], scene.to_q(rng.uniform(-0.5, 0.5, 2)))

    def shortest(region: int, at: Array, seen: tuple[int, ...]) -> float:
        best = float(np.linalg.norm(at - goal.q)) if region in goal.regions else np.inf
        for e, (a, b) in enumerate(links.ends.tolist()):
            if region in (a, b) and (other := a + b - region) not in seen:
                best = min(best, float(np.linalg.norm(links.q[e] - at)) + shortest(other, links.q[e], (*seen, other)))
        return best

    expected = shortest(0, start.q, (0,))
    found = routes(links, start, goal, 3)
    if not found:
        assert expected == np.inf
        return
    places = np.array([start.q, *links.q[list(found[0].overlaps)], goal.q])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).sum() == pytest.approx(expected)
    for route in found:
        assert (route.regions[0], route.regions[-1]) == (0, len(stored) - 1)
        for (a, b), e in zip(pairwise(route.regions), route.overlaps, strict=True):
            assert {a, b} == set(links.ends[e].tolist())


@pytest.mark.parametrize("slower", [1.0, 1e-6, 1e5])
@pytest.mark.parametrize("limits", [([1.0, 1.0, 1.0], [2.0, 2.0, 2.0]), ([1.0, 1e-4, 1.0], [2.0, 2.0, 1e3])])
def test_a_motion_is_as_fast_as_its_limits_whatever_their_size(slower: float, limits: tuple[list[float], list[float]]) -> None:
    """Who gives limits in other units of time gets the same motion in them."""
    u = np.linspace(0, 1, 60)[:, None]
    curve = np.hstack([np.sin(2 * u), u**2, np.cos(3 * u)])
    speed, acceleration = map(np.array, limits)
    found, slow = (timed(curve, [0, 30, 59], speed / k, acceleration / k**2, 0.05) for k in (1.0, slower))
    assert found is not None
    assert slow is not None
    assert slow[1][-1] == pytest.approx(slower * found[1][-1], rel=1e-6)
    velocity = np.diff(slow[0], axis=0) / np.diff(slow[1])[:, None]
    assert (np.abs(velocity) <= speed / slower).all()
