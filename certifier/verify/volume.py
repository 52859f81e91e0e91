"""The verifier checks here, exactly, that a proof's volume contains every geometry that it stands for.

A geometry conv(V) + ball(r) lies in conv(W) + ball(R) if each of its vertices v does so together with its ball v + ball(r), because
conv(W) + ball(R) is convex. For a vertex, one of two conditions suffices:

- |v - p| <= R - r for a point p of W, or of a segment between two points of W;
- W are the corners of a box along the axes, and v lies in the box with r - R (if positive) taken off every face.

The vertices are taken into the volume's frame through welds. Fixed frames are rigid motions, to the rounding of their doubles.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np
from flint import fmpq

from certifier.errors import ProofError
from certifier.model import Array, Geometry, Scene, Volume
from certifier.proof import limits
from certifier.verify.kinematics import ExactKinematics, Numbers, exact

Point = tuple[fmpq, ...]


def check_contained(*parts: tuple[Scene, Iterable[Volume]]) -> None:
    """Checks that it is within limits to see whether the volumes of all scenes together contain their geometries.

    A vertex costs the square of the number of joints that it is taken through: numbers gain bits with each of them.

    Raises:
        ProofError: proof_too_large.
    """
    cost = 0
    for scene, volumes in parts:
        kinematics = ExactKinematics.at(scene, [])
        for volume in volumes:
            if not _is_known(scene, volume) or volume.is_geometry_of(scene) or volume.body not in scene.bodies:
                continue  # check_volume says what is wrong with it
            for name in volume.geometries:
                geometry = scene.geometry(name)
                cost += (1 + len(geometry.vertices)) * (1 + len(kinematics.path(volume.body, geometry.body))) ** 2
                if cost > limits.CONTAINED:
                    message = "the proof's volumes stand for more vertices, behind more joints, than are checked"
                    raise ProofError("proof_too_large", message)


def check_volume(scene: Scene, kinematics: ExactKinematics, volume: Volume) -> None:
    """Checks that the volume is fixed to a body of the scene and contains its geometries.

    Raises:
        ProofError: the volume makes no sense, or does not contain a geometry, which the message names.
    """
    check_shape(scene, volume)
    if volume.is_geometry_of(scene):
        return
    corners = [tuple(exact(x) for x in vertex) for vertex in volume.vertices]
    box = _box(volume.vertices)
    for name in volume.geometries:
        geometry = scene.geometry(name)
        radius, reach = exact(geometry.radius), exact(volume.radius)
        for v in _vertices(kinematics, volume.body, geometry):
            if not (
                _near_corner(v, corners, reach - radius)
                or (box is not None and _in_box(v, box, max(radius - reach, fmpq(0))))
                or _near_segment(v, corners, reach - radius)
            ):
                raise ProofError("proof_volume", f"{name} is not contained in the volume that stands for it")


def check_shape(scene: Scene, volume: Volume) -> None:
    """Checks that the volume has vertices and a radius, a body of the scene, and geometries of it.

    Raises:
        ProofError: it has not.
    """
    if not _is_known(scene, volume):
        raise ProofError("proof_volume", "a volume stands for nothing, or for what is no geometry of the scene")
    shaped = volume.vertices.ndim == 2 and volume.vertices.shape[1] == 3 and len(volume.vertices) > 0
    if not (shaped and np.isfinite(volume.vertices).all() and 0 <= volume.radius < np.inf):
        raise ProofError("proof_malformed", "a volume has no vertices, or numbers that are no lengths")
    if volume.body not in scene.bodies:
        raise ProofError("proof_volume", f"the scene has no body {volume.body!r}")


def _is_known(scene: Scene, volume: Volume) -> bool:
    """Returns whether the volume names only geometries of the scene, each once, and at least one."""
    names = volume.geometries
    return bool(names) and len(set(names)) == len(names) and all(map(scene.has_geometry, names))


def _vertices(kinematics: ExactKinematics, body: str, geometry: Geometry) -> list[Point]:
    """Returns the geometry's vertices in the body's frame."""
    vertices = [tuple(exact(x) for x in vertex) for vertex in geometry.vertices]
    if geometry.body == body:
        return vertices
    X = kinematics.fixed_pose(body, geometry.body)
    if X is None:
        raise ProofError("proof_volume", f"{geometry.name} is not welded to {body}")
    return [placed(X, v) for v in vertices]


def placed(X: Numbers, p: Point) -> Point:
    """Returns where a rigid transform, (4, 4) with the entry [3][3] = 1, takes a point."""
    return tuple(sum((X[i][j] * p[j] for j in range(3)), X[i][3]) for i in range(3))


def _near_corner(v: Point, corners: Sequence[Point], distance: fmpq) -> bool:
    return distance >= 0 and any(dot(offset, offset) <= distance * distance for offset in (minus(v, corner) for corner in corners))


def _near_segment(v: Point, corners: Sequence[Point], distance: fmpq) -> bool:
    """Returns whether v is within the distance of a point between two corners, which projection finds."""
    for start, end in itertools.combinations(corners, 2):
        offset, direction = minus(v, start), minus(end, start)
        length, along = dot(direction, direction), dot(offset, direction)
        if 0 < along < length and distance >= 0 and dot(offset, offset) - along * along / length <= distance * distance:
            return True
    return False


def _box(vertices: Array) -> tuple[Point, Point] | None:
    """Returns the lower and the upper corner if the vertices are exactly the corners of a box along the axes, else None."""
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    corners = set(itertools.product(*zip(lower.tolist(), upper.tolist(), strict=True)))
    if corners != set(map(tuple, vertices.tolist())):
        return None
    return tuple(exact(x) for x in lower), tuple(exact(x) for x in upper)


def _in_box(v: Point, box: tuple[Point, Point], inset: fmpq) -> bool:
    return all(low + inset <= x <= high - inset for x, low, high in zip(v, *box, strict=True))


def minus(a: Point, b: Point) -> Point:
    """Returns a - b."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


def dot(a: Point, b: Point) -> fmpq:
    """Returns the scalar product."""
    return sum((x * y for x, y in zip(a, b, strict=True)), fmpq(0))
