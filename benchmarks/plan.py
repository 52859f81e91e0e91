"""This module measures how motions are found and proved, beside OMPL without proofs on the same questions.

Seconds are by the clock, because a service and its child processes answer; nothing else should run on the machine.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from benchmarks.ompl import RESOLUTION, Ompl
from certifier.collisions.free import free_at_all
from certifier.collisions.seen import seen_of
from certifier.kinematics import Kinematics
from certifier.model import Array, Scene
from certifier.motion.bodies import bodies_of
from certifier.pair.collisions import in_collision
from certifier.scene import load_scene
from certifier.verify.file import verify_file
from ciris.answers import Plan
from ciris.synchronous.service import Service
from client import service
from client.inputs import is_scene_file
from planner.cover.ground import free_samples

QUERIES, POINTS = 100, 10_000
SECONDS = 5.0
"""Both planners search for at most this long."""
FINGER = "gripper/left/finger"
NARROW = {"iiwa_gripper": {"shelf": ((0.72, -0.28, 0.06), (0.9, 0.28, 0.86)), "bin": ((0.0, 0.4, 0.0), (0.2, 0.7, 0.12))}}
"""Boxes, least and largest corner in the world in metres, that FINGER has to be in for a task."""
TASKS = 10
AGAIN = 200
"""Number of the last random questions that are asked again."""
DRAWN, AT_ONCE = 50_000, 500
NEAR = 0.4
"""With conditions, a motion ends within this of its beginning in each joint, in radians or metres. What keeps them has many components."""


def motions(name: str, url: str | None, queries: int, points: int, progress: Progress) -> dict[str, Any]:
    """Plans between random free configurations. Returns the document of ``ciris bench plan``.

    Args:
        name: an example, or a scene file.
        url: of a running service; None for the one that is found. It answers from what it has of the scene.
        points: at how many points Drake looks at each motion, and our pairs at conditions.

    Raises:
        CirisError: what is wrong with the scene or the service, or a proof that does not hold.
    """
    file = name if is_scene_file(name) else str(catalogue.FILES[name])
    scene, rng = load_scene(file), np.random.default_rng(0)
    rival = Ompl(scene)
    with service.connect(url) as client:
        pairs = _questions(scene, queries, rng)
        narrow = _tasks(scene, name, rng)
        asked = Service(client)
        known = asked.add_scene(file)
        begin = time.perf_counter()
        asked.plan(known, *pairs[0], seconds=SECONDS)
        first = time.perf_counter() - begin
        rows = [_row(scene, rival, partial(asked.plan, known), pair, points, progress, i) for i, pair in enumerate(pairs[1:], 1)]
        tasks = [_row(scene, rival, partial(asked.plan, known), pair, points, progress, i) for i, pair in enumerate(narrow)]
        again = [_timed(partial(asked.plan, known), pair)[1] for pair in pairs[-AGAIN:]]
    return {
        "benchmark": "plan",
        "machine": measure.machine(),
        "scene": scene.name,
        "joints": scene.n,
        "pairs": len(scene.pairs),
        "first_seconds": first,
        "queries": len(rows),
        "points": points,
        "resolution": RESOLUTION,
        "limit_seconds": SECONDS,
        **_compared(rows),
        "again_seconds": _quantiles(again),
        "tasks": _compared(tasks) if tasks else None,
        "rows": rows,
    }


def _questions(scene: Scene, count: int, rng: np.random.Generator) -> list[tuple[Array, Array]]:
    """Returns pairs of random free configurations: uniform among all, or, with conditions, within NEAR of each other."""
    drawn = count if scene.conditions else 2 * count
    free = scene.to_q(free_samples(scene, partial(in_collision, scene), drawn, rng))
    if not scene.conditions:
        return list(zip(free[:count], free[count:], strict=True))
    return [(start, _near(scene, start, rng)) for start in free]


def _near(scene: Scene, start: Array, rng: np.random.Generator) -> Array:
    """Returns a free configuration, (n,), uniform among those within NEAR of a free one in each joint."""
    lower, upper = np.maximum(scene.q_lower, start - NEAR), np.minimum(scene.q_upper, start + NEAR)
    while True:
        q = rng.uniform(lower, upper, (AT_ONCE, scene.n))
        free = q[~in_collision(scene, scene.to_s(q))]
        if len(free):
            return np.asarray(free[0])


def _tasks(scene: Scene, name: str, rng: np.random.Generator) -> list[tuple[Array, Array]]:
    """Returns pairs of free configurations in narrow places, from each place to the next; none for a scene without tasks."""
    if name not in NARROW:
        return []
    geometry, kinematics = scene.geometry(FINGER), Kinematics.of(scene)
    known, order = (bodies_of(scene), seen_of(scene)), np.arange(len(scene.pairs))
    found: dict[str, list[Array]] = {place: [] for place in NARROW[name]}
    while min(map(len, found.values())) < TASKS:
        q = rng.uniform(scene.q_lower, scene.q_upper, (DRAWN, scene.n))
        at = kinematics.points("world", geometry.body, geometry.vertices, scene.to_s(q))
        for place, (least, largest) in NARROW[name].items():
            inside = q[((at >= np.array(least)) & (at <= np.array(largest))).all(axis=(1, 2))]
            found[place] += list(inside[free_at_all(*known, inside, order)])
    places = list(found.values())
    return [(places[i % len(places)][i], places[(i + 1) % len(places)][i]) for i in range(TASKS)]


def _row(scene: Scene, rival: Ompl, ask: Any, pair: tuple[Array, Array], points: int, progress: Progress, number: int) -> dict[str, Any]:
    """Returns what both planners make of one question, each in its turn."""
    found, seconds = _timed(ask, pair)
    proof = ask(*pair, seconds=SECONDS, prove=True).proof if found else None
    path, theirs = rival.plan(*pair, SECONDS)
    row: dict[str, Any] = {
        "straight": float(np.linalg.norm(pair[1] - pair[0])),
        "ours": {
            "seconds": seconds,
            "reason": found.reason,
            "proved": proof is not None and verify_file(proof).scene.hash == scene.hash,
            **_path(rival, found.q if found else None, points),
        },
        "ompl": {"seconds": theirs, **_path(rival, path, points)},
    }
    progress(f"{scene.name} {number}: {_said(row['ours'])}; OMPL {_said(row['ompl'])}")
    return row


def _said(side: dict[str, Any]) -> str:
    return f"{side['seconds']:.3f} s, {'-' if side['length'] is None else format(side['length'], '.2f')} rad"


def _timed(ask: Any, pair: tuple[Array, Array]) -> tuple[Plan, float]:
    begin = time.perf_counter()
    found: Plan = ask(*pair, seconds=SECONDS)
    return found, time.perf_counter() - begin


def _path(rival: Ompl, path: Array | None, points: int) -> dict[str, Any]:
    if path is None:
        return {"length": None, "fails": None}
    return {"length": float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()), "fails": rival.fails(path, points)}


def _compared(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Returns what the rows say of both planners."""
    solved = [row for row in rows if row["ompl"]["length"] is not None]
    both = [row for row in solved if row["ours"]["length"] is not None]
    return {
        "asked": len(rows),
        "ompl_solved": len(solved),
        "answered_of_these": len(both),
        "answered": sum(row["ours"]["length"] is not None for row in rows),
        "proved": sum(row["ours"]["proved"] for row in rows),
        "length_ratio": _quantiles([row["ours"]["length"] / row["ompl"]["length"] for row in both]),
        **{side: _summary([row[side] for row in rows]) for side in ("ours", "ompl")},
    }


def _summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "fail": sum(each["fails"] is True for each in found),
        "seconds": _quantiles([each["seconds"] for each in found]),
        "length": _quantiles([each["length"] for each in found if each["length"] is not None]),
    }


def _quantiles(values: list[float]) -> dict[str, float] | None:
    return {"p50": float(np.quantile(values, 0.5)), "p99": float(np.quantile(values, 0.99))} if values else None
