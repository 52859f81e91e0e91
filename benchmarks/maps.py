"""This module measures maps: what they cover over time, what lookups in their free sets cost, which configurations these connect, and how
soon a map covers as much again when an obstacle has been added.

Seconds are by the clock; nothing else should run on the machine.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common import Parallelism
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from certifier.jobs.map import grow_map
from certifier.kinematics import Kinematics
from certifier.map.free_set import free_set
from certifier.model import WORLD, Array, Geometry, Joint, JointKind, Pair, Scene
from certifier.pair.collisions import in_collision
from certifier.proof.map import MapProof
from certifier.seeding.drake_iris import checker
from certifier.verify.map import verify_map
from ciris.free_set import FreeSet
from client.cores import cores
from planner.cover.ground import free_samples

SCENES = ("planar_2dof", "arm_3dof", "iiwa_shelf", "ur3e_bin", "iiwa_gripper")
COVERAGE, LIMIT = 0.98, 60.0
TIMES = 8
"""A row has the coverage at up to TIMES times, each about twice as late as the one before."""
SINGLE, BATCH, QUERIES = 2000, 1000, 500
AGAIN = 0.95
"""With an obstacle more, a map grows until it covers this part of what it covered before."""
POST = ((-0.7, -0.5), (0.5, 0.7), (0.0, 0.6))
"""The obstacle is a box: from where to where along x, y and z, in metres."""
TOGETHER = 20_000
"""Drake is asked about at most this many configurations at once."""
NODES, NEAREST = 2000, 12
"""The roadmap has NODES proved configurations, each joined to its NEAREST ones where the straight motion is proved."""


def maps(names: list[str], limit: float, progress: Progress, drake: int = 0) -> dict[str, Any]:
    """Grows the maps of examples. Returns the document of ``ciris bench map``.

    Args:
        limit: each map ends after this many seconds, or when it covers COVERAGE.
        drake: Drake alone looks for collisions at this many random configurations that each map proves to be free.
    """
    rows = []
    for name in names:
        progress(name)
        rows.append(_row(name, catalogue.scene(name), limit, drake))
    return {"benchmark": "map", "machine": measure.machine(), "processes": cores(), "limit_seconds": limit, "rows": rows}


def _row(name: str, scene: Scene, limit: float, drake: int) -> dict[str, Any]:
    told: list[tuple[float, float]] = []
    found = grow_map(scene, COVERAGE, limit, cores(), lambda _, now: told.append((now["seconds"], now["coverage"])))
    told.append((found.seconds, found.coverage.share))
    data = found.proof.to_bytes()
    begin = time.perf_counter()
    verify_map(data, cores())
    verified = time.perf_counter() - begin
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "free.npz"
        np.savez_compressed(path, **free_set(found.proof))
        size, free = path.stat().st_size, FreeSet.load(path)
    return {
        "example": name,
        "pairs": len(scene.pairs),
        "coverage": {"value": found.coverage.share, "stderr": found.coverage.error},
        "seconds": found.seconds,
        "over_time": _few(told),
        "cells": found.cells,
        "proof_bytes": len(data),
        "verify_seconds": verified,
        "free_set_bytes": size,
        **_asked(scene, free),
        "drake": {"configurations": drake, "collisions": _collisions(scene, free, drake)},
        "obstacle_more": _again(_with_post(scene), AGAIN * found.coverage.share, limit, found.proof),
    }


def _with_post(scene: Scene) -> Scene:
    """Returns the scene with a post beside the robot, which each of its moving geometries may touch."""
    still, moving = np.eye(4), Kinematics.of(scene)
    post = Geometry("post/box", "post", np.array(list(product(*POST)), dtype=float), 0.0, {})
    pairs = [Pair(*sorted((one.name, post.name))) for one in scene.geometries if moving.rigid_root(one.body) != WORLD]
    return replace(
        scene,
        joints=(*scene.joints, Joint("post", JointKind.WELD, WORLD, "post", np.zeros(3), still, still)),
        bodies=(*scene.bodies, "post"),
        geometries=(*scene.geometries, post),
        pairs=(*scene.pairs, *pairs),
    )


def _again(scene: Scene, coverage: float, limit: float, former: MapProof) -> dict[str, Any]:
    """Returns how long a map of a changed scene takes to cover this share, with what a former map proves, and without it."""
    runs = {"taken_over": grow_map(scene, coverage, limit, cores(), former=former), "anew": grow_map(scene, coverage, limit, cores())}
    figures = {name: {"seconds": run.seconds, "coverage": run.coverage.share, "looked_at": run.looked} for name, run in runs.items()}
    return {"wanted": coverage, **figures}


def _collisions(scene: Scene, free: FreeSet, count: int) -> int:
    """Returns at how many of this many random configurations of a free set Drake finds a collision."""
    asked, rng, left, found = checker(scene), np.random.default_rng(1), count, 0
    while left:
        q = rng.uniform(scene.q_lower, scene.q_upper, (TOGETHER, scene.n))
        proved = q[free.contains(q)][:left]
        found += sum(not apart for apart in asked.CheckConfigsCollisionFree(proved, Parallelism(cores())))
        left -= len(proved)
    return found


def _few(told: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Returns a few of these, the last one among them."""
    kept = told[-1:]
    while told and len(kept) < TIMES and (earlier := [now for now in told if now[0] <= kept[0][0] / 2]):
        kept = [earlier[-1], *kept]
    return kept


def _asked(scene: Scene, free: FreeSet) -> dict[str, Any]:
    """Returns what lookups cost, and which share of random pairs of free configurations they connect."""
    rng = np.random.default_rng(0)
    drawn = scene.to_q(free_samples(scene, partial(in_collision, scene), NODES + 2 * QUERIES, rng))
    asked, others = drawn[: 2 * QUERIES], drawn[2 * QUERIES :]
    nodes = others[free.contains(others)]
    start, end = nodes[: len(nodes) // 2], nodes[len(nodes) // 2 :][: len(nodes) // 2]
    batch = nodes[np.arange(BATCH) % len(nodes)]
    return {
        "point_seconds": _quantiles([partial(free.contains, q) for q in nodes[:SINGLE]]),
        "batch_seconds": _quantiles([partial(free.contains, batch)] * 20),
        "motion_seconds": _quantiles([partial(free.contains_motion, a, b) for a, b in zip(start, end, strict=True)]),
        "straight": float(free.contains_motion(start, end).mean()),
        "connected": _connected(free, nodes, asked),
    }


def _connected(free: FreeSet, nodes: Array, asked: Array) -> float:
    """Returns the share of pairs of configurations that motions through the nodes connect, each of them proved."""
    inside = free.contains(asked)
    everything = np.concatenate([nodes, asked[inside]])
    number = np.where(inside, len(nodes) + np.cumsum(inside) - 1, -1)
    near = KDTree(everything).query(everything, NEAREST + 1)[1][:, 1:]
    a, b = np.repeat(np.arange(len(everything)), NEAREST), near.ravel()
    held = free.contains_motion(everything[a], everything[b])
    edges = coo_array((held[held], (a[held], b[held])), shape=(len(everything),) * 2)
    part = np.append(connected_components(edges, directed=False)[1], -1)
    first, second = part[number[:QUERIES]], part[number[QUERIES:]]
    return float(((first == second) & (first >= 0)).mean())


def _quantiles(calls: list[Callable[[], object]]) -> dict[str, float]:
    """Returns the median and the 99th percentile of what calls take, in seconds."""
    taken = []
    for call in calls:
        begin = time.perf_counter()
        call()
        taken.append(time.perf_counter() - begin)
    return {"p50": float(np.percentile(taken, 50)), "p99": float(np.percentile(taken, 99))}
