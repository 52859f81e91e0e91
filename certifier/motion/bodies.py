"""A scene's links, geometries and pairs as arrays, for the compiled loops about motions and collisions.

A link is a body with all bodies that are welded to it. Its frame is that of the joint that moves it, so its pose is

    X_WL = X_WP X_PF J(q)

with the parent link P, a fixed pose X_PF, and the motion J of the joint.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.kinematics import rigid_inverse
from certifier.model import WORLD, Array, JointKind, Scene


class Bodies(NamedTuple):
    """Holds a scene of L links, G geometries with V vertices in all, and P pairs.

    Attributes:
        parents: (L,) number of each link's parent, which is smaller than its own; link 0 is the world.
        joints: (L,) position index of the joint that moves the link.
        slides: (L,) whether that joint is prismatic.
        axes: (L, 3) the joints' axes, as the scene has them.
        rotations, offsets: (L, 3, 3) and (L, 3) of the fixed poses X_PF, metres.
        roots: (L,) number among the scene's bodies of the one that the link's joint moves.
        turned: (L, 3, 3) rotations of the links' frames in the frames of these bodies.
        vertices: (V, 3) metres, in the frames of their links.
        first: (G + 1,) where each geometry's vertices begin, and V.
        links: (G,) the link of each geometry.
        centers, sizes: (G, 3) and (G,) of balls that contain the vertices, metres, in the links' frames.
        pairs: (P, 2) numbers of the geometries a and b.
        reaches: (P,) the radii and the padding of both geometries, metres.
    """

    parents: np.ndarray
    joints: np.ndarray
    slides: np.ndarray
    axes: Array
    rotations: Array
    offsets: Array
    roots: np.ndarray
    turned: Array
    vertices: Array
    first: np.ndarray
    links: np.ndarray
    centers: Array
    sizes: Array
    pairs: np.ndarray
    reaches: Array


@lru_cache(maxsize=16)
def bodies_of(scene: Scene) -> Bodies:
    """Returns the arrays of a scene."""
    tree = _Tree(scene)
    vertices, centers, sizes = [], [], []
    for geometry in scene.geometries:
        X = tree.inside[geometry.body]
        vertices.append(geometry.vertices @ X[:3, :3].T + X[:3, 3])
        centers.append((vertices[-1].min(axis=0) + vertices[-1].max(axis=0)) / 2)
        sizes.append(np.linalg.norm(vertices[-1] - centers[-1], axis=1).max())
    number = {geometry.name: i for i, geometry in enumerate(scene.geometries)}
    poses = np.array(tree.poses)
    return Bodies(
        parents=np.array(tree.parents),
        joints=np.array(tree.joints),
        slides=np.array(tree.slides),
        axes=np.array(tree.axes),
        rotations=np.ascontiguousarray(poses[:, :3, :3]),
        offsets=np.ascontiguousarray(poses[:, :3, 3]),
        roots=np.array([scene.bodies.index(body) for body in tree.roots]),
        turned=np.array([tree.inside[body][:3, :3].T for body in tree.roots]),
        vertices=np.concatenate([np.zeros((0, 3)), *vertices]),
        first=np.concatenate([[0], np.cumsum([len(each) for each in vertices], dtype=np.int64)]),
        links=np.array([tree.links[geometry.body] for geometry in scene.geometries], dtype=np.int64),
        centers=np.array(centers).reshape(-1, 3),
        sizes=np.array(sizes),
        pairs=np.array([(number[pair.a], number[pair.b]) for pair in scene.pairs], dtype=np.int64).reshape(-1, 2),
        reaches=np.array([sum(scene.geometry(name).radius for name in (p.a, p.b)) + 2 * scene.padding_of(p) for p in scene.pairs]),
    )


class _Tree:
    """Numbers the links. ``inside`` has the pose of each body in the frame of its link."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.links, self.inside, self.roots = {WORLD: 0}, {WORLD: np.eye(4)}, [WORLD]
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
        self.roots.append(body)
        self.joints.append(joint.index)
        self.slides.append(joint.kind is JointKind.PRISMATIC)
        self.axes.append(joint.axis)
        self.poses.append(pose)


@njit(cache=True)
def place_links(bodies: Bodies, q: Array, R: Array, p: Array) -> None:
    """Fills in the links' rotations R, (L, 3, 3), and positions p, (L, 3), in the world at joint positions q, (n,)."""
    R[0] = np.eye(3)
    p[0] = 0.0
    X = np.empty((3, 3))
    for link in range(1, len(bodies.parents)):
        parent, value, u = bodies.parents[link], q[bodies.joints[link]], bodies.axes[link]
        fixed, offset = bodies.rotations[link], bodies.offsets[link]
        for i in range(3):
            a, b, d = R[parent, i, 0], R[parent, i, 1], R[parent, i, 2]
            p[link, i] = p[parent, i] + a * offset[0] + b * offset[1] + d * offset[2]
            for j in range(3):
                X[i, j] = a * fixed[0, j] + b * fixed[1, j] + d * fixed[2, j]
        if bodies.slides[link]:
            for i in range(3):
                p[link, i] += value * (X[i, 0] * u[0] + X[i, 1] * u[1] + X[i, 2] * u[2])
                for j in range(3):
                    R[link, i, j] = X[i, j]
        else:
            c, s = np.cos(value), np.sin(value)
            x, y, z, v = u[0], u[1], u[2], 1.0 - c
            for i in range(3):
                a, b, d = X[i, 0], X[i, 1], X[i, 2]
                R[link, i, 0] = a * (c + v * x * x) + b * (v * x * y + s * z) + d * (v * x * z - s * y)
                R[link, i, 1] = a * (v * x * y - s * z) + b * (c + v * y * y) + d * (v * y * z + s * x)
                R[link, i, 2] = a * (v * x * z + s * y) + b * (v * y * z - s * x) + d * (c + v * z * z)


@njit(cache=True)
def place(bodies: Bodies, geometry: int, frame: int, R: Array, p: Array, points: Array) -> None:
    """Fills in where a geometry's vertices are in the frame of a link, (W, 3), for the links' poses R, p of :func:`place_links`."""
    link, begin = bodies.links[geometry], bodies.first[geometry]
    if link == frame:
        for v in range(len(points)):
            for i in range(3):
                points[v, i] = bodies.vertices[begin + v, i]
        return
    x, y, z = p[link, 0] - p[frame, 0], p[link, 1] - p[frame, 1], p[link, 2] - p[frame, 2]
    for i in range(3):
        a, b, d = R[frame, 0, i], R[frame, 1, i], R[frame, 2, i]
        u = a * R[link, 0, 0] + b * R[link, 1, 0] + d * R[link, 2, 0]
        v = a * R[link, 0, 1] + b * R[link, 1, 1] + d * R[link, 2, 1]
        w = a * R[link, 0, 2] + b * R[link, 1, 2] + d * R[link, 2, 2]
        moved = a * x + b * y + d * z
        for k in range(len(points)):
            points[k, i] = u * bodies.vertices[begin + k, 0] + v * bodies.vertices[begin + k, 1] + w * bodies.vertices[begin + k, 2] + moved
