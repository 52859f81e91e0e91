"""These arms are made of numbers: random ones to compare verdicts, regular ones to measure how the cost grows."""

from __future__ import annotations

import itertools

import numpy as np

from certifier.kinematics import rotation
from certifier.model import WORLD, Array, Geometry, Joint, JointKind, Pair, Scene


def box(name: str, body: str, size: Array, center: Array, R: Array | None = None) -> Geometry:
    """Returns a box on a body, in the body's frame.

    Args:
        size: (3,) edges in metres.
        center: (3,) centre in metres.
        R: (3, 3) rotation of the box; None for none.
    """
    corners = np.array(list(itertools.product(*((-x / 2, x / 2) for x in size))))
    return Geometry(name, body, corners @ (np.eye(3) if R is None else R).T + center, 0.0, {"kind": "box"})


def random_arm(rng: np.random.Generator, n: int, rounded: bool = False) -> Scene:
    """Returns an arm of n joints about random axes, one in four prismatic, with a body on every link and two bodies in the world.

    Its pairs are every link with both obstacles, and links two joints or more apart with each other.

    Args:
        rounded: True makes half of the bodies balls and capsules; otherwise all are boxes.
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
        links.append(_random_box(rng, f"{body}/body", body, rng.normal(size=3) * 0.2))
    obstacles = [_random_box(rng, f"world/body{k}", WORLD, rng.normal(size=3) * 0.7) for k in range(2)]
    q_star = rng.uniform(-0.4, 0.4, n)
    if rounded:
        links, obstacles = ([_rounded(rng, body) for body in some] for some in (links, obstacles))
    pairs = [Pair(link.name, obstacle.name) for link in links for obstacle in obstacles]
    pairs += [Pair(a.name, b.name) for i, a in enumerate(links) for b in links[i + 2 :]]
    return Scene("random", tuple(joints), tuple(bodies), (*links, *obstacles), tuple(pairs), (), q_star)


def random_faces(rng: np.random.Generator, center: Array, size: float) -> tuple[Array, Array]:
    """Returns 3n random faces, C (3n, n) and d (3n,), at distances from the centre between size and twice that."""
    n = len(center)
    C = rng.normal(size=(3 * n, n))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    return C, C @ center + size * rng.uniform(1, 2, 3 * n)


def serial_arm(n: int, obstacles: list[Geometry]) -> Scene:
    """Returns an arm of n joints, by turns about z and y, with links 0.25 m long, among obstacles.

    Its pairs are every link with every obstacle.
    """
    joints, bodies, links = [], [WORLD], []
    for i in range(n):
        X_PF = np.eye(4)
        X_PF[2, 3] = 0.25 if i else 0.0
        body = f"arm/link{i + 1}"
        axis = np.array([0.0, i % 2, 1 - i % 2])
        joints.append(Joint(f"arm/joint{i + 1}", JointKind.REVOLUTE, bodies[-1], body, axis, X_PF, np.eye(4), i, -2.5, 2.5))
        bodies.append(body)
        links.append(box(f"{body}/bar", body, np.array([0.08, 0.08, 0.22]), np.array([0.0, 0.0, 0.125])))
    pairs = tuple(Pair(link.name, obstacle.name) for link in links for obstacle in obstacles)
    return Scene(f"arm of {n}", tuple(joints), tuple(bodies), (*links, *obstacles), pairs, (), np.zeros(n))


def _turn(rng: np.random.Generator) -> Array:
    axis = rng.normal(size=3)
    return rotation(axis / np.linalg.norm(axis), rng.uniform(-3, 3))


def _random_box(rng: np.random.Generator, name: str, body: str, center: Array) -> Geometry:
    return box(name, body, rng.uniform(0.1, 0.4, 3), center, _turn(rng))


def _rounded(rng: np.random.Generator, body: Geometry) -> Geometry:
    """Returns the box itself, or a ball or a capsule in its place."""
    count, radius = (0, 1, 0, 2)[rng.integers(4)], float(rng.uniform(0.05, 0.2))
    if count == 0:
        return body
    center, along = body.vertices.mean(axis=0), rng.normal(size=3) * 0.1
    vertices = center[None] if count == 1 else np.array([center - along, center + along])
    return Geometry(body.name, body.body, vertices, radius, {"kind": ("sphere", "capsule")[count - 1]})
