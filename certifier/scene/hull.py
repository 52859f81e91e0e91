"""Convex hulls are formed here, and are approximated from outside by polytopes of few vertices.

``outer`` cuts a bounding box down to the hull. It takes the vertex that is farthest from the hull and the point of the hull that is nearest
to this vertex. It cuts the vertex off with the hull's supporting plane that is perpendicular to the line between the two. It goes on while
the vertices are few enough.

Every cut is a supporting half-space, so the hull stays inside. The distance from the hull is a convex function, so its greatest value over
the approximation is taken at a vertex. Therefore the inflation is known.

Qhull rounds: a point that it drops as inside or on a face may lie some 1e-14 m outside of the vertices that it keeps. So a point counts as
inside only where it is deeper than that, or is a vertex. Otherwise the vertices are moved out until every point is inside.
"""

from __future__ import annotations

import contextlib

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from certifier.errors import SceneError
from certifier.model import Array
from certifier.scene.once import once

_FLAT = 1e-5
"""A hull that is thinner than this fraction of its size counts as flat, and gets this fraction as its half thickness."""
_THICKNESS = 1e-6
"""A flat point set gets at least this half thickness, in metres."""
_SAFETY = 1e-9
"""This relative growth puts rounding errors on the safe side."""
_GROWTHS = (_SAFETY, 1e-8, 1e-7, 1e-6, 1e-5)
"""These relative growths are tried in turn, because thin bodies need more."""
_ROUNDING = 64 * np.finfo(float).eps
"""This bounds the rounding error of a point's distance from a plane, in units of their greatest coordinate."""
_PRODUCTS = 2**22
"""At most this many distances of points from planes are in memory at once."""


def hull_vertices(points: Array) -> Array:
    """Returns the extreme points, (v, 3), of the convex hull of points (k, 3); these are all points where the hull has no volume."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return np.unique(points, axis=0)


@once
def outer(points: Array, max_vertices: int) -> tuple[Array, float, int]:
    """Finds at most ``max_vertices`` >= 8 vertices whose convex hull contains every one of points (k, 3), metres.

    Returns:
        vertices (v, 3); the inflation, an upper bound in metres on the distance of any point of their hull from the hull of ``points``
        (0.0 only when the vertices are the points' own and no point is outside of them by as much as a rounding error); and the number
        of vertices that the hull of ``points`` has.

    Raises:
        SceneError: rounding errors prevented it. No polytope that leaves a point out is ever returned.
    """
    points = np.asarray(points, dtype=float)
    extreme = hull_vertices(points)
    if len(extreme) <= max_vertices and _is_hull(extreme, points):
        return extreme, 0.0, len(extreme)
    solid = hull_vertices(thickened(extreme))
    center = solid.mean(axis=0)
    solid = solid - center
    with contextlib.suppress(QhullError):  # a needle far from the origin is flat to Qhull, thickened or not
        around = _contain(solid if len(solid) <= max_vertices else _cut_down(solid, max_vertices), solid)
        for growth in _GROWTHS:
            vertices = around * (1 + growth)
            if contains(vertices + center, points):
                distance = max(nearest_in_hull(v, extreme - center)[1] for v in vertices)
                inflation = max(distance * (1 + _SAFETY), distance + _ROUNDING * float(np.abs(points).max()))
                return vertices + center, inflation, len(extreme)
    message = f"no polytope of {max_vertices} vertices was found around a mesh of {len(points)} points"
    raise SceneError("hull", message, field="mesh.max_vertices", hint="raise it, or simplify the mesh")


def contains(vertices: Array, points: Array, tolerance: float = 0.0) -> bool:
    """Returns whether every one of points (k, 3) is in the hull of vertices (v, 3), up to a tolerance in metres, whatever rounding does."""
    return bool(depths(*inner(vertices), points).min() >= -tolerance)


def _is_hull(vertices: Array, points: Array) -> bool:
    """Returns whether every point is one of the vertices, which are among the points, or is inside their hull beyond doubt."""
    try:
        doubtful = points[depths(*inner(vertices), points) < 0]
    except QhullError:
        doubtful = points
    own = set(map(tuple, vertices.tolist()))
    return all(tuple(point) in own for point in doubtful.tolist())


def depths(normals: Array, offsets: Array, points: Array) -> Array:
    """Returns how far inside of half-spaces points (k, 3) are at least, whatever rounding does, metres, (k,).

    Args:
        normals, offsets: (h, 3) unit normals n and (h,) offsets o of the half-spaces n'x + o <= 0.
    """
    size = max(1, _PRODUCTS // len(normals))
    chunks = (points[k : k + size] for k in range(0, len(points), size))
    found = np.concatenate([-(chunk @ normals.T + offsets).max(axis=1) for chunk in chunks])
    return found - _ROUNDING * float(np.abs(points).max())


def inner(vertices: Array) -> tuple[Array, Array]:
    """Returns half-spaces n'x + o <= 0, (h, 3) and (h,), whose common part is in the hull of vertices (v, 3) beyond doubt.

    Qhull's facets are triangles that close a surface within the hull. Their planes are not quite through their corners: the deepest corner
    of a triangle is its ``slack`` below its plane, and every point of it is at most that far below. The way from the middle to a point
    outside crosses a triangle. So if the middle and a point are both farther below every plane than its slack, the point is inside.

    Where the middle is not, the offsets are infinite, and no point is in the half-spaces.

    Raises:
        QhullError: the hull is flat.
    """
    hull = ConvexHull(vertices)
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    corners = vertices[hull.simplices]
    slack = -(np.einsum("fij,fj->fi", corners, normals) + offsets[:, None]).min(axis=1)
    offsets = offsets + np.maximum(slack, 0.0) + _ROUNDING * float(np.abs(vertices).max())
    middle = (normals @ vertices.mean(axis=0) + offsets).max()
    return normals, offsets if middle < 0 else np.full_like(offsets, np.inf)


def thickened(points: Array) -> Array:
    """Returns the points, or two copies of them, one on either side of their plane, when they are flat."""
    axes = principal_axes(points - points.mean(axis=0))
    extent = np.ptp(points @ axes.T, axis=0)
    if extent[2] > _FLAT * extent[0]:
        return points
    offset = max(_THICKNESS, _FLAT * extent[0]) * axes[2]
    return np.concatenate([points - offset, points + offset])


def principal_axes(points: Array) -> Array:
    """Returns the orthonormal directions, (3, 3), one a row, in which points (k, 3) extend from the origin, the longest first."""
    return np.linalg.svd(points, full_matrices=len(points) < 3)[2]  # the other factor, (k, k), is not needed


def _cut_down(points: Array, max_vertices: int) -> Array:
    """Returns the vertices of the last intersection of half-spaces that has at most max_vertices.

    The origin must be inside the hull of the points.
    """
    axes = principal_axes(points)
    normals = np.concatenate([axes, -axes])
    vertices = _intersection(normals, points)
    distances: dict[bytes, tuple[Array, float]] = {}
    for _ in range(max_vertices):
        for v in vertices:
            if v.tobytes() not in distances:
                distances[v.tobytes()] = nearest_in_hull(v, points)
        worst = max(vertices, key=lambda v: distances[v.tobytes()][1])
        nearest, distance = distances[worst.tobytes()]
        if distance == 0:
            break
        normals = np.concatenate([normals, [(worst - nearest) / distance]])
        refined = _intersection(normals, points)
        if len(refined) > max_vertices:
            break
        vertices = refined
    return vertices


def _intersection(normals: Array, points: Array) -> Array:
    """Returns the vertices of {x : n'x <= max over points p of n'p, for every normal n}, with near-duplicates merged."""
    offsets = (points @ normals.T).max(axis=0)
    vertices = HalfspaceIntersection(np.column_stack([normals, -offsets]), np.zeros(3)).intersections
    scale = np.abs(vertices).max()
    return vertices[np.unique(np.round(vertices / (1e-7 * scale)), axis=0, return_index=True)[1]]


def _contain(vertices: Array, points: Array) -> Array:
    """Returns the vertices, scaled about the origin just enough for their hull to contain every point, but for rounding."""
    equations = ConvexHull(vertices).equations
    excess = (points @ equations[:, :3].T / -equations[:, 3]).max()
    return vertices * max(1.0, excess)


def nearest_in_hull(x: Array, points: Array) -> tuple[Array, float]:
    """Returns a point of the hull of points near x, (3,), and its distance from x.

    It solves nonnegative least squares with a heavy row for the sum of the weights.
    """
    scale = np.abs(points).max()
    weights, _ = nnls(np.vstack([points.T / scale, np.full(len(points), 1e3)]), np.append(x / scale, 1e3))
    nearest = weights @ points / weights.sum()
    return nearest, float(np.linalg.norm(x - nearest))
