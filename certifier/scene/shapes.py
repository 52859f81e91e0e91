"""Shapes become conv(vertices) + ball(radius) here, the only kind of geometry that the certifier knows.

Boxes, convex polytopes of few vertices, spheres and capsules are exact. The others are replaced by something larger: a mesh by its
hull or by fewer vertices outside it, a cylinder by a circumscribed prism, and an ellipsoid by a circumscribed polytope. A half-space is
replaced by the box that is its part within the robot's reach.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from certifier.model import Array
from certifier.scene.decomposition.solid import closed, fault, welded
from certifier.scene.hollow import beyond_mesh
from certifier.scene.hull import outer
from certifier.scene.once import once

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


@dataclass(frozen=True)
class Body:
    """A body is convex and given in its geometry frame G.

    Attributes:
        vertices: (v, 3) metres in G.
        radius: metres.
        shape: the original shape, JSON-able.
        substitution: what replaced the original; None when the body is exact.
        inflation: upper bound in metres on how far the replacement reaches outside the original, or outside the hull of a mesh.
        beyond: lower estimate in metres of how far the hull of a mesh, or a part of one, reaches beyond the mesh.
        fault: why a mesh that its hull reaches beyond bounds no solid, for people; None if it does.
    """

    vertices: Array
    radius: float
    shape: dict[str, Any]
    substitution: str | None = None
    inflation: float = 0.0
    beyond: float = 0.0
    fault: str | None = None


def box(size: tuple[float, float, float]) -> Body:
    """Returns a box with edges ``size``, metres, centred on G."""
    return Body(CORNERS * np.array(size) / 2, 0.0, {"kind": "box", "size": list(size)})


def sphere(radius: float) -> Body:
    return Body(np.zeros((1, 3)), radius, {"kind": "sphere", "radius": radius})


def capsule(radius: float, length: float) -> Body:
    """Returns a capsule along z; ``length`` is between the centres of its caps. Both numbers are in metres."""
    return Body(np.array([[0, 0, -length / 2], [0, 0, length / 2]]), radius, {"kind": "capsule", "radius": radius, "length": length})


def cylinder(radius: float, length: float, sides: int) -> Body:
    """Returns the regular prism that is circumscribed about a cylinder along z."""
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    reach = radius / np.cos(np.pi / sides)
    ring = reach * np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.concatenate([np.column_stack([ring, np.full(sides, z)]) for z in (-length / 2, length / 2)])
    shape = {"kind": "cylinder", "radius": radius, "length": length}
    return Body(vertices, 0.0, shape, f"cylinder -> circumscribed prism with {sides} sides", float(reach - radius))


def ellipsoid(semi_axes: tuple[float, float, float], max_vertices: int) -> Body:
    """Returns the affine image of a polytope that is circumscribed about the unit sphere."""
    points = _spread(max_vertices)
    scale = float(1 / -ConvexHull(points).equations[:, 3].max())
    shape = {"kind": "ellipsoid", "semi_axes": list(semi_axes)}
    substitution = f"ellipsoid -> circumscribed polytope with {len(points)} vertices"
    return Body(scale * points * np.array(semi_axes), 0.0, shape, substitution, (scale - 1) * max(semi_axes))


def polytope(shape: dict[str, Any], points: Array, triangles: NDArray[np.int64], max_vertices: int) -> Body:
    """Returns the hull of points (k, 3), or a polytope of at most max_vertices around it; the shape's ``kind`` is "convex" or "mesh".

    Args:
        triangles: (t, 3) the points of the mesh's triangles.
    """
    vertices, inflation, count = outer(points, max_vertices)
    if inflation > 0:
        hull = f"polytope of {len(vertices)} vertices around its hull of {count}"
    else:
        hull = f"convex hull with {len(vertices)} vertices"
    if shape["kind"] == "convex":
        return Body(vertices, 0.0, shape, f"convex -> {hull}" if inflation else None, inflation)
    beyond = beyond_mesh(points, triangles)
    return Body(vertices, 0.0, shape, f"mesh -> {hull}", inflation, beyond, _fault(points, triangles) if beyond else None)


@once
def _fault(points: Array, triangles: NDArray[np.int64]) -> str | None:
    """Returns why a mesh bounds no solid, for people; None if it does."""
    return fault(*closed(*welded(points, triangles)))


def half_space(center: Array, reach: float) -> Body:
    """Returns a box in the half-space z <= 0 that contains the half-space's part within ``reach`` of ``center``, (3,).

    ``reach`` and ``center`` are in metres, in G.
    """
    depth = max(reach - center[2], 0.01 * reach)
    lower, upper = np.append(center[:2] - reach, -depth), np.append(center[:2] + reach, 0.0)
    vertices = (lower + upper) / 2 + CORNERS * (upper - lower) / 2
    return Body(vertices, 0.0, {"kind": "half_space"}, f"half-space -> the box of it within the robot's reach of {reach:.3g} m")


def _spread(count: int) -> Array:
    """Returns points, (count, 3), that are spread evenly over the unit sphere (Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
