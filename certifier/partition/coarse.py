"""Coarse volumes are made here: balls and capsules that contain geometries whatever the angles of the joints between are.

certifier.verify.coarse says why they do, and checks it exactly. Here everything is computed in doubles, so radii are larger by a margin.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import minimize_scalar

from certifier.kinematics import Kinematics, rigid_inverse
from certifier.model import WORLD, Array, Geometry, JointKind, Volume
from certifier.verify.coarse import foot

RELATIVE, ABSOLUTE = 1e-9, 1e-12
"""A radius is larger by these, the second in metres, than the one that is computed."""


@dataclass(frozen=True)
class _Linkage:
    """Holds how a geometry hangs on the revolute joints between a body and its own.

    Attributes:
        first: name of the joint next to the body.
        axes: m unit vectors, each in its joint's frame, whose origin is on the axis; in path order from the body.
        poses: m poses, (4, 4): of the first joint's frame in the body's, and of each further joint's in that of the joint before it.
        vertices: (V, 3) the geometry's, in the last joint's frame, in metres.
        radius: the geometry's.
    """

    first: str
    axes: list[Array]
    poses: list[Array]
    vertices: Array
    radius: float

    @classmethod
    def between(cls, kinematics: Kinematics, body: str, geometry: Geometry) -> _Linkage | None:
        """Returns that of a geometry; None if no joint moves it against the body, or others than revolute joints all up or all down."""
        above, names, axes, poses, fixed = kinematics.scene.joint_above, [], [], [], np.eye(4)
        directions = set()
        for here, there in itertools.pairwise(kinematics.bodies_between(body, geometry.body)):
            upwards = here != WORLD and above[here].parent == there
            joint = above[here if upwards else there]
            directions.add(upwards)
            outer, inner = (joint.X_BM, joint.X_PF) if upwards else (joint.X_PF, joint.X_BM)
            fixed = fixed @ outer
            if joint.index is not None:
                if joint.kind is not JointKind.REVOLUTE:
                    return None
                names.append(joint.name)
                axes.append(joint.axis)
                poses.append(fixed)
                fixed = np.eye(4)
            fixed = fixed @ rigid_inverse(inner)
        if not names or len(directions) > 1:
            return None
        return cls(names[0], axes, poses, _placed(fixed, geometry.vertices), geometry.radius)

    def reach(self) -> tuple[float, Array, int]:
        """Returns how far the geometry reaches from points that a joint turns, these points, and the number of this joint: 0 or 1.

        The points are in the joint's frame, (V, 3): the vertices or one point, about which a ball holds the geometry at all angles of the
        joints behind this one.
        """
        reach, points, i = self.radius, self.vertices, len(self.axes) - 1
        while i > 1:
            pose = self.poses[i - 1]
            t = foot((pose[:3, :3] @ self.axes[i - 1]).tolist(), (-pose[:3, 3]).tolist(), self.axes[i - 2].tolist())
            if t is None:
                t = _along(_placed(self.poses[i], np.outer(points @ self.axes[i], self.axes[i])), self.axes[i - 1])
            e = t * self.axes[i - 1]
            reach += self._turned(points, i, e)
            points, i = _placed(pose, e[None]), i - 2
        return reach, points, i

    def to_first_axis(self, points: Array, i: int, t: float) -> float:
        """Returns how far points that joint i turns, 0 or 1, come from the point t on the first joint's axis at most."""
        if i == 0:
            return _farthest(points, t * self.axes[0])
        return self._turned(points, i, t * self.axes[0])

    def _turned(self, points: Array, i: int, other: Array) -> float:
        """Returns how far points that joint i turns come at most from one that it does not move, (3,) in the frame of the joint before."""
        axis, pose = self.axes[i], self.poses[i]
        offset = pose[:3, :3].T @ (other - pose[:3, 3])
        g, h = float(offset @ axis), points @ axis
        sigma, rho = np.linalg.norm(offset - g * axis), np.linalg.norm(points - np.outer(h, axis), axis=1)
        return float(np.sqrt((h - g) ** 2 + (rho + sigma) ** 2).max())


@lru_cache(maxsize=1024)
def ball(kinematics: Kinematics, names: tuple[str, ...], body: str) -> Volume | None:
    """Returns a ball fixed to a body that holds geometries, by their names, at all angles of the joints between.

    Its centre is on the axis of the joint next to the body, where the ball has the least radius.

    Returns:
        None if a geometry is fixed to the body, or not all are behind the same joint of it, or one is behind a joint that slides.
    """
    linkages = [_Linkage.between(kinematics, body, kinematics.scene.geometry(name)) for name in names]
    known = [linkage for linkage in linkages if linkage is not None]
    if len(known) < len(linkages) or len({linkage.first for linkage in known}) != 1:
        return None
    reaches = [(linkage, *linkage.reach()) for linkage in known]

    def radius(t: float) -> float:
        return max(reach + linkage.to_first_axis(points, i, t) for linkage, reach, points, i in reaches)

    t = minimize_scalar(radius).x  # convex: it is the largest of distances from points on circles
    center = t * known[0].axes[0]
    return Volume(names, body, _placed(known[0].poses[0], center[None]), _enlarged(radius(t)))


@lru_cache(maxsize=1024)
def capsule(kinematics: Kinematics, names: tuple[str, ...]) -> Volume | None:
    """Returns a capsule along the axis of the joint that moves geometries of one body, by their names, and holds them at all its angles.

    It is fixed to the root of the rigid part before the joint. Among those with the least radius, it is the shortest.

    Returns:
        None if no joint moves the geometries, or one that slides.
    """
    geometries = [kinematics.scene.geometry(name) for name in names]
    root = kinematics.rigid_root(geometries[0].body)
    if root == WORLD:
        return None
    body = kinematics.rigid_root(kinematics.scene.joint_above[root].parent)
    linkages = [linkage for geometry in geometries if (linkage := _Linkage.between(kinematics, body, geometry)) is not None]
    if not linkages:
        return None
    linkage, vertices = linkages[0], np.concatenate([linkage.vertices for linkage in linkages])
    axis = linkage.axes[0]
    along = vertices @ axis
    across = np.linalg.norm(vertices - along[:, None] * axis, axis=1)
    # A vertex that is nearer to the axis may reach beyond the segment into the cap.
    cap = np.sqrt(np.maximum(across.max() ** 2 - across**2, 0.0))
    lower, upper = (along + cap).min(), (along - cap).max()
    if lower > upper:
        lower = upper = 0.5 * (lower + upper)
    distance = float(np.linalg.norm(vertices - np.clip(along, lower, upper)[:, None] * axis, axis=1).max())
    ends = _placed(linkage.poses[0], np.outer([lower, upper], axis))
    return Volume(names, body, ends, _enlarged(distance + max(geometry.radius for geometry in geometries)))


FAT = 2.1
"""A slim ball for the angles of several joints has at most this many times the radius of the geometry's own one."""
STOUT = 1.25
"""A slim capsule for the angles of one joint has at most this many times that radius."""


def slim_volumes(kinematics: Kinematics, volume: Volume, other: Volume) -> list[Volume]:
    """Returns coarse volumes that are hardly larger than a volume; the one that most joints move against another volume first.

    They are a capsule for the angles of one joint, and a ball for those of as many as is worth it, where these are slim enough.
    """
    own = _farthest(volume.vertices, volume.vertices.mean(axis=0)) + volume.radius
    roots, found = _roots(kinematics, volume, other), []
    slim = capsule(kinematics, volume.geometries)
    if slim is not None and slim.body in roots and slim.radius <= STOUT * own:
        found.append(slim)
    for body in reversed(roots):
        slim = ball(kinematics, volume.geometries, body) if len(kinematics.chain(body, volume.body)) > 1 else None
        if slim is not None and slim.radius <= FAT * own:
            return [*found, slim]
    return found


def common_balls(kinematics: Kinematics, volume: Volume, other: Volume) -> list[Volume]:
    """Returns, for every body on the way to another volume, the ball about all that the same joint of it moves; the nearest body first.

    Other geometries there have the same balls.
    """
    found = []
    for body in _roots(kinematics, volume, other):
        way = kinematics.bodies_between(body, volume.body)[1:]
        moved = next((there for there in way if kinematics.scene.joint_above[there].index is not None), None)
        fat = _ball_about(kinematics, body, moved)
        if fat is not None:
            found.append(replace(fat, geometries=volume.geometries))
    return found


@lru_cache(maxsize=1024)
def _ball_about(kinematics: Kinematics, body: str, moved: str | None) -> Volume | None:
    """Returns the ball fixed to a body that holds all geometries that a moved body carries, itself included."""
    together = (g.name for g in kinematics.scene.geometries if moved in {g.body, *kinematics.ancestors(g.body)})
    return ball(kinematics, tuple(together), body)


def _roots(kinematics: Kinematics, volume: Volume, other: Volume) -> list[str]:
    """Returns the bodies that a coarse volume may be fixed to, the one next to the volume first.

    They are above the volume, or the coarse volumes of two that hang on each other's bodies would change places.
    """
    above = set(kinematics.ancestors(volume.body))
    between = [body for body in kinematics.bodies_between(volume.body, other.body)[1:] if body in above]
    return list(dict.fromkeys(kinematics.rigid_root(body) for body in between))


def _placed(X: Array, points: Array) -> Array:
    """Returns where a rigid transform takes points, (N, 3)."""
    placed: Array = points @ X[:3, :3].T + X[:3, 3]
    return placed


def _along(points: Array, axis: Array) -> float:
    """Returns where on an axis through the origin the points, (N, 3), are in the mean."""
    return float((points @ axis).mean())


def _farthest(points: Array, other: Array) -> float:
    return float(np.linalg.norm(points - other, axis=1).max())


def _enlarged(radius: float) -> float:
    return radius * (1 + RELATIVE) + ABSOLUTE
