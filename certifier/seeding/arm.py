"""A small arm with a hand. Growing a region of it loads the compiled functions that proposals and growth need."""

from __future__ import annotations

import numpy as np

from certifier.model import WORLD, Geometry, Joint, JointKind, Pair, Scene

JOINTS = 5
"""With this many joints, volumes are chosen that stand for the whole hand (certifier.partition.levels)."""
HAND = f"arm/link{JOINTS - 1}"
"""The body of the hand."""
LIMIT = 0.35
"""The hand touches the post and the floor in so few corners that IRIS soon has them cut off, and enough that samples show them."""
AT, NEAR = (0.0,) * JOINTS, (0.05,) * JOINTS
"""Two free configurations that see each other."""


def arm() -> Scene:
    """Returns an arm with a box and a ball as its hand, before a post and above a floor."""
    axes, eye, outwards = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]), np.eye(4), np.eye(4)
    outwards[0, 3] = 0.2
    turns = JointKind.REVOLUTE
    bodies = (WORLD, *(f"arm/link{i}" for i in range(JOINTS)))
    joints = tuple(
        Joint(f"arm/joint{i}", turns, bodies[i], bodies[i + 1], axes[i % 2], outwards, eye, i, -LIMIT, LIMIT) for i in range(JOINTS)
    )
    box = np.array([[x, y, z] for x in (0.1, 0.2) for y in (-0.05, 0.05) for z in (-0.05, 0.05)])
    geometries = (
        Geometry("arm/box", HAND, box, 0.0, {}),
        Geometry("arm/ball", HAND, np.array([[0.3, 0.0, 0.0]]), 0.05, {}),
        Geometry("world/post", WORLD, np.array([[1.1, 0.5, -0.5], [1.1, 0.5, 0.5]]), 0.05, {}),
        Geometry("world/floor", WORLD, np.array([10.0, 10.0, 1.0]) * box - [0.0, 0.0, 0.7], 0.0, {}),
    )
    pairs = tuple(Pair(a, b) for a in ("arm/ball", "arm/box") for b in ("world/floor", "world/post"))
    return Scene("arm", joints, bodies, geometries, pairs, (), np.zeros(JOINTS))
