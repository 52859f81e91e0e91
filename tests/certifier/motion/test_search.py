"""The search for planes along a motion: what passes, what touches, and where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from benchmarks.arms import random_arm
from certifier.errors import RegionError
from certifier.kinematics import Kinematics
from certifier.model import JointKind
from certifier.motion.given import given, motion_of
from certifier.motion.intervals import RESOLUTION
from certifier.motion.search import search
from certifier.outcome import Outcome
from certifier.proof import limits
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.verify.motion import verify_motion
from tests.certifier.motions import POST, TIP, distances, least_distance, positions, raised, swing
from tests.certifier.scenes import planar_arm


def motion(scene, *waypoints, space=Space.Q):
    points = np.array(waypoints, dtype=float)
    return given(scene, points if space is Space.Q else scene.to_s(points), space)


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize("gap", [0.3, 1e-3, 1e-6])
def test_a_motion_that_passes_is_proved_however_near(gap, space):
    scene = swing(gap, padding=0.01)
    found = search(scene, motion(scene, [-1.5], [1.2], space=space))
    assert found.stop is None
    assert 0 < verify_motion(found.proof).gap <= gap * (1 + 1e-6)


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize("depth", [0.0, 1e-6, 1e-3, 0.05])
def test_the_first_contact_is_found_where_geometry_says(depth, space):
    scene = swing(-depth, padding=0.01)
    path = motion(scene, [-1.5], [-1.0], [1.0], space=space)
    found = search(scene, path)
    stop, proved = found.stop, verify_motion(found.proof)
    before, at = (positions(scene, path, 1, [t])[0, 0] for t in (proved.end, stop.time))
    away, reach = 1.0 + TIP + POST + 0.02 - depth, TIP + POST + 0.02
    near, contact = (-np.arccos(min(1.0, (1 + away**2 - r**2) / (2 * away))) for r in (reach + RESOLUTION, reach))
    assert (stop.outcome, stop.piece, stop.pair) == (Outcome.REFUTED, 1, scene.pairs[0])
    assert near - 1e-9 <= at <= contact + 1e-6
    assert before <= at <= before + 1e-6
    assert proved.motion.pieces == 2
    assert not any("all along" in line for line in proved.lines())


def test_a_millimetre_tells_two_motions_apart():
    """The arm reaches for the obstacle and back. Of two such motions, a millimetre apart at the tip, one is proved and one touches."""
    scene = planar_arm(2)
    rest, reaching = np.array([-0.5, -1.0]), np.array([0.6, 0.0])
    free, touching = 0.0, 1.0
    while touching - free > 2e-4:
        middle = (free + touching) / 2
        proved = search(scene, motion(scene, rest, rest + middle * (reaching - rest), rest)).stop is None
        free, touching = (middle, touching) if proved else (free, middle)
    passing, colliding = (motion(scene, rest, rest + share * (reaching - rest), rest) for share in (free, touching))
    vias, tip = np.array([passing.waypoints[1], colliding.waypoints[1]]), np.array([[1.0, 0.0, 0.0]])
    tips = Kinematics.of(scene).points("world", "arm/link2", tip, scene.to_s(vias))
    assert np.linalg.norm(tips[0] - tips[1]) < 1e-3
    assert verify_motion(search(scene, passing).proof).gap > 0
    assert least_distance(scene, passing) > 0
    assert search(scene, colliding).stop.outcome is Outcome.REFUTED
    assert least_distance(scene, colliding) < 1e-6


def test_a_motion_that_begins_in_contact_or_stands_still():
    scene = swing(-0.01)
    found = search(scene, motion(scene, [0.0], [1.0]))
    assert found.proof is None
    assert (found.stop.outcome, found.stop.piece, found.stop.time) == (Outcome.REFUTED, 0, 0.0)
    found = search(scene, motion(scene, [1.0], [1.0], [0.0]))
    assert (found.stop.outcome, found.stop.piece) == (Outcome.REFUTED, 1)
    assert verify_motion(search(scene, motion(scene, [1.0], [1.0])).proof).gap > 0.1


def test_the_earliest_contact_of_all_pairs_is_reported():
    """Link 2 meets the obstacle before link 1 does, whichever of the two pairs comes first."""
    scene = planar_arm(2)
    path = motion(scene, [0.0, -1.5], [1.4, 0.5])
    stop = search(scene, path).stop
    times = np.linspace(0, 1, 4001)
    first = times[np.argmax(distances(scene, positions(scene, path, 0, times)) < 1e-6)]
    assert stop.outcome is Outcome.REFUTED
    assert first - 1 / 4000 <= stop.time <= first
    turned = search(replace(scene, pairs=scene.pairs[::-1]), path)
    assert (turned.stop.pair, turned.stop.time) == (stop.pair, stop.time)
    assert 0 <= stop.time - verify_motion(turned.proof).end < 1e-6


@pytest.mark.parametrize("kind", [JointKind.REVOLUTE, JointKind.PRISMATIC])
@pytest.mark.parametrize("space", Space)
def test_a_tube_is_free_and_nearly_as_wide_as_the_bound_allows(kind, space):
    scene = planar_arm(2, kind=kind)
    path = motion(scene, [-1.2, -0.5], [-0.4, 0.3], [0.1, -0.6], space=space)
    proof = search(scene, path, tube=True).proof
    statement = verify_motion(MotionProof.from_bytes(proof.to_bytes(), scene))
    assert statement.rho == proof.rho > 0.01
    assert any("within" in line for line in statement.lines())
    rng = np.random.default_rng(0)
    for piece in range(path.pieces):
        q = positions(scene, path, piece, rng.uniform(size=500))
        assert distances(scene, q + statement.rho * rng.choice([-1.0, 1.0], q.shape)).min() > 0
    # A tip that turns about one joint moves exactly by the bound.
    swinging = swing(0.2)
    tube = search(swinging, motion(swinging, [1.0], [0.0]), tube=True).proof
    assert 0.9 * 0.2 < tube.rho < 0.2


def test_bodies_nearer_than_doubles_can_tell_are_too_close():
    """The link is a hundred kilometres long, so that its tip is not known to a micrometre."""
    scene = swing(3e-7, length=1e5)
    found = search(scene, motion(scene, [-0.1], [0.1]))
    assert found.stop.outcome is Outcome.TOO_CLOSE
    assert RESOLUTION < found.stop.distance < 1e-6
    assert 0.4 < verify_motion(found.proof).end <= found.stop.time < 0.51


def test_a_search_that_needs_too_many_intervals_says_so(monkeypatch):
    scene = swing(1e-6)
    monkeypatch.setattr(limits, "INTERVALS", 5)
    found = search(scene, motion(scene, [-1.0], [1.0]))
    assert found.stop.outcome is Outcome.INCONCLUSIVE
    assert 0 < verify_motion(found.proof).end <= found.stop.time < 0.5


def test_motions_of_the_wrong_shape_or_beyond_limits_are_refused_with_their_place():
    scene = planar_arm(2)
    for waypoints, code, field in (
        ([[0.0, 0.0]], "motion_shape", "waypoints"),
        ([[0.0], [1.0]], "motion_shape", "waypoints"),
        ([[0.0, 0.0], [0.0]], "motion_shape", "waypoints"),
        ([[0.0, 0.0], [0.0, "x"]], "motion_shape", "waypoints"),
        ([[0.0, 0.0], [0.0, np.nan]], "motion_not_finite", "waypoints[1][1]"),
        ([[0.0, 0.0], [0.0, 0.0], [2.5, 0.0]], "outside_limits", "waypoints[2][0]"),
    ):
        with pytest.raises(RegionError) as refusal:
            given(scene, waypoints, Space.Q)
        assert (refusal.value.code, refusal.value.field) == (code, field)
    limit = scene.to_s([2.0, 2.0])
    assert isinstance(given(scene, [limit, -limit], Space.S), Motion)


def test_a_joint_may_turn_beyond_its_window():
    """The window of s ends 170 degrees from q*; a motion in q goes on."""
    scene = swing(0.01)
    scene = replace(scene, joints=(replace(scene.joints[0], lower=-2.9, upper=2.9, own_limits=(None, 7.0)),))
    assert verify_motion(search(scene, motion(scene, [-8.0], [7.0])).proof).gap > 0
    with pytest.raises(RegionError):
        given(scene, [[0.0], [7.1]], Space.Q)


@pytest.mark.parametrize("seed", range(16))
def test_what_is_said_of_random_arms_is_true(seed):
    """Of arms of revolute and prismatic joints, and of boxes, capsules and balls: by sampling the motion, the tube and the contact."""
    rng = np.random.default_rng(seed)
    scene = random_arm(rng, 4, rounded=seed % 2 == 1)
    start = rng.uniform(-1, 1, (20, 4))
    start = start[np.argmax([distances(scene, q[None])[0] for q in start])]
    end = np.clip(start + rng.normal(size=4), -2, 2)
    way = given(scene, [start, end, start], Space.Q, [*Space][seed // 2 % 2])
    found = search(scene, way, tube=True)
    if found.stop:
        at = positions(scene, way, found.stop.piece, [found.stop.time])
        assert abs(distances(scene, at)[0]) < 1e-6
    if found.proof:
        statement, proof = verify_motion(found.proof), found.proof
        for piece in range(proof.motion.pieces):
            q = positions(scene, proof.motion, piece, rng.uniform(0, proof.end, 40))
            assert distances(scene, q + proof.rho * rng.choice([-1.0, 1.0], q.shape)).min() >= statement.gap - 1e-7


KINDS = (JointKind.REVOLUTE, JointKind.PRISMATIC, None)
"""Of all joints of an arm; None for an arm of both."""


def spline(scene, rng, degree, space, wide=0.8):
    """A random B-spline of three spans within the limits."""
    inner = np.sort(rng.uniform(0.5, 2.5, 2))
    knots = np.concatenate([np.zeros(degree + 1), inner, np.full(degree + 1, 3.0)])
    points = rng.uniform(-wide, wide, (degree + 3, scene.n))
    return motion_of(scene, {"knots": knots, "control_points": points if space is Space.Q else scene.to_s(points)}, space)


@settings(max_examples=60)
@drawn(
    seed=st.integers(0, 2**32 - 1), degree=st.integers(2, 7), space=st.sampled_from(Space), kind=st.sampled_from(["turn", "slide", "any"])
)
def test_what_is_said_of_splines_is_true(seed, degree, space, kind):
    """By sampling the motion and the tube; a motion that is certified has its twin that touches, which passes where an obstacle is put."""
    rng = np.random.default_rng(seed)
    scene = (
        random_arm(rng, 3, rounded=True)
        if kind == "any"
        else planar_arm(2, kind=JointKind.REVOLUTE if kind == "turn" else JointKind.PRISMATIC)
    )
    way = spline(scene, rng, degree, space)
    found = search(scene, way, tube=True)
    if found.stop:
        assert found.stop.outcome is Outcome.REFUTED
        assert abs(distances(scene, positions(scene, way, found.stop.piece, [found.stop.time]))[0]) < 1e-6 or found.stop.time == 0.0
    else:
        verified = verify_motion(MotionProof.from_bytes(found.proof.to_bytes(), scene))
        assert (verified.motion.pieces, verified.end) == (way.pieces, 1.0)
        assert found.proof.rho > 0
    if found.proof:
        proof = found.proof
        statement = verify_motion(proof)
        last = proof.motion.pieces - 1
        for piece in range(proof.motion.pieces):
            q = positions(scene, proof.motion, piece, rng.uniform(0, proof.end if piece == last else 1.0, 60))
            assert distances(scene, q + proof.rho * rng.choice([-1.0, 1.0], q.shape)).min() >= statement.gap - 1e-7
        # The twin: padding that the motion does not have room for.
        least = distances(scene, positions(scene, proof.motion, last, np.linspace(0, proof.end, 50))).min()
        thick = replace(scene, padding=scene.padding + least / 2 + 1e-6)
        assert search(thick, way).stop is not None


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize("degree", [2, 3, 8, 15])
@pytest.mark.parametrize("gap", [0.05, 1e-6, -1e-6, -0.05])
def test_a_straight_motion_of_any_degree_has_the_answer_of_degree_1(degree, space, gap):
    scene = swing(gap, padding=0.01)
    straight = motion(scene, [-1.5], [-1.0], [0.9], space=space)
    curve = raised(straight, degree)
    one, other = search(scene, straight), search(scene, curve)
    assert (one.stop is None) == (other.stop is None) == (gap > 0)
    if gap > 0:
        assert verify_motion(other.proof).gap == pytest.approx(verify_motion(one.proof).gap, rel=1e-3, abs=1e-9)
        assert len(other.proof.ends) == pytest.approx(len(one.proof.ends), rel=0.1, abs=2)
        return
    assert (other.stop.outcome, other.stop.piece, other.stop.pair) == (one.stop.outcome, one.stop.piece, one.stop.pair)
    assert other.stop.time == pytest.approx(one.stop.time, abs=1e-6)
    assert verify_motion(other.proof).end == pytest.approx(verify_motion(one.proof).end, abs=1e-6)


@pytest.mark.parametrize(("above", "passes"), [(1e-5, True), (-1e-5, False)])
def test_a_parabola_passes_a_post_or_touches_it_by_where_its_top_is(above, passes):
    """The arm swings to a post and back. The control point is far beyond the contact, and the motion's top a hair before or behind it."""
    scene, reach, away = swing(-0.05), TIP + POST, 1.0 + TIP + POST - 0.05
    contact = -np.arccos((1 + away**2 - reach**2) / (2 * away))
    top = contact - above
    found = search(scene, motion_of(scene, {"bezier": [[[-1.0], [2 * top + 1.0], [-1.0]]]}))
    assert 2 * top + 1.0 > contact + 0.5
    assert (found.stop is None) is passes
    if passes:
        assert verify_motion(found.proof).gap == pytest.approx(distances(scene, np.array([[top]]))[0], rel=0.5)
    else:
        assert found.stop.time == pytest.approx(0.5 - np.sqrt(-above / (top + 1)) / 2, abs=1e-4)
