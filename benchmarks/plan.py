"""This module measures how trajectories are planned through certified regions, beside RRT-Connect on the same questions.

Seconds are by the clock, because a child process makes the curves; nothing else should run on the machine.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from benchmarks.rrt import RESOLUTION, RRTConnect
from certifier.errors import CirisError
from certifier.isolation.child import run_in_child
from certifier.model import Array, Polytope, Scene, StoredRegion
from certifier.outcome import Guarantee
from certifier.pair.collisions import in_collision
from certifier.polytopes.gibbs import uniform_in_q
from certifier.polytopes.polytope import bounds
from certifier.proof.region import RegionProof
from certifier.scene import load_scene
from client import service
from client.inputs import is_scene_file
from client.polytopes import polytope_file
from planner.cover.ground import free_samples
from planner.library import Library
from planner.overlap import beside, components, overlap
from planner.trajectory.plan import Answer, Limits, Trajectory, plan
from planner.trajectory.routes import Links

QUERIES = 100
SPEED, ACCELERATION = 1.0, 2.0
TIMEOUT_S, MEMORY = 60.0, 16 << 30
RRT_SECONDS = 20.0
"""RRT-Connect gives up after so long."""
DENSE = 20
"""The check whether a path collides takes this many configurations for each one that RRT-Connect looks at."""


def trajectories(name: str, files: list[Path], url: str | None, queries: int, progress: Progress, free: bool = False) -> dict[str, Any]:
    """Plans between random configurations. Returns the document of ``ciris bench plan``.

    Args:
        name: an example, or a scene file.
        files: regions as manifests, proofs or polytopes, or folders of such; none for those of the service at ``url``.
        free: whether the configurations are uniform among all that are free of collision, in regions or not; else each is in a region.

    Raises:
        CirisError: no_regions, or what is wrong with a file, the scene or the service.
    """
    scene = load_scene(name) if is_scene_file(name) else catalogue.scene(name)
    stored = list(_from_files(files)) if files else _of_service(scene, url)
    if not stored:
        raise CirisError("no_regions", f"there are no regions of {scene.name}", field="--regions", hint="`ciris grow` makes one")
    library = Library(scene.n).changed(1, [], stored)
    start = time.perf_counter()
    links = _links(library, scene)
    compared = time.perf_counter() - start
    progress(f"{len(library)} regions, {len(links.ends)} overlaps")
    rival, rng = RRTConnect(scene), np.random.default_rng(0)
    points = _free(scene, 2 * queries + 2, rng) if free else _points(library, scene, 2 * queries + 2, rng)
    _planned(library, scene, links, points[-2], points[-1])  # loads Drake
    rows = []
    for i, (a, b) in enumerate(zip(points[:queries], points[queries:-2], strict=True)):
        rows.append(_asked(library, scene, links, rival, (a, b), rng))
        progress(_line(i, rows[-1]))
    both = [row for row in rows if row["plan"]["length"] is not None and row["rrt"]["length"] is not None]
    parts = components(len(library), [(one, other) for one, other in links.ends.tolist()])
    return {
        "benchmark": "plan",
        "machine": measure.machine(),
        "scene": scene.name,
        "joints": scene.n,
        "regions": len(library),
        "faces": len(library.faces),
        "overlaps": len(links.ends),
        "components": len(parts),
        "compare_seconds": compared,
        "queries": queries,
        "free": free,
        "connected": sum(row["outcome"] not in ("Apart", "Outside") for row in rows),
        "plan": _summary([row["plan"] for row in rows]),
        "rrt": {**_summary([row["rrt"] for row in rows]), "resolution": RESOLUTION, "limit_seconds": RRT_SECONDS},
        "both": len(both),
        "length_ratio": _quantiles([row["plan"]["length"] / row["rrt"]["length"] for row in both]),
        "rows": rows,
    }


def _asked(
    library: Library, scene: Scene, links: Links, rival: RRTConnect, ends: tuple[Array, Array], rng: np.random.Generator
) -> dict[str, Any]:
    """Returns what both planners make of one question."""
    begin = time.perf_counter()
    found = _planned(library, scene, links, *ends)
    seconds = time.perf_counter() - begin
    theirs = rival.plan(*ends, rng, RRT_SECONDS)
    ours = found.q if isinstance(found, Trajectory) else None
    return {
        "straight": float(np.linalg.norm(ends[1] - ends[0])),
        "outcome": type(found).__name__,
        "plan": {
            "seconds": seconds,
            **_path(scene, ours),
            "duration": float(found.t[-1]) if isinstance(found, Trajectory) else None,
            "pieces": len(found.stretches) if isinstance(found, Trajectory) else None,
        },
        "rrt": {"seconds": theirs.seconds, "first_seconds": theirs.first_seconds, **_path(scene, theirs.path)},
    }


def _planned(library: Library, scene: Scene, links: Links, start: Array, goal: Array) -> Answer:
    """Plans as an API process does: a child makes the curves."""

    def optimise(payload: dict[str, Any]) -> Any:
        return run_in_child("planner.trajectory.curve:optimised", payload, timeout_s=TIMEOUT_S, memory_bytes=MEMORY)

    limits = Limits(np.full(scene.n, SPEED), np.full(scene.n, ACCELERATION))
    return plan(library, scene, links, start, goal, limits, optimise)


def _path(scene: Scene, path: Array | None) -> dict[str, Any]:
    """Returns the length of a path, and whether it collides at one of many configurations."""
    if path is None:
        return {"length": None, "collides": None}
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    return {"length": length, "collides": any(bool(in_collision(scene, scene.to_s(q)).any()) for q in _dense(path))}


def _dense(path: Array) -> Iterator[Array]:
    for a, b in pairwise(path):
        count = int(np.ceil(np.linalg.norm(b - a) / RESOLUTION)) * DENSE + 1
        yield a + np.linspace(0, 1, count)[:, None] * (b - a)


def _points(library: Library, scene: Scene, count: int, rng: np.random.Generator) -> Array:
    """Returns configurations (count, n), each uniform in joint positions in a region that is drawn for it."""
    chosen = rng.integers(0, len(library), count)
    points = np.empty((count, scene.n))
    for region in np.unique(chosen).tolist():
        mine = np.flatnonzero(chosen == region)
        drawn = uniform_in_q(library.polytope(region), scene, chains=len(mine), each=1, seed=region)
        points[mine] = scene.to_q(drawn[:, 0])
    return points


def _free(scene: Scene, count: int, rng: np.random.Generator) -> Array:
    return scene.to_q(free_samples(scene, partial(in_collision, scene), count, rng))


def _links(library: Library, scene: Scene) -> Links:
    pairs = ((a, b) for b in range(len(library)) for a in beside(library, b, range(b)))
    found = [(pair, common) for pair in pairs if (common := overlap(library, *pair)) is not None]
    ends = np.array([pair for pair, _ in found], dtype=np.intp).reshape(-1, 2)
    witness = np.array([common.witness for _, common in found]).reshape(-1, scene.n)
    return Links(ends, witness, np.array([common.depth for _, common in found]), scene.to_q(witness))


def _from_files(paths: list[Path]) -> Iterator[StoredRegion]:
    """Yields the regions of files, and of the files of folders.

    Raises:
        CirisError: as RegionProof.from_bytes and polytope_file.
    """
    for path in paths:
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        proofs = {file.stem for file in files if file.suffix == ".proof"}
        for file in files:
            if file.suffix == ".proof":
                proof = RegionProof.from_bytes(file.read_bytes())
                yield _stored(file.stem, Polytope(proof.C, proof.d))
            elif file.stem not in proofs:
                yield _stored(file.stem, polytope_file(str(file)).polytope)


def _of_service(scene: Scene, url: str | None) -> list[StoredRegion]:
    """Returns the regions that a running service has of the scene."""
    with service.connect(url) as client:
        manifests = [client.region(region["id"]) for region in client.regions(scene=scene.hash[:16])]
    return [
        _stored(m["id"], Polytope(np.array(m["manifest"]["halfspace_normals"]), np.array(m["manifest"]["halfspace_offsets"])))
        for m in manifests
    ]


def _stored(name: str, polytope: Polytope) -> StoredRegion:
    return StoredRegion(name, Guarantee.NONE, polytope.C, polytope.d, *bounds(polytope))


def _summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "found": sum(each["length"] is not None for each in found),
        "collide": sum(each["collides"] is True for each in found),
        "seconds": _quantiles([each["seconds"] for each in found]),
        "length": _quantiles([each["length"] for each in found if each["length"] is not None]),
    }


def _quantiles(values: list[float]) -> dict[str, float] | None:
    return {"p50": float(np.quantile(values, 0.5)), "p99": float(np.quantile(values, 0.99))} if values else None


def _line(number: int, row: dict[str, Any]) -> str:
    ours, theirs = row["plan"], row["rrt"]
    sides = [f"{each['seconds']:.3f} s, {'-' if each['length'] is None else format(each['length'], '.2f')} rad" for each in (ours, theirs)]
    return f"{number}: {row['outcome']}, {sides[0]}; RRT-Connect {sides[1]}"
