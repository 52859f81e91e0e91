"""Straight lines of a frame: Drake says where the frame is at thousands of points of the motion."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from certifier.errors import RegionError
from certifier.model import JointKind
from planner.poses.frame import frame_of, pose_at
from planner.poses.inverse import inverse
from planner.poses.line import deviation, keeps, line
from tests.certifier.scenes import planar_arm
from tests.planner.poses import arms

ARMS = ("iiwa_shelf", "ur3e_bin", "gantry", "dual_ur3e", "endless", "fingers")
EACH = 40
ROUNDED = 1e-9
STRETCHED = np.array([0.2, 0.6, 0.1, -1.3, 0.3, 0.9, 0.2])


def way(here, there, u):
    """The pose at a part of the way; the rotation is about one axis, by Drake."""
    turn = (there.rotation() @ here.rotation().inverse()).ToAngleAxis()
    R = RotationMatrix(AngleAxis(u * turn.angle(), turn.axis())) @ here.rotation()
    return RigidTransform(R, (1 - u) * here.translation() + u * there.translation())


def farthest(arm, found, there):
    """The largest metres and radians between the frame and the line at many points of a motion; checks that the frame goes forward."""
    here = arm.pose(found.q[0])
    along = there.translation() - here.translation()
    length = np.linalg.norm(along)
    most, front = np.zeros(2), 0.0
    for (a, u), (b, v) in pairwise(zip(found.q, found.parts, strict=True)):
        for t in np.linspace(0, 1, EACH):
            X = arm.pose(a + t * (b - a))
            most = np.maximum(most, arms.apart(X, way(here, there, u + t * (v - u))))
            if length > 1e-9:
                p = X.translation() - here.translation()
                progress = float(p @ along / length)
                off = np.linalg.norm(p - np.clip(progress, 0, length) * along / length)
                assert off <= found.metres + ROUNDED
                assert progress >= front - 2 * found.metres - ROUNDED
                front = max(front, progress)
    return most


def check(arm, found, there, metres, radians):
    lower, upper = arm.scene.own_limits
    assert (lower <= found.q).all()
    assert (found.q <= upper).all()
    assert (np.diff(found.parts) > 0).all()
    assert found.metres <= metres
    assert found.radians <= radians
    most = farthest(arm, found, there)
    assert most[0] <= found.metres + ROUNDED
    assert most[1] <= found.radians + ROUNDED
    return most


@settings(max_examples=60)
@given(
    st.sampled_from(ARMS),
    st.integers(0, 2**32 - 1),
    st.floats(0.01, 0.4),
    st.floats(0, 1.5),
    st.sampled_from([(1e-2, 0.1), (1e-3, 1e-2), (1e-4, 1e-3), (1, 1e-2), (1e-3, 1)]),
)
def test_all_of_a_motion_is_within_the_tolerance(name, seed, length, angle, tolerance):
    """Whether it goes all along the line or ends before."""
    arm, rng = arms.arm(name), np.random.default_rng(seed)
    start = arm.random(rng, 0.8)
    here, direction, axis = arm.pose(start), rng.normal(size=3), rng.normal(size=3)
    R = RotationMatrix(AngleAxis(angle, axis / np.linalg.norm(axis))) @ here.rotation()
    there = RigidTransform(R, here.translation() + length * direction / np.linalg.norm(direction))
    found = line(arm.scene, arm.frame, start, *arms.given(there), metres=tolerance[0], radians=tolerance[1])
    check(arm, found, there, *tolerance)
    np.testing.assert_array_equal(found.q[0], start)
    assert (found.reason is None) == (found.parts[-1] == 1)
    if found.reason is None:
        assert max(arms.apart(arm.pose(found.q[-1]), there)) < 1e-8


@pytest.mark.parametrize("name", ["iiwa_shelf", "ur3e_bin", "gantry"])
def test_short_lines_away_from_singularities_are_found_and_keep_the_orientation(name):
    arm, rng, count = arms.arm(name), np.random.default_rng(1), 0
    while count < 30:
        start = arm.random(rng, 0.6)
        if arm.conditioned(start) < 0.1:
            continue
        here = arm.pose(start)
        there = RigidTransform(here.rotation(), here.translation() + rng.uniform(-0.02, 0.02, 3))
        found = line(arm.scene, arm.frame, start, there.translation())
        check(arm, found, there, 1e-3, 1e-2)
        assert found.reason is None
        count += 1


def test_the_bounds_are_near_what_samples_find():
    """A bound that is a few times as large as what is bounded would cost waypoints."""
    arm = arms.arm("iiwa_shelf")
    there = RigidTransform(arm.pose(STRETCHED).rotation(), arm.pose(STRETCHED).translation() + np.array([0, 0.25, 0.1]))
    found = line(arm.scene, arm.frame, STRETCHED, there.translation(), metres=1e-3, radians=1e-2)
    most = check(arm, found, there, 1e-3, 1e-2)
    assert found.reason is None
    assert len(found.q) < 12
    assert found.metres < 2 * most[0] or found.radians < 2 * most[1]


def test_a_finer_tolerance_takes_more_waypoints():
    arm = arms.arm("ur3e_bin")
    start = np.array([0.3, -1.2, 1.4, -1.6, -1.2, 0.3])
    goal = arm.pose(start).translation() + np.array([0, 0.1, 0.05])
    counts = [len(line(arm.scene, arm.frame, start, goal, metres=10.0**-k, radians=1.0).q) for k in range(2, 6)]
    assert counts == sorted(set(counts))


def test_a_turn_in_place_stays_in_place():
    arm = arms.arm("iiwa_shelf")
    here = arm.pose(STRETCHED)
    there = RigidTransform(RollPitchYaw(0.3, 0.2, -0.4).ToRotationMatrix() @ here.rotation(), here.translation())
    found = line(arm.scene, arm.frame, STRETCHED, *arms.given(there), metres=1e-4, radians=1e-2)
    assert found.reason is None
    check(arm, found, there, 1e-4, 1e-2)


def test_a_line_to_where_the_frame_is_needs_one_segment():
    arm = arms.arm("iiwa_shelf")
    found = line(arm.scene, arm.frame, STRETCHED, arm.pose(STRETCHED).translation())
    assert found.reason is None
    np.testing.assert_allclose(found.q, [STRETCHED, STRETCHED], rtol=0, atol=1e-8)


@pytest.mark.parametrize(("reach", "reason"), [(0.04, None), (0.8, "singular")])
def test_a_line_out_of_the_workspace_ends_where_the_arm_is_stretched(reach, reason):
    """Away from the shoulder; the twin ends within reach."""
    arm = arms.arm("endless")
    start = np.array([0.1, 0.6, 1.2, -0.4, 0.5, 0.2])
    here = arm.pose(start)
    out = here.translation() - [0, 0, 0.15]
    there = RigidTransform(here.rotation(), here.translation() + reach * out / np.linalg.norm(out))
    found = line(arm.scene, arm.frame, start, there.translation())
    check(arm, found, there, 1e-3, 1e-2)
    assert found.reason == reason
    assert found.parts[-1] == 1 if reason is None else 0 < found.parts[-1] < 1


@pytest.mark.parametrize(("beside", "reason"), [(0.25, None), (0.0, "singular")])
def test_a_line_through_the_column_ends_where_no_tolerance_of_space_helps(beside, reason):
    """Past the axis of an arm whose first joint turns without an end; through the axis, that joint had to turn at once."""
    arm = arms.arm("endless")
    ways = inverse(arm.scene, arm.frame, [0.25, beside, 0.25], [0, np.pi, 0], np.array([0.0, 0.5, 1.0, 1.0, 0.2, 0.0]), lambda q: True)
    there = RigidTransform(RollPitchYaw(0, np.pi, 0), [-0.25, beside, 0.25])
    ends = [line(arm.scene, arm.frame, start, there.translation(), metres=1e-2, radians=0.1) for start in ways.q]
    for found in ends:
        check(arm, found, there, 1e-2, 0.1)
    reasons = {found.reason for found in ends}
    assert reason in reasons
    assert (None in reasons) == (reason is None)


def test_a_tolerance_that_needs_shorter_segments_than_there_are_is_named():
    """An arm with links of 30 km draws a line of 20 km to a micrometre; to a metre it can."""
    turn = JointKind.REVOLUTE
    scene = arms.chain_of("long", [(turn, (0, 0, 1), (-3.0, 3.0), arms.placed((3e4 if k else 0.0, 0, 0))) for k in range(3)])
    arm, start = arms.Arm(scene, "long/tool"), np.array([0.0, 1.0, -0.5])
    there = RigidTransform(arm.pose(start).rotation(), arm.pose(start).translation() + np.array([0, -2e4, 0]))
    fine, coarse = (line(scene, arm.frame, start, there.translation(), metres=metres, radians=1e-2) for metres in (1e-6, 1.0))
    assert (fine.reason, coarse.reason) == ("tolerance", None)
    check(arm, coarse, there, 1.0, 1e-2)


@pytest.mark.parametrize(("goal", "reason", "joint"), [(0.9, None, None), (1.1, "limit", "gantry/j0")])
def test_a_line_beyond_a_slides_limit_names_the_joint(goal, reason, joint):
    """Only the first slide goes along x; what others could add is a few millimetres."""
    whole = arms.arm("gantry").scene
    lower, upper = ([-1.0, -0.7, -1e-3, 0.0, -1e-3, -1e-3, -1e-3], [1.0, 0.7, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])
    joints = tuple(replace(joint, lower=a, upper=b) for joint, a, b in zip(whole.joints, lower, upper, strict=True))
    arm, start = arms.Arm(replace(whole, joints=joints), "gantry/tool"), np.zeros(7)
    there = RigidTransform(arm.pose(start).rotation(), arm.pose(start).translation() + np.array([goal, 0, 0]))
    found = line(arm.scene, arm.frame, start, there.translation(), metres=1e-3, radians=1e-3)
    check(arm, found, there, 1e-3, 1e-3)
    assert (found.reason, found.joint) == (reason, joint)
    if reason:
        assert found.parts[-1] * goal == pytest.approx(1.0, abs=0.01)


def test_a_start_outside_the_limits_is_no_beginning():
    arm = arms.arm("iiwa_shelf")
    start = STRETCHED.copy()
    start[3] = -2.5
    found = line(arm.scene, arm.frame, start, [0.5, 0, 0.5])
    assert (found.reason, found.joint, len(found.q)) == ("limit", "iiwa/joint_4", 1)


@pytest.mark.parametrize(("metres", "radians", "field"), [(0, 0.1, "metres"), (np.nan, 0.1, "metres"), (0.1, 1e-9, "radians")])
def test_a_tolerance_below_rounding_is_refused(metres, radians, field):
    arm = arms.arm("iiwa_shelf")
    with pytest.raises(RegionError) as refused:
        line(arm.scene, arm.frame, STRETCHED, [0.5, 0, 0.5], metres=metres, radians=radians)
    assert (refused.value.code, refused.value.field) == ("tolerance", field)


def test_a_motion_that_only_turns_the_frame_keeps_to_its_line():
    scene = planar_arm(2)
    start, goal = np.radians([-20.0, 10.0]), np.radians([-20.0, 40.0])
    there = {"position": [np.cos(start[0]), np.sin(start[0]), 0.0], "rpy": [0.0, 0.0, goal.sum()]}
    found = line(scene, "link2", start, **there, metres=1e-3, radians=1e-2)
    assert found.reason is None
    assert keeps(scene, "link2", start, **there, q=found.q, metres=1e-3, radians=1e-2)
    assert not keeps(scene, "link2", start, **there, q=np.array([start, start + np.array([0.02, 0.0]), goal]), metres=1e-3, radians=1e-2)


@given(st.integers(0, 2**32 - 1))
def test_a_slide_that_is_faster_counts_as_one_that_goes_farther(seed):
    """One finger slides 2.5 times as far as the other, or alone, by 2.5 times its positions."""
    scene = arms.arm("fingers").scene
    still = replace(scene.joint_above["fingers/one"], kind=JointKind.WELD, axis=np.zeros(3), index=None, lower=None, upper=None)
    other = scene.joint_above["fingers/two"]
    alone = replace(other, axis=other.axis / 2.5, lower=2.5 * other.lower, upper=2.5 * other.upper, follows=False)
    plain = replace(scene, joints=tuple({still.name: still, alone.name: alone}.get(joint.name, joint) for joint in scene.joints))
    found = []
    for one, times in ((scene, np.ones(4)), (plain, np.array([1.0, 1.0, 2.5, 1.0]))):
        frame, places = frame_of(one, "fingers/tip"), np.random.default_rng(seed).uniform(-0.3, 0.3, (2, 4)) * times
        poses = [pose_at(frame, q) for q in (places[0], places.mean(axis=0), places[1])]
        found.append(deviation(frame, *places, *poses, 0.1))
    assert found[0] == pytest.approx(found[1], rel=1e-12)
    assert frame_of(scene, "fingers/tip").levers[2] == 2.5 * frame_of(plain, "fingers/tip").levers[2] == pytest.approx(2.5)
