"""How far a hull reaches beyond what it stands for is estimated here, from below.

The hull of a bin closes its opening. A configuration inside of the opening then counts as a collision, and people need to know why. So
points are spread over the faces of the hull, and their distances from the mesh are taken. The greatest is one that the hull reaches beyond
the mesh without doubt, but for rounding. Other points, those inside of the hull among them, may be farther away.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from certifier.model import Array, Geometry, Scene
from certifier.scene.decomposition.solid import wound
from certifier.scene.hull import principal_axes
from certifier.scene.once import once

_POINTS = 500
"""About this many points are spread over the faces of a hull."""
_OF_PART = 50
"""About this many points are spread over the faces of a part."""
_CLIMBS = 12
_LOOKS, _LOOKS_A_TRIANGLE, _MIDDLES = 1_000_000, 16, 64
"""At most _LOOKS distances from triangles are taken for a mesh, and _LOOKS_A_TRIANGLE more for each of its triangles. Looking at the
middles of _MIDDLES triangles takes the place of one distance. Where nearly all triangles have to be looked at, fewer points are tried.
"""
_MOVES = np.eye(3)[[0, 1, 2, 0, 1, 2]] - np.eye(3)[[1, 2, 0, 2, 0, 1]]
_NOTABLE = 1e-3
"""A hull that reaches less than this fraction of its length beyond the mesh is as good as the mesh."""
_KEY, _FAULTS = "beyond", "no_solid"
_REMEDIES = {"hull": "leave the body out of hulls", "part": "write a smaller threshold, or a larger mesh.max_vertices"}
"""What to do about a hull that closes an opening, by the kind of shape."""
_DECOMPOSE = "decompose in the scene file makes convex parts of a mesh"


@once
def beyond_mesh(points: Array, triangles: NDArray[np.int64]) -> float:
    """Returns a lower estimate, in metres, of how far the hull of points (k, 3) reaches beyond the triangles, (t, 3) indices of points.

    It is 0 where that is next to nothing, or where there are no triangles.
    """
    return _beyond(_faces(points), points[triangles], 0.0)


def beyond_parts(hull: Array, parts: Sequence[Array], inflation: float) -> float:
    """Returns a lower estimate, in metres, of how far the hull of vertices (v, 3) reaches beyond the hulls of the parts, (k, 3) each.

    ``inflation`` says how far the vertices may be outside of the parts' common hull, metres.
    """
    return _beyond(_faces(hull), np.concatenate([_faces(part) for part in parts]), inflation)


def beyond_solid(part: Array, points: Array, triangles: NDArray[np.int64]) -> float:
    """Returns a lower estimate, in metres, of how far the hull of vertices (v, 3) reaches beyond the solid that a closed mesh bounds.

    It is 0 where that is next to nothing.

    Args:
        points, triangles: (k, 3) and (t, 3), the mesh.
    """
    corners = points[triangles]
    spots = np.array([weights @ triangle for weights, triangle in _spread(_faces(part), _OF_PART)])
    distances = _Distances(corners)
    reached = max((distances.of(spot) for spot in spots[~wound(corners, spots)] if distances.looks > 0), default=0.0)
    return reached if reached > _NOTABLE * float(np.ptp(points, axis=0).max()) else 0.0


def recorded(found: dict[str, float], faults: dict[str, str]) -> dict[str, dict[str, float] | dict[str, str]]:
    """Returns what goes into a scene's provenance.

    Args:
        found: by geometry, how far it reaches beyond, metres.
        faults: by geometry, why its mesh bounds no solid.
    """
    return ({_KEY: found} if found else {}) | ({_FAULTS: faults} if faults else {})


def beyond(scene: Scene, name: str) -> float:
    """Returns how far a geometry reaches beyond what it stands for, at least, in metres; 0 where it is next to nothing or not known."""
    found = scene.provenance.get(_KEY)
    distance = found.get(name, 0.0) if isinstance(found, dict) else 0.0
    return distance if isinstance(distance, float) else 0.0


def fault_of(scene: Scene, name: str) -> str | None:
    """Returns why the mesh of a geometry bounds no solid, for people; None where it does, or where nothing is known."""
    found = scene.provenance.get(_FAULTS)
    fault = found.get(name) if isinstance(found, dict) else None
    return fault if isinstance(fault, str) else None


def standing_for(geometry: Geometry) -> str:
    """Returns what a hull stands for, for people."""
    return "its parts" if geometry.shape["kind"] == "hull" else "its mesh"


def remedy(geometry: Geometry) -> str:
    """Returns what to do about a hull that closes an opening, for people."""
    return _REMEDIES.get(geometry.shape["kind"], _DECOMPOSE)


def _faces(points: Array) -> Array:
    """Returns triangles (h, 3, 3) that cover the surface of the hull of points (k, 3), which may be flat, or a line, or a point."""
    try:
        return points[ConvexHull(points).simplices]
    except QhullError:
        in_plane = (points - points.mean(axis=0)) @ principal_axes(points - points.mean(axis=0)).T
    try:
        outline = points[ConvexHull(in_plane[:, :2]).vertices]
        return np.array([[outline[0], b, c] for b, c in itertools.pairwise(outline[1:])])
    except QhullError:
        first, last = points[in_plane[:, 0].argmin()], points[in_plane[:, 0].argmax()]
        return np.array([[first, last, last]])


def _beyond(hull: Array, triangles: Array, slack: float) -> float:
    """Returns the estimate for triangles (h, 3, 3) of a hull and (t, 3, 3) of what is in it; 0 where it is not notable."""
    if not len(triangles):
        return 0.0
    distances, spread = _Distances(triangles), _spread(hull, _POINTS)[::-1]
    most = distances.at_most(np.array([weights @ triangle for weights, triangle in spread]))
    farthest, reached = spread[int(most.argmax())], 0.0
    for k in np.argsort(-most, kind="stable").tolist():
        if most[k] <= reached or distances.looks <= 0:
            break
        if (distance := distances.of(spread[k][0] @ spread[k][1])) > reached:
            farthest, reached = spread[k], distance
    reached = _climbed(*farthest, reached, distances) - slack
    return reached if reached > _NOTABLE * float(np.ptp(hull.reshape(-1, 3), axis=0).max()) else 0.0


def _spread(triangles: Array, count: int) -> list[tuple[Array, Array]]:
    """Returns about ``count`` points of the largest of triangles (t, 3, 3), on a lattice in each: weights (3,), and the triangle."""
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1) / 2
    whole = areas.sum() or 1.0
    found = []
    for k in np.argsort(areas)[-count:]:
        steps = max(1, int(np.ceil(np.sqrt(2 * count * areas[k] / whole))))
        lattice = [((i + 1 / 3) / steps, (j + 1 / 3) / steps) for i in range(steps) for j in range(steps - i)]
        found += [(np.array([1 - x - y, x, y]), triangles[k]) for x, y in lattice]
    return found


def _climbed(weights: Array, triangle: Array, reached: float, distances: _Distances) -> float:
    """Returns the greatest distance that a climb within the triangle finds."""
    step = 1 / 4
    for _ in range(_CLIMBS):
        if distances.looks <= 0:
            break
        moved = [np.maximum(weights + step * move, 0.0) for move in _MOVES]
        found = [(distances.of(w @ triangle / w.sum()), k) for k, w in enumerate(moved)]
        distance, k = max(found)
        if distance > reached:
            reached, weights = distance, moved[k] / moved[k].sum()
        else:
            step /= 2
    return reached


class _Distances:
    """Gives the distances of points from the nearest of triangles (t, 3, 3).

    Attributes:
        looks: how many distances from triangles may still be taken; the caller stops at 0.
    """

    def __init__(self, triangles: Array) -> None:
        self._triangles, self._middles = triangles, triangles.mean(axis=1)
        self._reach = np.linalg.norm(triangles - self._middles[:, None], axis=2).max(axis=1)
        self.looks = _LOOKS + _LOOKS_A_TRIANGLE * len(triangles)

    def at_most(self, points: Array) -> Array:
        """Returns the distances of points (k, 3) from the nearest middle of a triangle, (k,)."""
        found: Array = cKDTree(self._middles).query(points)[0]
        return found

    def of(self, point: Array) -> float:
        """Returns the distance of a point (3,).

        That from a triangle is at least the distance from its middle less the middle's from the corners. So few have to be looked at.
        """
        far = np.linalg.norm(self._middles - point, axis=1)
        near = self._triangles[far - self._reach <= far.min()]
        self.looks -= len(near) + len(far) // _MIDDLES
        return float(np.sqrt(_squared(point, near).min()))


def _squared(point: Array, triangles: Array) -> Array:
    """Returns the squared distances of a point (3,) from triangles (t, 3, 3), (t,).

    The nearest point is on an edge, or it is the foot of the perpendicular where that is inside.
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    best = np.minimum.reduce([_squared_from_edge(point, p, q) for p, q in ((a, b), (b, c), (c, a))])
    normal = _cross(b - a, c - a)
    area = np.einsum("ij,ij->i", normal, normal)
    sides = np.array([np.einsum("ij,ij->i", _cross(q - p, point - p), normal) for p, q in ((a, b), (b, c), (c, a))])
    inside = (area > 0) & (sides >= 0).all(axis=0)
    height = np.einsum("ij,ij->i", point - a, normal)
    return np.where(inside, np.minimum(best, height**2 / np.where(area > 0, area, 1.0)), best)


def _squared_from_edge(point: Array, p: Array, q: Array) -> Array:
    along = q - p
    length = np.einsum("ij,ij->i", along, along)
    t = np.clip(np.einsum("ij,ij->i", point - p, along) / np.where(length > 0, length, 1.0), 0.0, 1.0)
    rest = point - p - t[:, None] * along
    return np.einsum("ij,ij->i", rest, rest)


def _cross(p: Array, q: Array) -> Array:
    """Returns the cross products of rows (t, 3). For the few rows of a look, NumPy's own takes three times as long."""
    (a, b, c), (x, y, z) = p.T, q.T
    return np.column_stack([b * z - c * y, c * x - a * z, a * y - b * x])
