"""The frame of a pair's planes: each joint turns the volume that reaches less far from its axis, and no side gets too many joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from certifier.kinematics import Kinematics
from certifier.model import WORLD, JointKind, Volume
from certifier.partition.frames import MOST_JOINTS, choose_frame
from tests.certifier.scenes import box, planar_arm


def chosen(n, block, kind=JointKind.REVOLUTE):
    """The frame for the arm's last link and a block, and the numbers of joints on the link's and on the block's side."""
    scene = planar_arm(n, block, kind=kind)
    kinematics = Kinematics.of(scene)
    link = next(g for g in scene.geometries if g.body == f"arm/link{n}")
    volumes = Volume.of(link), Volume.of(block)
    frame, joints = choose_frame(kinematics, volumes, np.full(n, -0.5), np.full(n, 0.5))
    assert joints == list(range(n))
    return frame, len(kinematics.chain(frame, link.body)), len(kinematics.chain(frame, block.body))


def test_a_table_does_not_swing_through_the_frame_of_an_arm():
    table = box("world/table", WORLD, (20.0, 20.0, 0.1), (0.0, 0.0, -1.0))
    assert chosen(4, table) == (WORLD, 4, 0)


def test_a_small_body_beside_the_base_takes_the_joints_near_it():
    """Seen from the first joint's axis, the last link reaches farther than a peg beside it. From the last joint's, it reaches less far."""
    peg = box("world/peg", WORLD, (0.02, 0.02, 0.02), (0.1, 0.0, 0.0))
    _, on_link, on_peg = chosen(4, peg)
    assert on_link + on_peg == 4
    assert on_link > 0
    assert on_peg > 0


@pytest.mark.parametrize("n", [MOST_JOINTS, MOST_JOINTS + 2, 2 * MOST_JOINTS])
def test_neither_side_gets_more_joints_than_control_values_can_be_had_for(n):
    table = box("world/table", WORLD, (40.0, 40.0, 0.1), (0.0, 0.0, -1.0))
    _, on_link, on_table = chosen(n, table)
    assert (on_link, on_table) == (MOST_JOINTS, n - MOST_JOINTS)


def test_slides_turn_nothing_so_any_frame_will_do():
    block = box("world/block", WORLD, (1.0, 1.0, 1.0), (5.0, 0.0, 0.0))
    _, on_link, on_block = chosen(3, block, JointKind.PRISMATIC)
    assert on_link + on_block == 3


def test_the_axis_of_a_joint_is_where_the_child_says_it_is():
    """A joint of the same arm that is described from another place on the child comes to the same frame."""
    peg = box("world/peg", WORLD, (0.02, 0.02, 0.02), (0.1, 0.0, 0.0))
    scene = planar_arm(3, peg)
    shift = np.eye(4)
    shift[:3, 3] = (0.0, 5.0, 0.0)
    # The link and its joint frames are moved together in the link's own frame, so nothing moves in the world.
    last = max(scene.joints, key=lambda joint: -1 if joint.index is None else joint.index)
    moved = replace(last, X_BM=shift @ last.X_BM)
    geometries = tuple(replace(g, vertices=g.vertices + shift[:3, 3]) if g.body == last.child else g for g in scene.geometries)
    other = replace(scene, joints=tuple(moved if joint is last else joint for joint in scene.joints), geometries=geometries)
    found = []
    for each in (scene, other):
        link = next(g for g in each.geometries if g.body == last.child)
        found.append(choose_frame(Kinematics.of(each), (Volume.of(link), Volume.of(peg)), np.full(3, -0.5), np.full(3, 0.5)))
    assert found[0] == found[1]
