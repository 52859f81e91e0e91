"""A scene's links, geometries and pairs as arrays, for the compiled loops of this room.

A link is a body with all bodies that are welded to it. Its frame is that of the joint that moves it, so its pose is

    X_WL = X_WP X_PF J(q)

with the parent link P, a fixed pose X_PF, and the motion J of the joint.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from certifier.kinematics import Kinematics, rigid_inverse
from certifier.model import WORLD, Array, Geometry, JointKind, Scene
from certifier.motion.chains import Side, chain, side


class Bodies(NamedTuple):
    """Holds a scene of L links, G geometries with V vertices in all, and P pairs.

    Attributes:
        parents: (L,) number of each link's parent, which is smaller than its own; link 0 is the world.
        joints: (L,) position index of the joint that moves the link.
        slides: (L,) whether that joint is prismatic.
        axes: (L, 3) unit vectors along the joints' axes.
        rotations, offsets: (L, 3, 3) and (L, 3) of the fixed poses X_PF, metres.
        vertices: (V, 3) metres, in the frames of their links.
        first: (G + 1,) where each geometry's vertices begin, and V.
        links: (G,) the link of each geometry.
        centers, sizes: (G, 3) and (G,) of balls that contain the vertices, metres, in the links' frames.
        pairs: (P, 2) numbers of the geometries a and b. The motion of b is looked at from the link of a.
        reaches: (P,) the radii and the padding of both geometries, metres.
        begins: (P + 1,) where each pair's joints begin in the arrays below, and their length.
        chains: (J,) position indices of the joints between a and b.
        sliding: (J,) whether each of them is prismatic.
        levers: (J,) how far a vertex of b moves at most where the joint moves by 1: metres, and 1 for a prismatic joint.
    """

    parents: np.ndarray
    joints: np.ndarray
    slides: np.ndarray
    axes: Array
    rotations: Array
    offsets: Array
    vertices: Array
    first: np.ndarray
    links: np.ndarray
    centers: Array
    sizes: Array
    pairs: np.ndarray
    reaches: Array
    begins: np.ndarray
    chains: np.ndarray
    sliding: np.ndarray
    levers: Array


@lru_cache(maxsize=16)
def bodies_of(scene: Scene, padding: float = 0.0) -> Bodies:
    """Returns the arrays of a scene.

    Args:
        padding: metres that are added around every body, beyond the scene's padding.
    """
    tree = _Tree(scene)
    vertices, centers, sizes = [], [], []
    for geometry in scene.geometries:
        X = tree.inside[geometry.body]
        vertices.append(geometry.vertices @ X[:3, :3].T + X[:3, 3])
        centers.append((vertices[-1].min(axis=0) + vertices[-1].max(axis=0)) / 2)
        sizes.append(np.linalg.norm(vertices[-1] - centers[-1], axis=1).max())
    number = {geometry.name: i for i, geometry in enumerate(scene.geometries)}
    kinematics = Kinematics.of(scene)
    seen = [_seen(kinematics, scene.geometry(pair.a), scene.geometry(pair.b)) for pair in scene.pairs]
    poses = np.array(tree.poses)
    return Bodies(
        parents=np.array(tree.parents),
        joints=np.array(tree.joints),
        slides=np.array(tree.slides),
        axes=np.array(tree.axes),
        rotations=np.ascontiguousarray(poses[:, :3, :3]),
        offsets=np.ascontiguousarray(poses[:, :3, 3]),
        vertices=np.concatenate([np.zeros((0, 3)), *vertices]),
        first=np.concatenate([[0], np.cumsum([len(each) for each in vertices], dtype=np.int64)]),
        links=np.array([tree.links[geometry.body] for geometry in scene.geometries], dtype=np.int64),
        centers=np.array(centers).reshape(-1, 3),
        sizes=np.array(sizes),
        pairs=np.array([(number[a.name], number[b.name]) for a, b, _ in seen], dtype=np.int64).reshape(-1, 2),
        reaches=np.array([a.radius + b.radius + 2 * (scene.padding + padding) for a, b, _ in seen]),
        begins=np.concatenate([[0], np.cumsum([len(one.chain.joints) for _, _, one in seen], dtype=np.int64)]),
        chains=np.concatenate([np.zeros(0, dtype=np.int64), *(one.chain.joints for _, _, one in seen)]),
        sliding=np.concatenate([np.zeros(0, dtype=np.bool_), *(one.chain.slides for _, _, one in seen)]),
        levers=np.concatenate([np.zeros(0), *(one.levers[0] for _, _, one in seen)]),
    )


class _Tree:
    """Numbers the links. ``inside`` has the pose of each body in the frame of its link."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.links, self.inside = {WORLD: 0}, {WORLD: np.eye(4)}
        self.parents, self.joints, self.slides = [0], [0], [False]
        self.axes, self.poses = [np.zeros(3)], [np.eye(4)]
        for body in scene.bodies:
            self._add(body)

    def _add(self, body: str) -> None:
        if body in self.links:
            return
        joint = self._scene.joint_above[body]
        self._add(joint.parent)
        pose = self.inside[joint.parent] @ joint.X_PF
        if joint.index is None:
            self.links[body] = self.links[joint.parent]
            self.inside[body] = pose @ rigid_inverse(joint.X_BM)
            return
        self.links[body] = len(self.parents)
        self.inside[body] = rigid_inverse(joint.X_BM)
        self.parents.append(self.links[joint.parent])
        self.joints.append(joint.index)
        self.slides.append(joint.kind is JointKind.PRISMATIC)
        self.axes.append(joint.axis)
        self.poses.append(pose)


def _seen(kinematics: Kinematics, a: Geometry, b: Geometry) -> tuple[Geometry, Geometry, Side]:
    """Returns a pair's geometries, that one second from whose partner its motion has the smaller bound, and its side."""
    scene = kinematics.scene
    farthest = np.maximum(np.abs(scene.own_limits[0]), np.abs(scene.own_limits[1]))[None]
    sides = [(one, other, side(chain(kinematics, one.body, other.body), other, farthest)) for one, other in ((a, b), (b, a))]
    return min(sides, key=lambda found: float(found[2].levers.sum()))
