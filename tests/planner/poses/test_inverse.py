"""Inverse kinematics: Drake says which pose each configuration has, and whether it is free."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.poses.inverse import APART, inverse
from planner.poses.reach import TIGHT
from tests.oracles.clearance import DrakesClearance
from tests.planner.poses import arms

ARMS = ("iiwa_shelf", "ur3e_bin", "dual_ur3e", "planar_2dof", "gantry", "endless")
ROUNDED = 1e-12


def everywhere(q):
    return True


@settings(max_examples=80)
@given(st.sampled_from(ARMS), st.integers(0, 2**32 - 1))
def test_a_pose_that_the_arm_has_somewhere_is_reached(name, seed):
    arm, rng = arms.arm(name), np.random.default_rng(seed)
    goal, start = arm.pose(arm.random(rng)), arm.random(rng)
    found = inverse(arm.scene, arm.frame, *arms.given(goal), start, everywhere, seconds=60)
    lower, upper = arm.scene.own_limits
    assert found.reason is None
    assert len(found.q) >= 1
    for q in found.q:
        assert max(arms.apart(arm.pose(q), goal)) <= TIGHT + ROUNDED
        assert (lower <= q).all()
        assert (q <= upper).all()
    far = np.linalg.norm(found.q - start, axis=1)
    assert (np.diff(far) >= 0).all()
    np.testing.assert_array_equal(found.nearest, found.q[0])
    for i, q in enumerate(found.q):
        assert (np.abs(found.q[:i] - q).max(axis=1, initial=0.0) > APART).all()


@settings(max_examples=30)
@given(st.sampled_from(("iiwa_shelf", "ur3e_bin", "gantry", "endless")), st.integers(0, 2**32 - 1))
def test_where_the_robot_is_already_is_the_first_answer(name, seed):
    arm = arms.arm(name)
    start = arm.random(np.random.default_rng(seed))
    found = inverse(arm.scene, arm.frame, *arms.given(arm.pose(start)), start, everywhere, wanted=1)
    np.testing.assert_allclose(found.q, start[None], rtol=0, atol=1e-5)


@settings(max_examples=30)
@given(st.sampled_from(ARMS), st.integers(0, 2**32 - 1))
def test_a_pose_out_of_reach_is_said_to_be_with_the_nearest(name, seed):
    """The same pose farther away than the arm is long."""
    arm, rng = arms.arm(name), np.random.default_rng(seed)
    position, rpy = arms.given(arm.pose(arm.random(rng)))
    away = position + np.array([0, 0, 5])
    found = inverse(arm.scene, arm.frame, away, rpy, arm.random(rng), everywhere)
    assert (found.reason, len(found.q), found.solutions) == ("unreachable", 0, 0)
    goal = arms.RigidTransform(arms.RollPitchYaw(rpy), away)
    np.testing.assert_allclose((found.metres, found.radians), arms.apart(arm.pose(found.nearest), goal), rtol=0, atol=1e-9)
    assert found.metres > 1


@settings(max_examples=15)
@given(st.sampled_from(("iiwa_shelf", "ur3e_bin")), st.integers(0, 2**32 - 1))
def test_only_free_configurations_are_returned(name, seed):
    arm, rng = arms.arm(name), np.random.default_rng(seed)
    drake = DrakesClearance(arm.scene)
    free = next(q for q in (arm.random(rng) for _ in range(10_000)) if drake.free(q))
    found = inverse(arm.scene, arm.frame, *arms.given(arm.pose(free)), arm.random(rng), drake.free, seconds=60)
    assert found.reason is None
    assert all(drake.free(q) for q in found.q)


def test_a_pose_in_the_shelf_is_in_collision_in_all_ways():
    """The last link in the upper board; its twin without collisions is reached."""
    arm = arms.arm("iiwa_shelf")
    drake, start = DrakesClearance(arm.scene), np.array([0, 0.3, 0, -1.5, 0, 0.9, 0])
    asked = (arm.scene, "link_7", [0.76, 0, 0.61], [0, np.pi / 2, 0], start)
    found, twin = inverse(*asked, drake.free), inverse(*asked, everywhere)
    assert (found.reason, len(found.q)) == ("in_collision", 0)
    assert found.solutions > 1
    assert twin.reason is None
    assert max(found.metres, found.radians) <= TIGHT
    assert not drake.free(found.nearest)


def test_an_arm_with_joints_to_spare_gets_different_configurations():
    arm, rng = arms.arm("iiwa_shelf"), np.random.default_rng(4)
    goal = arm.pose(np.array([0.3, 0.5, 0.2, -1.2, 0.4, 0.8, 0.1]))
    found = inverse(arm.scene, arm.frame, *arms.given(goal), arm.random(rng), everywhere, wanted=20)
    assert len(found.q) == 20


def test_joints_that_do_not_move_the_frame_stay():
    arm, rng = arms.arm("dual_ur3e"), np.random.default_rng(5)
    start = arm.random(rng)
    found = inverse(arm.scene, arm.frame, *arms.given(arm.pose(arm.random(rng))), start, everywhere)
    np.testing.assert_array_equal(found.q[:, 6:], np.tile(start[6:], (len(found.q), 1)))


@pytest.mark.parametrize("turns", [-7, 3])
def test_an_endless_joint_is_reached_in_the_turn_in_which_it_starts(turns):
    arm, rng = arms.arm("endless"), np.random.default_rng(6)
    start = arm.random(rng)
    start[[0, 5]] += 2 * np.pi * turns
    goal = arm.pose(arm.random(rng))
    found = inverse(arm.scene, arm.frame, *arms.given(goal), start, everywhere)
    assert (np.abs(found.q - start)[:, [0, 5]] <= np.pi).all()
    assert max(max(arms.apart(arm.pose(q), goal)) for q in found.q) <= TIGHT + ROUNDED


def test_the_same_question_has_the_same_answer():
    arm, rng = arms.arm("ur3e_bin"), np.random.default_rng(7)
    pose, start = arms.given(arm.pose(arm.random(rng))), arm.random(rng)
    once, again = (inverse(arm.scene, arm.frame, *pose, start, everywhere, seconds=60, seed=3) for _ in range(2))
    np.testing.assert_array_equal(once.q, again.q)
