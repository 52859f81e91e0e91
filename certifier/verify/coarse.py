"""The verifier checks here, exactly, that a coarse volume contains its geometries, whatever the angles of the joints between are.

A coarse volume is a ball or a capsule that is fixed to a body B, not to the bodies D of its geometries (certifier.proof.partition). Between
B and D there are revolute joints and welds. Turning a joint moves no point of its axis and keeps the distances from such a point.

Ball. A joint takes a point p about its axis, on a circle. Let h be where p is along the axis, and rho its distance from it; let g and sigma
say the same of a point e that the joint does not move. Then the farthest that p comes from e is the root of

    (h - g)^2 + (rho + sigma)^2.

Let e be on the axis of the next joint towards B. A ball about e that holds all the circles stays where it is when that joint turns, too.
Only the joint after that one moves e, on another circle. So with every second joint the way from a vertex v to the centre c grows by one
such root: the last one leads to c, or to the point next to it on the axis next to B, where the distance to c is added. The geometry with
the radius r is contained if this way and r are at most the ball's radius. Any points on the axes will do. :func:`foot` says which are
taken.

Capsule, with one joint between. Let its ends be at most delta away from the points x and y of the joint's axis. The distance of v to the
segment from x to y does not change, and every point of this segment is at most delta away from the segment between the ends. So v is
contained with its ball if the distance, delta and r are together at most the capsule's radius.

Roots are rounded up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from flint import fmpq

from certifier.errors import ProofError
from certifier.model import JointKind, Scene, Volume
from certifier.verify.kinematics import ExactKinematics, Numbers, exact
from certifier.verify.volume import Point, check_shape, dot, minus, placed

PARALLEL = 1e-4
"""Axes whose directions have a cross product of a smaller square count as parallel: their nearest points may be far away."""
_ROOT_BITS = 80


def foot(axis: Sequence[float], point: Sequence[float], direction: Sequence[float]) -> float | None:
    """Returns where on its axis a joint's point e is taken: t with e = t axis, where the axis is nearest to another line.

    Args:
        axis: unit vector of the joint's axis, which goes through the origin.
        point: a point of the other line, the next axis towards the coarse volume's body, in metres.
        direction: unit vector of the other line.

    Returns:
        t in metres; None for lines that are about parallel, where e is next to the middles of the circles about it, in the mean.
    """
    pairs = (axis, direction), (point, axis), (point, direction)
    cosine, along, other = (sum(x * y for x, y in zip(a, b, strict=True)) for a, b in pairs)
    square = 1 - cosine * cosine
    return None if square < PARALLEL else (along - other * cosine) / square


def check_coarse(scene: Scene, kinematics: ExactKinematics, volume: Volume) -> None:
    """Checks that the coarse volume contains its geometries at all angles of the joints between.

    Raises:
        ProofError: the volume makes no sense, there is no such joint or another one, or a geometry, which the message names, may leave it.
    """
    check_shape(scene, volume)
    if len(volume.vertices) > 2:
        raise ProofError("proof_volume", "a coarse volume is neither a ball nor a capsule")
    for name in volume.geometries:
        geometry = scene.geometry(name)
        path = kinematics.path(volume.body, geometry.body)
        moving = [joint for joint, _ in path if joint.index is not None]
        if not moving or any(joint.kind is not JointKind.REVOLUTE for joint in moving) or len({upwards for _, upwards in path}) > 1:
            raise ProofError("proof_volume", f"{name} is not behind revolute joints of {volume.body}, to which its coarse volume is fixed")
        axes, poses = kinematics.linkage(volume.body, geometry.body)
        ends = [tuple(exact(x) for x in end) for end in volume.vertices]
        vertices = [placed(poses[-1], tuple(exact(x) for x in v)) for v in geometry.vertices]
        if len(ends) == 1:
            reach = _reach_of_ball(axes, poses, vertices, ends[0])
        elif len(axes) == 1:
            reach = _reach_of_capsule(axes[0], poses[0], vertices, ends)
        else:
            raise ProofError("proof_volume", f"{name} is behind {len(axes)} joints of the body to which its coarse capsule is fixed")
        if reach + exact(geometry.radius) > exact(volume.radius):
            raise ProofError("proof_volume", f"{name} may leave the coarse volume that stands for it")


def _reach_of_ball(axes: Sequence[Point], poses: Sequence[Numbers], vertices: Sequence[Point], center: Point) -> fmpq:
    """Returns an upper bound of the vertices' distances from the centre, at all angles.

    Args:
        axes: of the joints in path order from the volume's body, as unit vectors in the joints' frames.
        poses: of the first joint's frame in the volume's body's, and of each further joint's in that of the joint before it.
        vertices: in the last joint's frame.
        center: in the volume's body's frame.
    """
    reach, points, i = fmpq(0), vertices, len(axes) - 1
    while i > 0:
        e = _scaled(exact(_on_axis(axes, poses, points, center, i - 1)), axes[i - 1])
        reach += _farthest_turned(points, axes[i], _line(poses[i], axes[i]), e)
        points, i = [placed(poses[i - 1], e)], i - 2
    if i == 0:
        return reach + _farthest_turned(points, axes[0], _line(poses[0], axes[0]), center)
    return reach + _root(_square(minus(points[0], center)))


def _on_axis(axes: Sequence[Point], poses: Sequence[Numbers], points: Sequence[Point], center: Point, i: int) -> float:
    """Returns where on the axis of joint i a ball about points that joint i + 1 turns has its centre."""
    origin, direction = _line(poses[i], axes[i])
    if i == 0:
        return _double(dot(minus(center, origin), direction))
    t = foot(_doubles(direction), [-x for x in _doubles(origin)], _doubles(axes[i - 1]))
    if t is not None:
        return t
    middles = [placed(poses[i + 1], _scaled(dot(p, axes[i + 1]), axes[i + 1])) for p in points]
    return sum(_double(dot(p, axes[i])) for p in middles) / len(middles)


def _farthest_turned(points: Sequence[Point], axis: Point, line: tuple[Point, Point], other: Point) -> fmpq:
    """Returns how far points come from another one at most when a joint turns them.

    Args:
        axis: the joint's, in the frame of the points.
        line: a point and the direction of the same axis, in the frame of ``other``.
    """
    offset = minus(other, line[0])
    g = dot(offset, line[1])
    sigma_2 = _square(offset) - g * g
    squares = []
    for p in points:
        h = dot(p, axis)
        rho_2 = _square(p) - h * h
        squares.append((h - g) * (h - g) + rho_2 + sigma_2 + 2 * _root(rho_2 * sigma_2))
    return _root(max(squares))


def _reach_of_capsule(axis: Point, pose: Numbers, vertices: Sequence[Point], ends: Sequence[Point]) -> fmpq:
    """Returns an upper bound of the vertices' distances from the segment between the ends, at all angles of the only joint.

    Args:
        axis: of the joint, as a unit vector in the joint's frame.
        pose: of the joint's frame in the volume's body's.
        vertices: in the joint's frame.
        ends: in the volume's body's frame.
    """
    origin, direction = _line(pose, axis)
    along = [dot(minus(end, origin), direction) for end in ends]
    delta = max(_root(_square(minus(minus(end, origin), _scaled(t, direction)))) for end, t in zip(ends, along, strict=True))
    lower, upper = min(along), max(along)
    nearest = [_scaled(min(max(dot(v, axis), lower), upper), axis) for v in vertices]
    return delta + _root(max(_square(minus(v, x)) for v, x in zip(vertices, nearest, strict=True)))


def _line(pose: Numbers, axis: Point) -> tuple[Point, Point]:
    """Returns the origin of a frame and the direction of an axis of it, in the frame in which the pose is."""
    origin = placed(pose, (fmpq(0),) * 3)
    return origin, minus(placed(pose, axis), origin)


def _scaled(t: fmpq, a: Point) -> Point:
    return tuple(t * x for x in a)


def _square(a: Point) -> fmpq:
    return dot(a, a)


def _root(x: fmpq) -> fmpq:
    """Returns a number that is no less than the root of x >= 0, by at most 2^-_ROOT_BITS."""
    scaled = int((x * 4**_ROOT_BITS).ceil())
    root = math.isqrt(scaled)
    return fmpq(root if root * root == scaled else root + 1) / 2**_ROOT_BITS


def _double(x: fmpq) -> float:
    return float(int(x.p) / int(x.q))


def _doubles(a: Point) -> list[float]:
    return [_double(x) for x in a]
