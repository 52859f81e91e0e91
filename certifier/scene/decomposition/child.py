"""The child process that decomposes a mesh runs CoACD here, and enlarges the parts until they hold all of the mesh.

CoACD's parts may leave something out: it rounds, it merges parts, and it may fail to cut a mesh that meets itself. So nothing of it is
believed. A piece of the mesh that is in no part is added to the nearest part, until every triangle is in the parts
(:mod:`.containment`), and so is every point of lattices within the solid.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import coacd
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.spatial import ConvexHull, QhullError

from certifier.errors import SceneError
from certifier.model import Array
from certifier.scene.decomposition.containment import Part, uncovered
from certifier.scene.decomposition.solid import closed, fault, inside, solids, welded
from certifier.scene.hollow import beyond_solid
from certifier.scene.hull import outer

_MOST = 64
"""A mesh has at most this many parts."""
_GROWTH = 5e-5
"""Parts grow by this fraction of the mesh's length, so that neighbours overlap. Between CoACD's parts are gaps of 2e-5 of it."""
_PIECE = 0.01
"""A piece that is longer than this fraction of the mesh's length is cut up before it goes to the nearest part, unless it is next to it."""
_LONGEST = 100.0
"""A vertex of a part moves at most this many times as far as the part grows. Vertices of thin wedges would move farther."""
_ROUNDS = 8
"""In each round, the parts that lack something grow twice as much."""
_SHIFTS = (0.5, 0.1, 0.8)
"""The lattices that are tried in the inside."""
_COARSER = "write a larger threshold, or a simpler mesh"
_HULL = "mend the mesh, or leave the entry out: a hull then stands for it"


def decompose(payload: dict[str, Any]) -> dict[str, Any]:
    """Returns ``parts``: of each convex part ``vertices`` (v, 3), its ``inflation`` and how far it reaches ``beyond``, all in metres.

    The parts hold every triangle of the mesh beyond doubt. The inflation says how far a part reaches at most beyond the hull of what
    CoACD and the mesh have put into it, and ``beyond`` how far it reaches at least beyond the solid.

    Args:
        payload: ``points`` (k, 3) metres; ``triangles`` (t, 3); ``threshold`` in metres, how far parts may reach beyond the solid, as
            CoACD measures it; ``max_vertices`` of a part.

    Raises:
        SceneError: ``decompose``, where the mesh bounds no solid, has too many parts, or no parts that hold it are found.
    """
    points, triangles = closed(*welded(payload["points"], payload["triangles"]))
    if problem := fault(points, triangles):
        raise SceneError("decompose", f"the mesh bounds no solid: {problem}", field="decompose", hint=_HULL)
    found = [part for solid in solids(points, triangles) for part in _cut(*welded(points, solid), payload["threshold"])]
    if len(found) > _MOST:
        raise SceneError(
            "decompose", f"the mesh falls into {len(found)} parts; at most {_MOST} are accepted", field="decompose", hint=_COARSER
        )
    spots = [inside(points, triangles, shift) for shift in _SHIFTS]
    parts = enlarged(found, payload["points"], payload["triangles"], spots, payload["max_vertices"])
    return {
        "parts": [
            {"vertices": vertices, "inflation": inflation, "beyond": beyond_solid(vertices, points, triangles)}
            for vertices, inflation in parts
        ]
    }


def _cut(points: Array, triangles: NDArray[np.int64], threshold: float) -> list[Array]:
    """Returns what CoACD makes of a solid: the points of its parts, (k, 3) each.

    It makes no new surface of a mesh that meets itself. Such a surface is far off, and takes ten times as long.
    """
    coacd.set_log_level("error")
    mesh = coacd.Mesh(points, triangles.astype(np.int32))
    return [part for part, _ in coacd.run_coacd(mesh, threshold=threshold, preprocess_mode="off", seed=0, real_metric=True)]


def enlarged(
    clouds: Sequence[Array], points: Array, triangles: NDArray[np.int64], spots: Sequence[Array], max_vertices: int
) -> list[tuple[Array, float]]:
    """Returns the vertices (v, 3) and the inflation of parts that hold the hulls of clouds of points, every triangle, and more points.

    Args:
        clouds: (k, 3) for each part.
        points, triangles: (k, 3) metres, and (t, 3) numbers of points.
        spots: more points that have to be in the parts, (k, 3) each. Later ones are looked at when nothing of the others is left out.
        max_vertices: of a part.

    Raises:
        SceneError: ``decompose``, where this does not end; ``hull``, as :func:`outer`.
    """
    size = float(np.ptp(points, axis=0).max())
    clouds, used = [_grown(cloud, _GROWTH * size) for cloud in clouds], points[np.unique(triangles)]
    parts = [_part(cloud) for cloud in clouds]
    for attempt in range(_ROUNDS):
        left = _left_out(parts, used, points, triangles, spots)
        if not left:
            return [outer(cloud, max_vertices)[:2] for cloud in _needed(clouds, parts)]
        added: dict[int, list[Array]] = {}
        for k, piece in _assigned(left, parts, size):
            added.setdefault(k, []).append(piece)
        for k, pieces in added.items():
            clouds[k] = _grown(np.concatenate([clouds[k], *pieces]), 2**attempt * _GROWTH * size)
            parts[k] = _part(clouds[k])
    raise SceneError("decompose", f"no {len(clouds)} convex parts were found that hold all of the mesh", field="decompose", hint=_COARSER)


def _assigned(pieces: list[Array], parts: Sequence[Part], size: float) -> Iterator[tuple[int, Array]]:
    """Yields numbers of parts, and what of convex pieces of the mesh, (k, 3) each, is nearest to each."""
    while pieces:
        starts = np.cumsum([0, *map(len, pieces[:-1])])
        depths = np.array([np.minimum.reduceat(part.depths(np.concatenate(pieces)), starts) for part in parts])
        nearest, deepest, halves = depths.argmax(axis=0).tolist(), depths.max(axis=0), list[Array]()
        for piece, k, depth in zip(pieces, nearest, deepest, strict=True):
            if depth >= -2 * _GROWTH * size or np.linalg.norm(np.roll(piece, -1, axis=0) - piece, axis=1).max() <= _PIECE * size:
                yield k, piece
            else:
                halves += _halves(piece)
        pieces = halves


def _halves(piece: Array) -> list[Array]:
    """Returns two halves of a convex polygon (k, 3), between the middle of its longest side and what is opposite."""
    longest = int(np.linalg.norm(np.roll(piece, -1, axis=0) - piece, axis=1).argmax())
    turned, opposite = np.roll(piece, -longest, axis=0), (len(piece) + 1) // 2
    middle = turned[:2].mean(axis=0)
    return [np.array([middle, *turned[1 : opposite + 1]]), np.array([middle, *turned[opposite:], turned[0]])]


def _left_out(parts: Sequence[Part], used: Array, points: Array, triangles: NDArray[np.int64], spots: Sequence[Array]) -> list[Array]:
    """Returns pieces of the mesh or single points, (k, 3) each, that are in no part; none where everything is in the parts."""
    for cloud in (used, None, *spots):
        if cloud is None:
            left = uncovered(parts, points, triangles)
        else:
            depth = np.max([part.depths(cloud) for part in parts], axis=0, initial=-np.inf) if len(cloud) else np.zeros(0)
            left = list(cloud[depth < 0][:, None])
        if left:
            return left
    return []


def _needed(clouds: Sequence[Array], parts: Sequence[Part]) -> list[Array]:
    """Returns the clouds but those that are in the part of another one."""
    needed = list(range(len(clouds)))
    for k in range(len(clouds)):
        if any(parts[other].depths(clouds[k]).min() >= 0 for other in needed if other != k):
            needed.remove(k)
    return [clouds[k] for k in needed]


def _grown(points: Array, by: float) -> Array:
    """Returns the vertices of a cloud's hull, (h, 3), moved outwards.

    Each moves the least distance that takes it ``by`` metres beyond the plane of every facet that it belongs to. Nonnegative least squares
    find this distance (Lawson and Hanson). A vertex of a thin wedge moves less (_LONGEST).
    """
    try:
        hull = ConvexHull(points)
    except QhullError:
        raise _too_thin() from None
    facets: dict[int, list[int]] = {k: [] for k in hull.vertices.tolist()}
    for facet, corners in enumerate(hull.simplices.tolist()):
        for k in corners:
            facets[k].append(facet)
    return points[hull.vertices] + by * np.array([_out_of(hull.equations[found, :3]) for found in facets.values()])


def _out_of(normals: Array) -> Array:
    """Returns the shortest vector u, (3,), with n'u >= 1 for unit normals n, (h, 3); a shorter one where it would be very long."""
    rows = np.vstack([normals.T, np.ones(len(normals))])
    weights, _ = nnls(rows, np.array([0.0, 0.0, 0.0, 1.0]))
    rest = rows @ weights - [0, 0, 0, 1]
    u = -rest[:3] / min(rest[3], -1e-9)
    return u * min(1.0, _LONGEST / float(np.linalg.norm(u)))


def _too_thin() -> SceneError:
    return SceneError("decompose", "a part of the mesh is too thin", field="decompose", hint=_HULL)


def _part(cloud: Array) -> Part:
    try:
        return Part(cloud)
    except QhullError:
        raise _too_thin() from None
