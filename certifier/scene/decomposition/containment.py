"""Whether convex parts hold every triangle of a mesh together is decided here in exact arithmetic.

A triangle is cut along the faces of a part. What is inside is held, and the pieces outside go to the next part. Pieces that no part takes
are left. Corners are integers in homogeneous coordinates, so no cut is rounded, and no piece can be lost between two others.

Of a part, only the half-spaces count whose common part is in it beyond doubt (:func:`certifier.scene.hull.inner`). Floating point decides
where it is sure, which is nearly always.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array
from certifier.scene.hull import depths, inner

_SURE = 1e-12
"""Values of floating point that are farther from 0 than this, relative to the largest coordinate, have the right sign."""
_Corner = tuple[int, int, int, int]
"""x, y, z and w > 0 stand for the point (x, y, z) / w."""


class Part:
    """Holds a convex part, given by its vertices (v, 3), metres.

    Raises:
        QhullError: the part is flat.
    """

    def __init__(self, vertices: Array) -> None:
        self.vertices = vertices
        self.normals, self.offsets = inner(vertices)

    def depths(self, points: Array) -> Array:
        """Returns how deep points (k, 3) are in the part at least, metres, (k,); negative outside."""
        return depths(self.normals, self.offsets, points)

    @cached_property
    def faces(self) -> list[_Corner]:
        """The half-spaces a x + b y + c z + d w <= 0 in integers."""
        return [_integers((*normal, offset)) for normal, offset in zip(self.normals.tolist(), self.offsets.tolist(), strict=True)]


def uncovered(parts: Sequence[Part], points: Array, triangles: NDArray[np.int64]) -> list[Array]:
    """Returns the pieces of triangles that are in none of the parts: convex polygons, (k, 3) each, whose corners are rounded.

    Without pieces, the parts hold every point of every triangle.

    Args:
        points: (k, 3) metres.
        triangles: (t, 3) numbers of points.
    """
    parts = [part for part in parts if np.isfinite(part.offsets).all()]
    left = np.ones(len(triangles), dtype=bool)
    for part in parts:
        inside = part.depths(points) >= 0
        left &= ~inside[triangles].all(axis=1)
    return [piece for triangle in points[triangles[left]] for piece in _pieces(triangle, parts)]


def _pieces(triangle: Array, parts: Sequence[Part]) -> list[Array]:
    common = max(x.as_integer_ratio()[1] for x in triangle.ravel().tolist())
    polygons = [[_homogeneous(corner, common) for corner in triangle.tolist()]]
    for part in parts:
        polygons = [piece for polygon in polygons for piece in _outside(polygon, part)]
    return [_rounded(polygon) for polygon in polygons]


def _outside(polygon: list[_Corner], part: Part) -> list[list[_Corner]]:
    """Returns the pieces of a convex polygon that are not in a part; what is cut goes through on both sides of the cut."""
    rounded = _rounded(polygon)
    values = rounded @ part.normals.T + part.offsets
    sure = _SURE * max(float(np.abs(rounded).max()), float(np.abs(part.offsets).max()))
    if (values.min(axis=0) > sure).any():
        return [polygon]
    pieces, rest = [], polygon
    for k in np.flatnonzero(values.max(axis=0) >= -sure).tolist():
        a, b, c, d = part.faces[k]
        heights = [a * x + b * y + c * z + d * w for x, y, z, w in rest]
        if max(heights) <= 0:
            continue
        if min(heights) >= 0:
            return [polygon]
        pieces.append(_cut(rest, heights))
        rest = _cut(rest, [-height for height in heights])
    return pieces


def _cut(polygon: list[_Corner], heights: Sequence[int]) -> list[_Corner]:
    """Returns the piece of a convex polygon where the heights of its corners over a plane are 0 or more."""
    piece = []
    for k, (corner, height) in enumerate(zip(polygon, heights, strict=True)):
        before, lower = polygon[k - 1], heights[k - 1]
        if (height > 0 > lower) or (height < 0 < lower):
            piece.append(_between(before, lower, corner, height))
        if height >= 0:
            piece.append(corner)
    return piece


def _between(p: _Corner, p_height: int, q: _Corner, q_height: int) -> _Corner:
    """Returns where the line through two corners on different sides of a plane meets it."""
    one, other = abs(q_height), abs(p_height)
    x, y, z, w = (one * a + other * b for a, b in zip(p, q, strict=True))
    common = math.gcd(x, y, z, w)
    return x // common, y // common, z // common, w // common


def _rounded(polygon: Sequence[_Corner]) -> Array:
    return np.array([[x / w, y / w, z / w] for x, y, z, w in polygon])


def _integers(numbers: Sequence[float]) -> _Corner:
    """Returns integers that have the ratios of four numbers."""
    common = max(x.as_integer_ratio()[1] for x in numbers)
    a, b, c, d = (_scaled(x, common) for x in numbers)
    return a, b, c, d


def _homogeneous(point: Sequence[float], common: int) -> _Corner:
    x, y, z = (_scaled(coordinate, common) for coordinate in point)
    return x, y, z, common


def _scaled(x: float, common: int) -> int:
    numerator, denominator = x.as_integer_ratio()
    return numerator * (common // denominator)
