"""Random instances of the pair program (11), small enough for any solver."""

from __future__ import annotations

import numpy as np

from certifier.kinematics import rotation
from certifier.model import WORLD, Array, Geometry, Joint, JointKind, Pair, Scene
from tests.certifier.scenes import box


def spatial_arm(rng: np.random.Generator, n: int) -> Scene:
    """An arm of n joints about random axes, one in four prismatic, with a box on every link and two in the world.

    Pairs: every link with both obstacles, and links two joints or more apart with each other.
    """
    joints, bodies, links = [], [WORLD], []
    for i in range(n):
        axis = rng.normal(size=3)
        X_PF = np.eye(4)
        X_PF[:3, :3] = _turn(rng)
        X_PF[:3, 3] = 0.0 if i == 0 else rng.normal(size=3) * 0.4
        kind = JointKind.PRISMATIC if rng.random() < 0.25 else JointKind.REVOLUTE
        body = f"arm/link{i}"
        joints.append(Joint(f"arm/joint{i}", kind, bodies[-1], body, axis / np.linalg.norm(axis), X_PF, np.eye(4), i, -2.0, 2.0))
        bodies.append(body)
        links.append(_turned_box(rng, f"{body}/box", body, rng.normal(size=3) * 0.2))
    obstacles = [_turned_box(rng, f"world/box{k}", WORLD, rng.normal(size=3) * 0.7) for k in range(2)]
    pairs = [Pair(link.name, obstacle.name) for link in links for obstacle in obstacles]
    pairs += [Pair(a.name, b.name) for i, a in enumerate(links) for b in links[i + 2 :]]
    return Scene("spatial", tuple(joints), tuple(bodies), (*links, *obstacles), tuple(pairs), (), rng.uniform(-0.4, 0.4, n))


def _turn(rng: np.random.Generator) -> Array:
    axis = rng.normal(size=3)
    return rotation(axis / np.linalg.norm(axis), rng.uniform(-3, 3))


def _turned_box(rng: np.random.Generator, name: str, body: str, center: Array) -> Geometry:
    corners = box(name, body, rng.uniform(0.1, 0.4, 3)).vertices @ _turn(rng).T + center
    return Geometry(name, body, corners, 0.0, {"kind": "box"})


def faces(rng: np.random.Generator, center: Array, size: float) -> tuple[Array, Array]:
    """3n random faces, C (3n, n) and d (3n,), at distances of size to twice that from the centre."""
    n = len(center)
    C = rng.normal(size=(3 * n, n))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    return C, C @ center + size * rng.uniform(1, 2, 3 * n)
