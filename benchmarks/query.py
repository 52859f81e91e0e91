"""This module measures questions about many regions, beside the plain product of all faces with the points.

The regions are made up, as far apart and as cut off as the arguments say: random boxes, each cut by random faces around its centre, with
boxes around them as tight as those of stored regions. Times are processor time, in one process that holds everything already.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks import measure
from benchmarks.arms import serial_arm
from benchmarks.measure import Progress
from certifier.model import Array, Polytope, Scene, StoredRegion
from certifier.polytopes.polytope import bounds
from planner.library import Library
from planner.membership import locate
from planner.motion.path import follow
from planner.motion.space import Space
from planner.nearest import nearest
from planner.overlap import beside, overlap

JOINTS, REGIONS, POINTS = 7, 10_000, 1000
FACES = (50, 600)
"""The smallest and the largest number of faces of a region, joint limits included."""
SIZES = (1.0, 1.5)
"""Half-widths of the boxes, as multiples of 0.3 to 1.2; centres are within 1.5 of 0 on every axis."""
REPEAT = 9
"""A figure is the median of this many runs."""
PLAIN, EACH = 5, 50
"""The plain product is measured on PLAIN of the points, and every other question is asked EACH times."""


def query(regions: int, progress: Progress, sizes: Sequence[float] = SIZES) -> dict[str, Any]:
    """Measures questions about the given number of regions of each size. Returns the document of ``ciris bench query``."""
    rows = [_measured(regions, size) for size in sizes]
    for row in rows:
        progress(_line(row))
    return {"benchmark": "query", "machine": measure.machine(), "joints": JOINTS, "points": POINTS, "repeat": REPEAT, "rows": rows}


def _measured(count: int, size: float) -> dict[str, Any]:
    rng = np.random.default_rng(0)
    made, centers = _regions(rng, count, size)
    library, build = _changed(Library(JOINTS), made[:-REPEAT])
    adding = []
    for region in made[-REPEAT:]:
        library, seconds = _changed(library, [region])
        adding.append(seconds)
    near = centers[rng.integers(0, count, POINTS // 2)] + 0.3 * rng.uniform(-1, 1, (POINTS // 2, JOINTS))
    s = np.concatenate([near, rng.uniform(-2.5, 2.5, (POINTS - len(near), JOINTS))])
    scene = serial_arm(JOINTS, [])
    found = locate(library, s)
    each = slice(0, EACH)
    ends = list(zip(s[each], s[EACH : 2 * EACH], strict=True))
    pairs = [(a, 0) for a in beside(library, 0, range(1, count))[:EACH]]
    return {
        "regions": count,
        "size": size,
        "faces": len(library.faces),
        "megabytes": (library.faces.nbytes + library.norms.nbytes) / 1e6,
        "hits": len(found.point) / POINTS,
        "build_seconds": build,
        "add_ms": 1e3 * float(np.median(adding)),
        "contains_ms": 1e3 * _median(lambda: locate(library, s), REPEAT),
        "plain_point_ms": 1e3 * _median(lambda: _plain(library, s[:PLAIN]), 3) / PLAIN,
        "nearest_ms": 1e3 * _median(lambda: [nearest(library, x) for x in s[each]], 1) / EACH,
        "segment_s_ms": 1e3 * _median(lambda: _follow(library, scene, Space.S, ends), 1) / EACH,
        "segment_q_ms": 1e3 * _median(lambda: _follow(library, scene, Space.Q, ends), 1) / EACH,
        "overlap_ms": 1e3 * _median(lambda: [overlap(library, a, b) for a, b in pairs], 1) / max(len(pairs), 1),
    }


def _changed(library: Library, added: Sequence[StoredRegion]) -> tuple[Library, float]:
    """Returns the library with these regions too, and the processor seconds that this took."""
    start = time.process_time()
    changed = library.changed(library.version + 1, library.ids, added)
    return changed, time.process_time() - start


def _follow(library: Library, scene: Scene, space: Space, ends: Sequence[tuple[Array, Array]]) -> None:
    for a, b in ends:
        waypoints = np.stack([a, b])
        follow(library, scene, space, waypoints if space is Space.S else scene.to_q(waypoints), [0.0, 1.0])


def _plain(library: Library, s: Array) -> Array:
    """Returns the margin of every point in every region, (k, r), from the product of all faces with all points."""
    faces = library.faces
    slack = faces[:, -1:] - faces[:, :-1] @ s.T
    return np.asarray(np.minimum.reduceat(slack / library.norms[:, None], library.first[:-1]).T)


def _regions(rng: np.random.Generator, count: int, size: float) -> tuple[list[StoredRegion], Array]:
    """Returns regions, and their centres (count, n)."""
    centers, half = rng.uniform(-1.5, 1.5, (count, JOINTS)), size * rng.uniform(0.3, 1.2, (count, JOINTS))
    eye, made = np.eye(JOINTS), []
    for i, faces in enumerate(rng.integers(FACES[0], FACES[1] + 1, count) - 2 * JOINTS):
        normals = rng.normal(size=(faces, JOINTS))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        C = np.concatenate([normals / half[i], eye, -eye])
        far = rng.uniform(0.7, 1.3, faces)
        d = np.concatenate([C[:faces] @ centers[i] + far, centers[i] + half[i], half[i] - centers[i]])
        made.append(StoredRegion(str(i), "exact", C, d, *bounds(Polytope(C, d))))
    return made, centers


def _median(function: Callable[[], Any], repeat: int) -> float:
    """Returns the median of the processor seconds that a call takes."""
    seconds = []
    for _ in range(repeat):
        start = time.process_time()
        function()
        seconds.append(time.process_time() - start)
    return float(np.median(seconds))


def _line(row: dict[str, Any]) -> str:
    return f"{row['regions']} regions, {row['hits']:.1f} of them at a point: {POINTS} points in {row['contains_ms']:.1f} ms"
