"""This module measures how large regions grow and how soon.

It compares our ways to grow a region with each other, and with Drake's alternation from the same start, and draws how much of the
proposal they keep.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from pydrake.common import Parallelism
from pydrake.geometry.optimization import HPolyhedron, Hyperellipsoid
from pydrake.multibody.rational import RationalForwardKinematics
from pydrake.planning import IrisNp2, IrisNp2Options, IrisParameterizationFunction

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from benchmarks.svg import Panel, draw
from certifier.errors import CirisError
from certifier.growth.options import GrowthOptions
from certifier.growth.paper.options import PaperOptions
from certifier.jobs.local import grow
from certifier.jobs.reference import Reference
from certifier.jobs.share import SampledProposal
from certifier.model import Array, Scene
from certifier.polytopes.ellipsoid import inscribed_ellipsoid, volume, volume_in_q
from certifier.seeding.drake_iris import checker
from certifier.seeding.options import SeedOptions
from certifier.seeding.propose import check_seed
from certifier.verify.region import verify_region
from client.cores import cores

WAYS: dict[str, PaperOptions | None] = {
    "whole": None,
    "targeted": PaperOptions(),
    "uniform contraction": PaperOptions("uniform", pushes=0, max_rounds=0),
}
"""The options of the papers' algorithm for each way to grow, with the default seeding; None for ours, which keeps the whole proposal."""
IRIS = "Drake's IRIS"
"""This way proposes a region, and proves nothing. The share is of this region itself."""
START_RADIUS = 1e-2
"""Drake's IRIS starts from a ball about the seed with this radius in s."""
PICTURED = ("whole", "targeted")
"""The picture shows these ways."""
LIMIT = 300.0
"""Growing ends after this many seconds with the best region so far, unless the user says otherwise."""
AGAINST = ("planar_2dof", "arm_3dof")
"""On these examples Drake's alternation ends within minutes."""
HALF_WIDTH, ROUNDS, TOLERANCE = 0.05, 10, 1e-3
"""Both sides start from a cube in s with this half-width. They use Drake's own limits for the alternation: its rounds and its tolerance."""
PUSHES = 10
SHORT, RUNS = 10.0, 5
"""If Drake's alternation takes fewer than SHORT seconds, all sides are run RUNS times, in turn.

Other programs on the machine then disturb all sides alike.
"""


def growth(names: list[str], against: bool, limit: float, progress: Progress, only: Collection[str] | None = None) -> dict[str, Any]:
    """Grows a region on every example in every way, and returns the document of ``ciris bench growth``.

    Every row names its machine, because a document may be put together from several measurements: see :func:`merged`.

    Args:
        limit: seconds after which growing one region of ``ways`` ends with the best so far; Drake and its counterpart have no limit.
        only: the ways to measure; None for all.
    """
    small = _cube(catalogue.EXAMPLES[0])
    for paper in WAYS.values():  # These first runs load the compiled kernels and do not count.
        _grown(catalogue.EXAMPLES[0], small, None if paper is None else replace(paper, pushes=0, max_rounds=0))
    here = {"machine": measure.machine()}
    ways = []
    for name in names:
        ours = {way: partial(_grown, name, _seed(name), paper, limit) for way, paper in WAYS.items()}
        for way, run in {IRIS: partial(_proposed, name), **ours}.items():
            if only is not None and way not in only:
                continue
            ways.append({"scene": name, "way": way, **run(), **here})
            progress(_line(ways[-1]))
    sides = [row | here for name in AGAINST if name in names for row in _against(name, progress)] if against else []
    return {"benchmark": "growth", "ways": ways, "against": sides}


def merged(old: dict[str, Any], new: dict[str, Any]) -> dict[str, Any]:
    """Returns the document ``old`` with the rows of ``new`` in place of the same examples' rows of the same ways, in order."""
    place = {way: number for number, way in enumerate([IRIS, *WAYS])}
    rows = {}
    for part in ("ways", "against"):
        again = {(row["scene"], row["way"]) for row in new[part]}
        kept = [row for row in old[part] if (row["scene"], row["way"]) not in again]
        rows[part] = sorted(kept + new[part], key=lambda row: (catalogue.SCENES.index(row["scene"]), place.get(row["way"], len(place))))
    return {**new, **rows}


def picture(document: dict[str, Any]) -> str:
    """Draws how much of the proposal is kept over the seconds since the growth began, one panel for each example, as SVG."""
    panels: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for row in document["ways"]:
        if row["way"] in PICTURED:
            points = [(point["seconds"], point["share"]) for point in row["curve"] if point["share"] is not None]
            panels.setdefault(row["scene"], {way: [] for way in PICTURED})[row["way"]] = points
    shown = [Panel(name, series) for name, series in panels.items() if any(series.values())]
    return draw(shown, "share of the proposal, over seconds", share=True)


def _against(name: str, progress: Progress) -> list[dict[str, Any]]:
    """Compares four sides: Drake's alternation, our alternation and our pushes from one cube about the seed; ``targeted`` from the seed.

    ``reached_seconds`` is when our certified region first had at least the volume of Drake's last one; None if never.
    ``time_ratios`` are Drake's seconds divided by that, for every run. ``seconds``, ``reached_seconds`` and ``time_ratio`` are medians.
    """
    scene = catalogue.scene(name)
    cube = _cube(name)
    alternation = PaperOptions(pushes=0, max_rounds=ROUNDS, tolerance=TOLERANCE)
    pushes = PaperOptions(pushes=PUSHES, max_rounds=0)
    sides: dict[str, Callable[[], dict[str, Any]]] = {
        "Drake's alternation": lambda: _drakes(scene, np.array(cube["C"]), np.array(cube["d"])),
        "our alternation": lambda: _grown(name, cube, alternation),
        "our pushes": lambda: _grown(name, cube, pushes),
        "targeted, from the seed": lambda: _grown(name, _seed(name), WAYS["targeted"]),
    }
    turns: list[list[dict[str, Any]]] = []
    while not turns or (turns[0][0]["seconds"] < SHORT and len(turns) < RUNS):
        rows: list[dict[str, Any]] = []
        for way, run in sides.items():
            row = {"scene": name, "way": way, **run()}
            drakes = rows[0] if rows else row
            reached = next((point["seconds"] for point in row["curve"] if point["ellipsoid_volume"] >= drakes["ellipsoid"]), None)
            row |= {"volume_ratio": row["ellipsoid"] / drakes["ellipsoid"], "reached_seconds": reached}
            row |= {"time_ratio": drakes["seconds"] / reached if reached else None}
            progress(_line(row))
            rows.append(row)
        turns.append(rows)
    return [_median(list(runs)) for runs in zip(*turns, strict=True)]


def _median(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Makes one row of several runs that gave the same region."""
    ratios = [row["time_ratio"] for row in runs if row["time_ratio"]]
    medians = {
        name: statistics.median(row[name] for row in runs) if runs[0][name] else None
        for name in ("seconds", "reached_seconds", "time_ratio")
    }
    return {**runs[0], **medians, "time_ratios": ratios}


def _seed(name: str) -> dict[str, Any]:
    return {"q": catalogue.seed(name).tolist()}


def _cube(name: str) -> dict[str, Any]:
    """Returns the seed of a growth from the cube in s about the seed of an example."""
    center = catalogue.scene(name).to_s(catalogue.seed(name))
    C, d = catalogue.cube(center, HALF_WIDTH)
    return {"method": "polytope", "C": C.tolist(), "d": d.tolist(), "center": center.tolist()}


def _grown(name: str, seed: dict[str, Any], paper: PaperOptions | None, limit: float | None = None) -> dict[str, Any]:
    """Grows one of our regions and verifies its proof. If no region could be certified, the row says why.

    ``seconds`` are of the clock and ``processor_seconds`` of this process, with the seeding and the proof's first verification.
    """
    spent = _stopwatch()
    try:
        region = grow(catalogue.scene(name), GrowthOptions(seed=seed, paper=paper), deadline_s=limit, processes=cores())
    except CirisError as error:
        return {**spent(), "ellipsoid": 0.0, "faces": 0, "curve": [], "ended": str(error)}
    took, again, manifest = spent(), time.perf_counter(), region.manifest
    verify_region(region.proof)
    return {
        **took,
        "seeding_seconds": manifest["provenance"]["seeding_seconds"],
        "verify_seconds": time.perf_counter() - again,
        "proof_bytes": len(region.proof),
        "cells": measure.cells(region.proof),
        "share": measure.share(manifest)["value"],
        "share_stderr": measure.share(manifest)["stderr"],
        "q_volume": manifest["q_volume"]["value"],
        "ellipsoid": manifest["volume"]["ellipsoid"],
        "faces": len(manifest["halfspace_offsets"]),
        "curve": manifest["provenance"]["growth_curve"],
        "ended": region.reason,
    }


def _stopwatch() -> Callable[[], dict[str, float]]:
    """Returns what tells the seconds of the clock and of this process since now, as a row holds them."""
    start, processor = time.perf_counter(), time.process_time()
    return lambda: {"seconds": time.perf_counter() - start, "processor_seconds": time.process_time() - processor}


def _proposed(name: str) -> dict[str, Any]:
    """Measures Drake's IrisNp2 in s, called once as its users call it, with the limits of our seeding but its own tolerance.

    The region is not certified; ``ended`` says which part of its q-volume is in collision.
    """
    scene, seed, asked, spent = catalogue.scene(name), catalogue.seed(name), SeedOptions(), _stopwatch()
    robot = checker(scene)
    kinematics = RationalForwardKinematics(robot.plant())
    options = IrisNp2Options()
    options.parameterization = IrisParameterizationFunction(kinematics, scene.q_star)
    sampled = options.sampled_iris_options
    sampled.epsilon, sampled.delta, sampled.configuration_space_margin = asked.epsilon, asked.delta, asked.margin
    sampled.max_iterations, sampled.max_iterations_separating_planes = asked.max_iterations, asked.max_iterations_separating_planes
    sampled.parallelism = Parallelism.Max()
    try:
        check_seed(scene, seed)
        start = Hyperellipsoid.MakeHypersphere(START_RADIUS, scene.to_s(seed))
        region = IrisNp2(robot, start, HPolyhedron.MakeBox(scene.s_lower, scene.s_upper), options)
    except (CirisError, RuntimeError, ValueError) as error:
        return {**spent(), "ellipsoid": 0.0, "faces": 0, "curve": [], "ended": str(error)}
    took = spent()
    polytope = scene.polytope(region.A(), region.b())
    found = SampledProposal.of(scene, polytope)
    return {
        **took,
        "seeding_seconds": took["seconds"],
        "share": 1.0,
        "share_stderr": 0.0,
        "q_volume": volume_in_q(polytope, scene, volume(polytope, 0), 0)[0],
        "ellipsoid": inscribed_ellipsoid(polytope).volume,
        "faces": len(region.b()),
        "curve": [],
        "ended": f"not certified; of {found.free.size} samples {int((~found.free).sum())} are in collision",
    }


def _drakes(scene: Scene, C: Array, d: Array) -> dict[str, Any]:
    start = time.perf_counter()
    rounds = Reference(scene).alternate(C, d, ROUNDS, TOLERANCE)
    seconds = time.perf_counter() - start
    if not rounds:
        raise CirisError("start_not_certified", "Drake does not certify the cube that both sides start from", field="HALF_WIDTH")
    last = scene.polytope(*rounds[-1])
    volume = inscribed_ellipsoid(last).volume
    curve = [{"iteration": len(rounds), "seconds": seconds, "ellipsoid_volume": volume}]
    return {"seconds": seconds, "ellipsoid": volume, "faces": len(last.d), "curve": curve, "ended": f"after {len(rounds)} rounds"}


def _line(row: dict[str, Any]) -> str:
    share = f"share {row['share']:.3g}, " if row.get("share") is not None else ""
    size = f"{share}ellipsoid {row['ellipsoid']:.3g}, {row['faces']} faces"
    return f"{row['scene']}, {row['way']}: {size}, {row['seconds']:.1f} s; {row['ended']}"
