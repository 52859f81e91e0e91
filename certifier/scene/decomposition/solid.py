"""A mesh that is decomposed bounds a solid. Whether it does is checked here, and points of its inside are found.

A body inside of the solid touches no triangle, and yet it collides. So the parts have to fill the inside as well, and a mesh without an
inside is refused.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from certifier.model import Array

_CELLS = 48
"""This many columns of points cross the longer side of a mesh."""
_FLAT = 1e-5
"""A mesh that is thinner than this fraction of its size counts as flat, as for its hull."""

_HOLE = 0.2
"""A hole is closed if its edges together are at most this fraction of the mesh's length."""
_TURNS = (1.0, 2**0.5, 3**0.5)
"""The lattice is moved by different fractions along x, y and z, so that its columns miss the diagonals of boxes."""


def welded(points: Array, triangles: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Returns the mesh with one point for all that are equal, without triangles that are there already or have a point twice."""
    unique, number = np.unique(points + 0.0, axis=0, return_inverse=True)
    corners = number.reshape(-1)[triangles]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    first = corners.argmin(axis=1)[:, None]
    corners = np.unique(np.take_along_axis(corners, (first + np.arange(3)) % 3, axis=1), axis=0)
    used, number = np.unique(corners, return_inverse=True)
    return unique[used], number.reshape(-1, 3)


def closed(points: Array, triangles: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Returns a welded mesh whose small holes are closed, each by triangles around the middle of its edges.

    What fills a hole is only added to the solid, so the parts can hold more than they have to, and not less.
    """
    if len(triangles) == 0:
        return points, triangles
    (low, high), balance, _ = _edges(points, triangles)
    following: dict[int, list[int]] = {}
    for a, b, net in zip(low.tolist(), high.tolist(), balance.tolist(), strict=True):
        begin, end = (b, a) if net > 0 else (a, b)
        following.setdefault(begin, []).extend([end] * abs(net))
    size, middles, patches = float(np.ptp(points, axis=0).max()), list[Array](), list[tuple[int, int, int]]()
    for loop in _loops(following):
        around = points[loop]
        if np.linalg.norm(np.roll(around, -1, axis=0) - around, axis=1).sum() <= _HOLE * size:
            patches += [(a, b, len(points) + len(middles)) for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)]
            middles.append(around.mean(axis=0))
    if not patches:
        return points, triangles
    return np.concatenate([points, middles]), np.concatenate([triangles, patches])


def _loops(following: dict[int, list[int]]) -> list[list[int]]:
    """Returns the simple loops of directed edges that go round in circles, given by the ends of the edges that begin at a point."""
    loops = []
    for start in following:
        while following[start]:
            way, place = [start], {start: 0}
            while way:
                point = following[way[-1]].pop()
                if point in place:  # the way has come round
                    loops.append(way[place[point] :])
                    for left in loops[-1][1:]:
                        del place[left]
                    way = way[: place[point] + 1]
                    if len(way) == 1:
                        break
                else:
                    place[point] = len(way)
                    way.append(point)
    return loops


def _edges(points: Array, triangles: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Returns the edges of triangles (t, 3), which have e edges.

    These are the numbers of their two points, (2, e), the lower one first; how many more triangles have each from the lower one to the
    higher one than the other way, (e,); and how many triangles have each, (e,).
    """
    edges = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    forth = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    both, number = np.unique(edges.min(axis=1) * len(points) + edges.max(axis=1), return_inverse=True)
    balance = np.bincount(number, weights=forth).astype(np.int64)
    return np.array(np.divmod(both, len(points))), balance, np.bincount(number)


def fault(points: Array, triangles: NDArray[np.int64]) -> str | None:
    """Returns why a welded mesh bounds no solid, for people; None if it does.

    It does where every edge is in as many triangles in the one direction as in the other. Such a surface winds round every point that is
    not on it a whole number of times.
    """
    if len(triangles) == 0 or _thinnest(points) <= _FLAT * np.ptp(points, axis=0).max():
        return "it is flat"
    _, balance, count = _edges(points, triangles)
    if (count % 2).any():
        return f"it is open: {int((count % 2).sum())} of its {len(count)} edges have a triangle on one side only"
    if balance.any():
        return f"its triangles do not face the same way at {int((balance != 0).sum())} of its {len(count)} edges"
    return None


def _thinnest(points: Array) -> float:
    """Returns the extent of points along the axis along which they spread least."""
    offsets = points - points.mean(axis=0)
    return float(np.ptp(offsets @ np.linalg.eigh(offsets.T @ offsets)[1][:, 0]))


def solids(points: Array, triangles: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Returns the triangles of each solid of a closed mesh, facing outwards.

    Pieces of the mesh that share no point are solids of their own, which may overlap. Where one of them bounds a hollow, all are one solid.
    """
    if _volume(points, triangles) < 0:
        triangles = triangles[:, ::-1]
    neighbours = coo_array((np.ones(3 * len(triangles)), (triangles.ravel(), np.roll(triangles, 1, axis=1).ravel())), 2 * (len(points),))
    count, piece = connected_components(neighbours, directed=False)
    pieces = [triangles[piece[triangles[:, 0]] == k] for k in range(count)]
    return pieces if all(_volume(points, one) > 0 for one in pieces) else [triangles]


def _volume(points: Array, triangles: NDArray[np.int64]) -> float:
    """Returns six times the volume that triangles bound, which is negative where they face inwards."""
    a, b, c = (points - points.mean(axis=0))[triangles.T]
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))


def wound(corners: Array, spots: Array) -> NDArray[np.bool_]:
    """Returns which of the spots (k, 3) a closed surface of triangles (t, 3, 3) winds round.

    It adds up the solid angles of the triangles, by the formula of van Oosterom and Strackee.
    """
    found = np.zeros(len(spots))
    for k, spot in enumerate(spots):
        a, b, c = (corners - spot).transpose(1, 0, 2)
        x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        found[k] = np.arctan2(volume, x * y * z + ab * z + bc * x + ca * y).sum() / (2 * np.pi)
    return np.abs(found) > 0.5


def inside(points: Array, triangles: NDArray[np.int64], shift: float) -> Array:
    """Returns points (k, 3) of a lattice that are inside of a mesh: it winds round each of them.

    Args:
        shift: moves the lattice by this fraction of its spacing along x, and by others along y and z.
    """
    lower, size = points.min(axis=0), np.ptp(points, axis=0)
    spacing = float(size.max()) / _CELLS
    xs, ys, zs = (
        low + spacing * (np.arange(int(extent / spacing) + 1) + shift * turn % 1)
        for low, extent, turn in zip(lower, size, _TURNS, strict=True)
    )
    found = []
    for (i, j), hits in _crossings(points[triangles], xs, ys).items():
        heights, signs = np.array(hits).T
        order = np.argsort(heights)
        winding = np.concatenate([[0.0], np.cumsum(signs[order])])
        if winding[-1] != 0:  # the column meets an edge
            continue
        within = zs[winding[np.searchsorted(heights[order], zs)] != 0]
        found.append(np.column_stack([np.full(len(within), xs[i]), np.full(len(within), ys[j]), within]))
    return np.concatenate([np.zeros((0, 3)), *found])


def _crossings(corners: Array, xs: Array, ys: Array) -> dict[tuple[int, int], list[tuple[float, float]]]:
    """Returns by column the heights at which triangles (t, 3, 3) cross it, each with 1 for upwards or -1."""
    found: dict[tuple[int, int], list[tuple[float, float]]] = {}
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    first, last = np.searchsorted(xs, lower[:, 0]), np.searchsorted(xs, upper[:, 0])
    begin, end = np.searchsorted(ys, lower[:, 1]), np.searchsorted(ys, upper[:, 1])
    for k in np.flatnonzero((first < last) & (begin < end)).tolist():
        a, b, c = corners[k]
        x, y = xs[first[k] : last[k], None], ys[None, begin[k] : end[k]]
        sides = np.array([(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((b, c), (c, a), (a, b))])
        area = sides.sum(axis=0)
        hit = (sides > 0).all(axis=0) | (sides < 0).all(axis=0)
        for i, j in np.argwhere(hit).tolist():
            height = float(sides[:, i, j] @ corners[k][:, 2] / area[i, j])
            found.setdefault((first[k] + i, begin[k] + j), []).append((height, 1.0 if area[i, j] > 0 else -1.0))
    return found
