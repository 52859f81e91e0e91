"""Random small arms with joints of every kind: some turn a whole turn, some slide a millimetre, some a kilometre."""

from __future__ import annotations

import itertools

import numpy as np

from certifier.kinematics import rotation
from certifier.model import WORLD, Array, Geometry, Joint, JointKind, Pair, Scene

WINDOW = np.radians(170.0)
"""A joint that turns a whole turn has a window of this to either side of its middle."""


def mixed_arm(rng: np.random.Generator, n: int, longest: float = 1e3) -> Scene:
    """An arm of n joints about or along random axes among two to four obstacles, of boxes and balls.

    Args:
        longest: a slide goes as far as this, in metres, and one in ten goes 0.001 of its usual way or 1000 times as far.
    """
    joints, bodies, links = [], [WORLD], []
    for i in range(n):
        turns = rng.random() < 0.7
        if turns:
            lower, upper = (-WINDOW, WINDOW) if rng.random() < 0.4 else (-rng.uniform(0.3, 2.9), rng.uniform(0.3, 2.9))
        else:
            scale = min(longest, float(rng.choice([1.0, 1e-3, 1e3], p=[0.8, 0.1, 0.1])))
            lower, upper = -scale * rng.uniform(0.1, 1), scale * rng.uniform(0.1, 1)
        axis, X_PF = rng.normal(size=3), np.eye(4)
        X_PF[:3, :3] = rotation(_unit(rng), rng.uniform(-1, 1))
        X_PF[:3, 3] = 0.0 if i == 0 else rng.normal(size=3) * 0.2
        kind = JointKind.REVOLUTE if turns else JointKind.PRISMATIC
        joints.append(Joint(f"arm/j{i}", kind, bodies[-1], f"arm/l{i}", axis / np.linalg.norm(axis), X_PF, np.eye(4), i, lower, upper))
        bodies.append(f"arm/l{i}")
        links.append(_body(rng, f"arm/l{i}/body", f"arm/l{i}", rng.normal(size=3) * 0.15, 0.1))
    obstacles = [_body(rng, f"world/o{k}", WORLD, _unit(rng) * rng.uniform(0.3, 0.9), 0.3) for k in range(rng.integers(2, 5))]
    pairs = [Pair(link.name, obstacle.name) for link in links for obstacle in obstacles]
    pairs += [Pair(a.name, b.name) for i, a in enumerate(links) for b in links[i + 2 :]]
    q_star = np.array([0.0 if joint.upper == WINDOW else (joint.lower + joint.upper) / 2 for joint in joints])
    return Scene("mixed", tuple(joints), tuple(bodies), (*links, *obstacles), tuple(pairs), (), q_star)


def _unit(rng: np.random.Generator) -> Array:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def _body(rng: np.random.Generator, name: str, body: str, center: Array, size: float) -> Geometry:
    if rng.random() < 0.3:
        radius = float(rng.uniform(0.0001, size / 2))
        return Geometry(name, body, center[None], radius, {"kind": "sphere", "radius": radius})
    edges = np.where(rng.random(3) < 0.15, 1e-4, rng.uniform(size / 4, size, 3))
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * edges
    return Geometry(name, body, corners @ rotation(_unit(rng), rng.uniform(-3, 3)).T + center, 0.0, {"kind": "box"})
