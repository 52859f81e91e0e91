"""The meshes of a scene's models are made ready here to be drawn beside the bodies that are certified. No proof depends on them.

A browser draws a limited number of triangles. Where the models have more, points that are near each other become one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array
from certifier.scene.meshes.mesh import Mesh

MOST_DRAWN = 60_000
"""A scene's meshes are drawn with at most this many triangles."""
MOST_READ = 1_000_000
"""Meshes with more triangles are not drawn at all: making them coarser would take too long."""
MOST_MESHES = 2000
"""So are more meshes than this."""
_STEP = 1.25
"""Cells in which points become one are larger by this factor than those that were too small."""
_LEAST = 1e-6
"""Cells are at least this part of the meshes' farthest coordinate."""
_DIGITS = 6
"""Coordinates are rounded to micrometres."""


@dataclass(frozen=True)
class Placed:
    """A mesh of a model, and where it is.

    Attributes:
        geometry: name of the collision geometry.
        body: name of the body that it is fixed to.
        scale: (3,) factors of the points.
        X_BG: (4, 4) pose of the scaled mesh on the body, metres.
    """

    geometry: str
    body: str
    mesh: Mesh
    scale: Array
    X_BG: Array

    @property
    def points(self) -> Array:
        """Returns the points (k, 3) in the frame of the body, metres."""
        return (self.mesh.points * self.scale) @ self.X_BG[:3, :3].T + self.X_BG[:3, 3]


def document(placed: Sequence[Placed]) -> dict[str, Any] | None:
    """Returns the meshes as JSON-able data, within the limits; None where there is no mesh.

    ``meshes`` have a ``geometry``, a ``body``, ``vertices`` (k, 3) in the frame of the body, metres, and ``triangles`` (t, 3), the numbers
    of their vertices. There are none where the models have too many or too large ones. ``triangles`` says how many the models have, and
    ``moved`` how far a point is drawn from where its file has it, at most, in metres.
    """
    count = sum(len(one.mesh.triangles) for one in placed)
    if not count:
        return None
    if count > MOST_READ or len(placed) > MOST_MESHES:
        return {"meshes": [], "triangles": count, "moved": 0.0}
    whole = [_used(one.points, one.mesh.triangles) for one in placed]
    drawn, moved = _few(whole)
    meshes = [
        {"geometry": one.geometry, "body": one.body, "vertices": points.round(_DIGITS).tolist(), "triangles": triangles.tolist()}
        for one, (points, triangles) in zip(placed, drawn, strict=True)
        if len(triangles)
    ]
    return {"meshes": meshes, "triangles": count, "moved": moved}


_Triangles = tuple[Array, NDArray[np.int64]]
"""Points (k, 3) and the numbers of those of triangles (t, 3)."""


def _few(whole: list[_Triangles]) -> tuple[list[_Triangles], float]:
    """Returns the meshes with at most MOST_DRAWN triangles together, and how far a point moved, at most, in metres."""
    drawn, moved = whole, 0.0
    cell = _finest(whole)
    while sum(len(triangles) for _, triangles in drawn) > MOST_DRAWN:
        coarser = [_coarser(points, triangles, cell) for points, triangles in whole]
        drawn, moved = [mesh for mesh, _ in coarser], max(distance for _, distance in coarser)
        cell *= _STEP
    return drawn, moved


def _finest(whole: list[_Triangles]) -> float:
    """Returns the cells, in metres, to begin with: about a triangle of MOST_DRAWN has the area of one."""
    corners = [points[triangles] for points, triangles in whole]
    area = sum(float(np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).sum()) / 2 for c in corners)
    extent = max(float(np.abs(points).max(initial=0.0)) for points, _ in whole)
    return max(np.sqrt(area / MOST_DRAWN), _LEAST * extent) or 1.0


def _coarser(points: Array, triangles: NDArray[np.int64], cell: float) -> tuple[_Triangles, float]:
    """Returns a mesh in which one point stands for all in a cube of the lattice, and how far one of them is from it, at most, in metres."""
    places = np.floor(points / cell).astype(np.int64)
    places -= places.min(axis=0)
    keys = np.ravel_multi_index(tuple(places.T), tuple(places.max(axis=0) + 1))
    off = np.linalg.norm(points / cell % 1 - 0.5, axis=1)
    order = np.lexsort((off, keys))
    _, first, number = np.unique(keys[order], return_index=True, return_inverse=True)
    stands, numbers = points[order[first]], np.empty(len(points), dtype=np.int64)
    numbers[order] = number
    moved = float(np.linalg.norm(points - stands[numbers], axis=1).max(initial=0.0))
    corners = numbers[triangles]
    a, b, c = corners.T
    return _used(stands, corners[(a != b) & (b != c) & (c != a)]), moved


def _used(points: Array, triangles: NDArray[np.int64]) -> _Triangles:
    """Returns the mesh without the points that no triangle has."""
    used, number = np.unique(triangles, return_inverse=True)
    return points[used], number.reshape(-1, 3)
