"""Chains of joints lead from a plane's frame to a body. How far its points can be from the joints' axes bounds how they move."""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.kinematics import Kinematics, rigid_inverse
from certifier.model import Array, Geometry, JointKind


class Chain(NamedTuple):
    """A chain leads from a frame to a body, over m joints: X = L_0 J_0 L_1 J_1 ... L_m, with fixed poses L and the joints' motions J.

    Attributes:
        rotations: (m + 1, 3, 3) of the fixed poses.
        offsets: (m + 1, 3) of the fixed poses, metres.
        axes: (m, 3) unit vectors; that of a joint that is crossed from child to parent is reversed.
        joints: (m,) position indices.
        slides: (m,) whether each joint is prismatic.
    """

    rotations: Array
    offsets: Array
    axes: Array
    joints: np.ndarray
    slides: np.ndarray


class Side(NamedTuple):
    """A side is one body of a pair, as its planes' frame sees it.

    Attributes:
        chain: from the planes' frame to the body.
        vertices: (V, 3) metres in the body's frame.
        levers: (P, m) for every piece of the motion, how far a vertex can be from each joint's axis at most, in metres; 1 for a
            prismatic joint. A change of the joint's position moves no vertex farther than by the lever times the change.
        size: metres, the sum of all lengths on the way from the frame to a vertex: what rounding is a part of.
    """

    chain: Chain
    vertices: Array
    levers: Array
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
        np.array([joint.kind is JointKind.PRISMATIC for joint in moving], dtype=np.bool_),
    )


def side(chain: Chain, geometry: Geometry, reaches: Array) -> Side:
    """Returns a geometry's side.

    Args:
        reaches: (P, n) for every piece, how far each joint's position is from 0 at most.
    """
    vertices = np.ascontiguousarray(geometry.vertices)
    levers = np.ones((len(reaches), len(chain.joints)))
    return Side(chain, vertices, levers, _measure(chain, vertices, reaches, levers))


@njit(cache=True)
def _measure(chain: Chain, vertices: Array, reaches: Array, levers: Array) -> float:
    """Fills in the levers of revolute joints and returns the size of a side."""
    m, longest, across, size = len(chain.joints), 0.0, 0.0, 0.0
    for v in range(len(vertices)):
        tail = chain.rotations[m] @ vertices[v] + chain.offsets[m]
        longest = max(longest, _length(tail))
        size = max(size, _length(vertices[v]))
        if m:
            across = max(across, _length(np.cross(chain.axes[m - 1], tail)))
    for k in range(m + 1):
        size += _length(chain.offsets[k])
    farthest = 0.0
    for piece in range(len(reaches)):
        # Behind a joint come a fixed offset, of which only the part across the axis counts, and what is behind the next joint.
        lever, behind, slid = across, longest, 0.0
        for k in range(m - 1, -1, -1):
            if chain.slides[k]:
                behind += reaches[piece, chain.joints[k]]
                slid += reaches[piece, chain.joints[k]]
            else:
                levers[piece, k] = lever
            if k:
                lever = _length(np.cross(chain.axes[k - 1], chain.offsets[k])) + behind
            behind += _length(chain.offsets[k])
        farthest = max(farthest, slid)
    return size + farthest


@njit(cache=True)
def _length(p: Array) -> float:
    return np.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
