"""Frames by their names, and where they are: Drake says so."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from certifier.errors import RegionError
from planner.poses.frame import frame_of, pose_at, pose_of
from tests.planner.poses.arms import apart, arm

ARMS = ("iiwa_shelf", "ur3e_bin", "dual_ur3e", "planar_2dof", "gantry", "endless", "fingers")


def drakes(pose):
    w, x, y, z = pose.turn
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return RigidTransform(RotationMatrix(R), pose.position)


@settings(max_examples=60)
@given(st.sampled_from(ARMS), st.integers(0, 2**32 - 1))
def test_a_frame_is_where_drake_says(name, seed):
    one = arm(name)
    q = one.random(np.random.default_rng(seed))
    assert max(apart(drakes(pose_at(frame_of(one.scene, one.frame), q)), one.pose(q))) < 1e-13


@given(st.tuples(*[st.floats(-7, 7)] * 3))
def test_roll_pitch_and_yaw_are_drakes(rpy):
    theirs = RigidTransform(RollPitchYaw(rpy).ToRotationMatrix(), np.array([1.0, 2.0, 3.0]))
    assert max(apart(drakes(pose_of([1, 2, 3], rpy)), theirs)) < 1e-14


@given(st.sampled_from(("iiwa_shelf", "gantry", "fingers")), st.integers(0, 2**32 - 1))
def test_a_joints_lever_bounds_how_far_the_frame_moves(name, seed):
    one, rng = arm(name), np.random.default_rng(seed)
    frame, q = frame_of(one.scene, one.frame), one.random(np.random.default_rng(seed))
    for lever, joint in zip(frame.levers, frame.joints, strict=True):
        moved = q.copy()
        moved[joint] = one.random(rng)[joint]
        assert np.linalg.norm(one.pose(moved).translation() - one.pose(q).translation()) <= lever * abs(moved[joint] - q[joint]) + 1e-12


def test_a_last_part_that_one_body_has_names_it():
    scene = arm("dual_ur3e").scene
    assert frame_of(scene, "left/wrist_3") is not frame_of(scene, "right/wrist_3")
    iiwa = arm("iiwa_shelf").scene
    np.testing.assert_array_equal(frame_of(iiwa, "link_7").offsets, frame_of(iiwa, "iiwa/link_7").offsets)


@pytest.mark.parametrize(
    ("name", "frame", "code", "hint"),
    [
        ("dual_ur3e", "wrist_3", "ambiguous_frame", "name one of left/wrist_3, right/wrist_3"),
        ("iiwa_shelf", "lnk_7", "unknown_frame", "did you mean iiwa/link_7"),
        ("iiwa_shelf", "hand", "unknown_frame", "name one of iiwa/flange, iiwa/link_7"),
        ("iiwa_shelf", "", "unknown_frame", "name one of iiwa/flange"),
        ("iiwa_shelf", "boards", "fixed_frame", "name one of iiwa/flange"),
        ("iiwa_shelf", "world", "fixed_frame", "name one of iiwa/flange"),
    ],
)
def test_other_names_are_refused_with_those_that_are_meant(name, frame, code, hint):
    with pytest.raises(RegionError) as refused:
        frame_of(arm(name).scene, frame)
    assert (refused.value.code, refused.value.field) == (code, "frame")
    assert refused.value.hint.startswith(hint)


@pytest.mark.parametrize(
    ("position", "rpy", "code", "field"),
    [
        ([1, 2], [0, 0, 0], "wrong_length", "position"),
        ([1, 2, 3], [[0, 0, 0]], "wrong_length", "rpy"),
        ([1, np.nan, 3], [0, 0, 0], "number_too_large", "position[1]"),
        ([1, 2, 3], [0, 0, np.inf], "number_too_large", "rpy[2]"),
    ],
)
def test_what_is_no_pose_is_refused(position, rpy, code, field):
    with pytest.raises(RegionError) as refused:
        pose_of(position, rpy)
    assert (refused.value.code, refused.value.field) == (code, field)
