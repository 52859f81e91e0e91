"""This module measures how the cost of a certification grows with the number of obstacles, joints and faces, and draws the curves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks import catalogue, measure
from benchmarks.arms import box, serial_arm
from benchmarks.catalogue import Region, cube, tangent
from benchmarks.measure import Progress
from benchmarks.svg import Panel, draw
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Geometry, Pair, Scene
from certifier.polytopes.closest import closest

OBSTACLES = (10, 30, 100, 300, 1000)
JOINTS = range(2, 8)
FACES = range(10, 61, 10)
HALF_WIDTH, RADIUS = 0.03, 0.2
"""The cubes about the arms have this half-width. The ball that all faces touch has this radius. Both are in s."""
REPEAT = 5
"""A single pair is run this often, and the fastest run counts."""
ROOM, CLEARANCE = 3.0, 0.2
"""The centres of obstacles lie within ROOM metres of the base along each axis, and obstacles at least CLEARANCE metres from the arm."""


def curves(against: bool, progress: Progress) -> dict[str, Any]:
    """Measures all three curves, and returns the document of ``ciris bench scaling``.

    - ``obstacles``: boxes scattered around an arm of three joints, all pairs, on a cube.
    - ``joints``: the last link of an arm against one box, on a cube.
    - ``faces``: link 5 of iiwa_shelf against a board, on a regular simplex. More and more planes cut its corners off. All planes touch
      one ball, so none is redundant.

    Drake, if asked, answers the last two.
    """
    _obstacles(1)  # This run loads the compiled kernels and does not count.
    return {
        "benchmark": "scaling",
        "machine": measure.machine(),
        "obstacles": [_told(_obstacles(count), progress) for count in OBSTACLES],
        "joints": [_told(_joints(n, against), progress) for n in JOINTS],
        "faces": [_told(_faces(count, against), progress) for count in FACES],
    }


def picture(document: dict[str, Any]) -> str:
    """Draws the three curves as SVG."""
    panels = []
    for name, title in (("obstacles", "obstacles around 3 joints"), ("joints", "joints, last link"), ("faces", "faces, link 5 of 7")):
        points = document[name]
        series = {"ciris: everything": "seconds", "ciris: verify again": "verify_seconds", "Drake: build and solve": "drake_seconds"}
        curves = {label: [(point["n"], point[key]) for point in points if key in point] for label, key in series.items()}
        panels.append(Panel(title, {label: curve for label, curve in curves.items() if curve}))
    return draw(panels, "seconds")


def _obstacles(count: int) -> dict[str, Any]:
    s = np.full(3, 0.2)
    scene = serial_arm(3, list(_scattered(np.random.default_rng(count), count, s)))
    return _point(count, scene, Region(*cube(s, HALF_WIDTH), s), list(range(len(scene.pairs))))


def _joints(n: int, against: bool) -> dict[str, Any]:
    s = np.full(n, 0.2)
    tip = _bodies(serial_arm(n, []), s)[-1].max(axis=0)
    scene = serial_arm(n, [box("world/box", WORLD, np.full(3, 0.2), tip + CLEARANCE + 0.1)])
    return _point(n, scene, Region(*cube(s, HALF_WIDTH), s), [n - 1], REPEAT, against)


def _faces(count: int, against: bool) -> dict[str, Any]:
    scene = replace(catalogue.scene("iiwa_shelf"), pairs=(Pair("iiwa/link_5/box", "shelf/boards/upper"),))
    center, n = catalogue.region("iiwa_shelf", "whole").center, scene.n
    corners = np.concatenate([np.eye(n), np.full((1, n), (1 - np.sqrt(n + 1)) / n)])
    C = corners - corners.mean(axis=0)
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    cut, _ = tangent(np.random.default_rng(0), center, count - len(C), RADIUS)
    C = np.concatenate([C, cut])
    return _point(count, scene, Region(C, C @ center + RADIUS, center), [0], REPEAT, against)


def _scattered(rng: np.random.Generator, count: int, s: Array) -> Iterator[Geometry]:
    """Yields boxes with edges of 5 to 20 cm, none of them near the arm of three joints at s."""
    links, made = _bodies(serial_arm(3, []), s), 0
    while made < count:
        obstacle = box(f"world/box{made}", WORLD, rng.uniform(0.05, 0.2, 3), rng.uniform(-ROOM, ROOM, 3))
        if all(closest(link, obstacle.vertices).gap > CLEARANCE for link in links):
            made += 1
            yield obstacle


def _bodies(scene: Scene, s: Array) -> list[Array]:
    """Returns the vertices of every body, in the world frame, when the arm is at s."""
    kinematics = Kinematics.of(scene)
    return [kinematics.points(WORLD, body.body, body.vertices, s[None])[0] for body in scene.geometries]


def _point(n: int, scene: Scene, region: Region, indices: list[int], repeat: int = 1, against: bool = False) -> dict[str, Any]:
    runs = [measure.ours(scene, region, indices) for _ in range(repeat)]
    run = min(runs, key=lambda run: sum(pair.seconds for pair in run.pairs.values()))
    pairs = run.pairs.values()
    point = {
        "n": n,
        "pairs": len(pairs),
        "outcomes": dict(Counter(pair.result.outcome.value for pair in pairs)),
        "setup_seconds": run.setup_seconds,
        "seconds": sum(pair.seconds for pair in pairs),
        "verify_seconds": sum(pair.verify_seconds for pair in pairs),
    }
    if not against:
        return point
    drake = measure.drake(scene, region, indices, lambda _: None).pairs.values()
    return point | {
        "drake_outcomes": dict(Counter(pair.outcome.value for pair in drake)),
        "drake_seconds": sum(pair.build_seconds + pair.solve_seconds for pair in drake),
    }


def _told(point: dict[str, Any], progress: Progress) -> dict[str, Any]:
    progress(f"n = {point['n']}: {point['pairs']} pairs, {point['outcomes']}, {point['seconds']:.3f} s")
    return point
