"""Chains of joints lead from a plane's frame to a body. How far its points can be from the joints' axes bounds how they move."""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.kinematics import Kinematics, rigid_inverse
from certifier.model import Array


class Chain(NamedTuple):
    """A chain leads from a frame to a body, over m joints: X = L_0 J_0 L_1 J_1 ... L_m, with fixed poses L and the joints' motions J.

    Attributes:
        rotations: (m + 1, 3, 3) of the fixed poses.
        offsets: (m + 1, 3) of the fixed poses, metres.
        axes: (m, 3) as the scene has them; that of a joint that is crossed from child to parent is reversed.
        joints: (m,) position indices.
        speeds: (m,) of the prismatic joints (certifier.model.Joint.speed); 0 for revolute ones.
    """

    rotations: Array
    offsets: Array
    axes: Array
    joints: np.ndarray
    speeds: Array


class Lengths(NamedTuple):
    """Holds the lengths on a chain, in metres, from which levers follow.

    Attributes:
        offsets: (m,) of the fixed pose before each joint.
        across: (m,) of the part of it that is across the axis of the joint before, where that turns; 0 for the first joint.
        tail: how far a vertex is from the origin of the last joint's frame at most.
        tail_across: how far a vertex is from the last joint's axis at most; 0 where there is no joint.
        size: the sum of all lengths on the way from the frame to a vertex, but for what prismatic joints add.
    """

    offsets: Array
    across: Array
    tail: float
    tail_across: float
    size: float


@lru_cache(maxsize=1 << 12)
def chain(kinematics: Kinematics, frame: str, body: str) -> Chain:
    """Returns the chain from a body's frame to a body, which is made once and kept."""
    fixed, links, axes, moving = np.eye(4), [], [], []
    for here, there in itertools.pairwise(kinematics.bodies_between(frame, body)):
        joint = kinematics.scene.joint_above.get(here)
        upwards = joint is not None and joint.parent == there
        if joint is None or not upwards:
            joint = kinematics.scene.joint_above[there]
        first, last = (joint.X_BM, joint.X_PF) if upwards else (joint.X_PF, joint.X_BM)
        fixed = fixed @ first
        if joint.index is not None:
            links.append(fixed)
            axes.append(-joint.axis if upwards else joint.axis)
            moving.append(joint)
            fixed = np.eye(4)
        fixed = fixed @ rigid_inverse(last)
    poses = np.array([*links, fixed])
    return Chain(
        np.ascontiguousarray(poses[:, :3, :3]),
        np.ascontiguousarray(poses[:, :3, 3]),
        np.array(axes).reshape(-1, 3),
        np.array([joint.index for joint in moving], dtype=np.int64),
        np.array([joint.speed for joint in moving]),
    )


def lengths(chain: Chain, vertices: Array) -> Lengths:
    """Returns the lengths on a chain to vertices, (V, 3) metres in the body's frame."""
    offsets, across = np.linalg.norm(chain.offsets, axis=1), np.zeros(len(chain.joints))
    across[1:] = np.linalg.norm(np.cross(chain.axes[:-1], chain.offsets[1:-1]), axis=1)
    tails = vertices @ chain.rotations[-1].T + chain.offsets[-1]
    return Lengths(
        offsets[:-1],
        across,
        float(np.linalg.norm(tails, axis=1).max()),
        float(np.linalg.norm(np.cross(chain.axes[-1], tails), axis=1).max()) if len(across) else 0.0,
        float(offsets.sum() + np.linalg.norm(vertices, axis=1).max()),
    )


@njit(cache=True)
def fill_levers(
    joints: np.ndarray, speeds: Array, offsets: Array, across: Array, tail: float, tail_across: float, reaches: Array, levers: Array
) -> float:
    """Fills in the levers of a chain, (m,), and returns how far its prismatic joints slide together at most, metres.

    A lever says how far a vertex can be from a joint's axis at most, in metres, and is the speed of a prismatic joint. A change of the
    joint's position moves no vertex farther than by the lever times the change.

    Args:
        joints, speeds: of the chain.
        offsets, across, tail, tail_across: its lengths.
        reaches: (n,) how far each joint's position is from 0 at most.
    """
    # Behind a joint come a fixed offset, of which only the part across the axis counts, and what is behind the next joint.
    lever, behind, slid = tail_across, tail, 0.0
    for k in range(len(joints) - 1, -1, -1):
        levers[k] = speeds[k] if speeds[k] > 0.0 else lever
        if speeds[k] > 0.0:
            behind += speeds[k] * reaches[joints[k]]
            slid += speeds[k] * reaches[joints[k]]
        lever = across[k] + behind
        behind += offsets[k]
    return slid
