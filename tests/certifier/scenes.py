"""Small scenes built from numbers, for tests of the mathematics: no robot files, no Drake."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from certifier.growth.actions import Candidate
from certifier.kinematics import rotation
from certifier.model import WORLD, Geometry, Joint, JointKind, Pair, Scene


def pose(translation=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), angle=0.0):
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = rotation(np.array(axis, dtype=float) / np.linalg.norm(axis), angle), translation
    return X


def box(name, body, size, center=(0.0, 0.0, 0.0)):
    corners = np.array(list(itertools.product(*((-x / 2, x / 2) for x in size)))) + np.array(center)
    return Geometry(name, body, corners, 0.0, {"kind": "box"})


def ball(name, body, radius, center=(0.0, 0.0, 0.0)):
    return Geometry(name, body, np.array([center], dtype=float), radius, {"kind": "sphere"})


def planar_arm(links=2, obstacle=None, q_star=None, limit=2.0, kind=JointKind.REVOLUTE, padding=0.0):
    """Links of length 1 in the xy-plane, a bar on each, and one obstacle in the world; pairs obstacle - bar for every link."""
    joints, bodies, geometries = [], [WORLD], []
    for i in range(links):
        parent = WORLD if i == 0 else f"arm/link{i}"
        body = f"arm/link{i + 1}"
        X_PF = pose((0.0 if i == 0 else 1.0, 0.0, 0.0))
        joints.append(Joint(f"arm/joint{i + 1}", kind, parent, body, np.array([0.0, 0.0, 1.0]), X_PF, np.eye(4), i, -limit, limit))
        bodies.append(body)
        geometries.append(box(f"{body}/bar", body, (1.0, 0.1, 0.1), (0.5, 0.0, 0.0)))
    obstacle = obstacle or box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (1.5, 1.0, 0.0))
    pairs = tuple(Pair(*sorted((g.name, obstacle.name))) for g in geometries)
    center = np.zeros(links) if q_star is None else np.array(q_star, dtype=float)
    return Scene("planar", tuple(joints), tuple(bodies), (*geometries, obstacle), pairs, (), center, padding)


def beads(count=4, spacing=0.25, radius=0.08, obstacle=None, lean=(0.0, 0.0)):
    """A planar arm of two links, each of them a row of balls, and an obstacle; pairs ball - obstacle.

    Args:
        lean: how much larger the last ball of either link is than the others, in metres.
    """
    obstacle = obstacle or box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 1.5, 0.0))
    arm = planar_arm(2, obstacle)
    radii = {link: [radius] * (count - 1) + [radius + lean[link - 1]] for link in (1, 2)}
    balls = [
        ball(f"arm/link{link}/ball{i}", f"arm/link{link}", radii[link][i], (spacing * (0.5 + i), 0.0, 0.0))
        for link in (1, 2)
        for i in range(count)
    ]
    pairs = tuple(Pair(one.name, obstacle.name) for one in balls)
    return replace(arm, geometries=(*balls, obstacle), pairs=pairs)


def hand(obstacle=None, seed=0):
    """A planar arm of two links with a hand: a palm, a camera and two fingers, bodies that are welded to the last link at odd angles.

    Pairs are those of the hand's four boxes with the obstacle.
    """
    obstacle = obstacle or box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 1.9, 0.0))
    arm, rng = planar_arm(2, obstacle), np.random.default_rng(seed)
    joints, geometries, parent = [*arm.joints], [], "arm/link2"
    places = {"palm": (1.0, 0.0, 0.0), "camera": (0.05, 0.0, 0.1), "left": (0.1, 0.1, 0.0), "right": (0.1, -0.1, 0.0)}
    for name, place in places.items():
        body = f"hand/{name}"
        fixed = pose(place, rng.normal(size=3), rng.uniform(-0.5, 0.5))
        joints.append(Joint(f"weld {name}", JointKind.WELD, parent, body, np.zeros(3), fixed, np.eye(4), None, 0.0, 0.0))
        geometries.append(box(f"{body}/box", body, (0.1, 0.05, 0.04), (0.02, 0.0, 0.0)))
        parent = "hand/palm"
    pairs = tuple(Pair(one.name, obstacle.name) for one in geometries)
    bodies = (*arm.bodies, *(geometry.body for geometry in geometries))
    return replace(arm, joints=tuple(joints), bodies=bodies, geometries=(*geometries, obstacle), pairs=pairs)


def two_arms(links=3, apart=7.0, limit=2.0):
    """Two arms of links of length 1 in the xy-plane that reach for each other from ``apart`` metres; pairs left bar - right bar."""
    joints, bodies, geometries = [], [WORLD], []
    for arm, X_base in (("left", pose((-apart / 2, 0.0, 0.0))), ("right", pose((apart / 2, 0.0, 0.0), angle=np.pi))):
        for i in range(links):
            parent, body = WORLD if i == 0 else f"{arm}/link{i}", f"{arm}/link{i + 1}"
            X_PF = X_base if i == 0 else pose((1.0, 0.0, 0.0))
            axis, index = np.array([0.0, 0.0, 1.0]), len(joints)
            joints.append(Joint(f"{arm}/joint{i + 1}", JointKind.REVOLUTE, parent, body, axis, X_PF, np.eye(4), index, -limit, limit))
            bodies.append(body)
            geometries.append(box(f"{body}/bar", body, (1.0, 0.1, 0.1), (0.5, 0.0, 0.0)))
    pairs = tuple(Pair(a.name, b.name) for a in geometries[:links] for b in geometries[links:])
    return Scene("two arms", tuple(joints), tuple(bodies), tuple(geometries), pairs, (), np.zeros(2 * links))


def random_tree(seed, kinds=(JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.WELD), bodies=6):
    """A random tree with offset frames and every joint kind; no geometry."""
    rng = np.random.default_rng(seed)
    names, joints, position = [WORLD], [], 0
    for i in range(bodies):
        kind = kinds[i % len(kinds)]
        axis = rng.normal(size=3)
        frames = [pose(rng.normal(size=3), rng.normal(size=3), rng.uniform(-3, 3)) for _ in range(2)]
        moving = kind is not JointKind.WELD
        joints.append(
            Joint(
                f"tree/joint{i}",
                kind,
                names[rng.integers(len(names))],
                f"tree/body{i}",
                axis / np.linalg.norm(axis) if moving else np.zeros(3),
                *frames,
                position if moving else None,
                -1.5 if moving else None,
                1.5 if moving else None,
            )
        )
        names.append(f"tree/body{i}")
        position += moving
    return Scene("tree", tuple(joints), tuple(names), (), (), (), rng.uniform(-0.5, 0.5, position))


def slides_together(tree, seed):
    """The same tree, whose slides all follow the first one, slower or faster than it, and some the other way round."""
    rng, moving, joints = np.random.default_rng(seed), [joint for joint in tree.joints if joint.index is not None], []
    slides = [joint for joint in moving if joint.kind is JointKind.PRISMATIC]
    number = {joint.name: i for i, joint in enumerate(joint for joint in moving if joint not in slides[1:])}
    for joint in tree.joints:
        if joint in slides[1:]:
            speed = rng.choice([-1, 1]) * 10 ** rng.uniform(-1.3, 1.3)
            joint = replace(joint, axis=speed * joint.axis, index=number[slides[0].name], follows=True)
        elif joint.index is not None:
            joint = replace(joint, index=number[joint.name])
        joints.append(joint)
    return replace(tree, joints=tuple(joints), q_star=tree.q_star[: len(number)])


def crowded(count=1000):
    """Returns the arm of one link, with ``count`` balls welded to the link and ``count`` balls welded to the world."""
    scene = planar_arm(1)
    places = [(body, f"{body}/{i}") for body in ("arm/link1", WORLD) for i in range(count)]
    welds = tuple(Joint(f"{name}/weld", JointKind.WELD, body, name, np.zeros(3), pose(), pose()) for body, name in places)
    balls = tuple(ball(f"{name}/ball", name, 0.1) for _, name in places)
    bodies = (*scene.bodies, *(name for _, name in places))
    return replace(scene, joints=(*scene.joints, *welds), bodies=bodies, geometries=(*scene.geometries, *balls))


def cube(scene, center, half):
    """The polytope |s - center|_inf <= half with the joint limits."""
    eye = np.eye(scene.n)
    center = np.broadcast_to(np.asarray(center, dtype=float), (scene.n,))
    return scene.polytope(np.concatenate([eye, -eye]), np.concatenate([center + half, half - center]))


def accepted(polytope, center):
    """What the growth says of a polytope whose pairs are all certified."""
    return Candidate(0, polytope, np.asarray(center, dtype=float), None, None, {})


def obstacle(y, shape="box"):
    """A box or a ball of about 0.3 m that lies y metres beside the middle of a planar arm's reach."""
    if shape == "box":
        return box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, y, 0.0))
    return ball("world/obstacle", WORLD, 0.15, (0.8, y, 0.0))
