"""This module measures how large regions grow and how soon.

It compares our ways to grow a region with each other, and with Drake's alternation from the same start.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from certifier.errors import CirisError
from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow
from certifier.jobs.reference import Reference
from certifier.model import Array, Scene
from certifier.polytopes.ellipsoid import inscribed_ellipsoid
from certifier.verify.region import verify_region

WAYS: dict[str, dict[str, Any]] = {
    "uniform contraction": {"contraction": "uniform", "pushes": 0, "max_rounds": 0},
    "targeted contraction": {"contractions": 1, "pushes": 0, "max_rounds": 0},
    "two of them": {"contractions": 2, "pushes": 0, "max_rounds": 0},
    "one, then (12)": {"contractions": 1, "pushes": 0, "max_rounds": 3},
    "one, then pushes": {"contractions": 1, "pushes": 2, "max_rounds": 0},
    "default": {},
}
"""Each way to grow has these options of a grow job, with the default seeding."""
EXAMPLES = ("planar_2dof", "arm_3dof", "ur3e_bin", "iiwa_shelf", "dual_ur3e")
AGAINST = ("planar_2dof", "arm_3dof")
"""On these examples Drake's alternation ends within minutes."""
HALF_WIDTH, ROUNDS, TOLERANCE = 0.05, 10, 1e-3
"""Both sides start from a cube in s with this half-width. They use Drake's own limits for the alternation: its rounds and its tolerance."""
PUSHES = 10
SHORT, RUNS = 10.0, 5
"""If Drake's alternation takes fewer than SHORT seconds, all sides are run RUNS times, in turn.

Other programs on the machine then disturb all sides alike.
"""


def growth(names: list[str], against: bool, progress: Progress) -> dict[str, Any]:
    """Grows a region on every example in every way, and returns the document of ``ciris bench growth``."""
    # This first run loads the compiled kernels and does not count.
    _grown(names[0], {**_seed(names[0]), "method": "box"}, {"pushes": 0, "max_rounds": 0})
    ways = []
    for name in names:
        for way, options in WAYS.items():
            ways.append({"scene": name, "way": way, **_grown(name, _seed(name), options)})
            progress(_line(ways[-1]))
    sides = [row for name in AGAINST if name in names for row in _against(name, progress)] if against else []
    return {"benchmark": "growth", "machine": measure.machine(), "ways": ways, "against": sides}


def _against(name: str, progress: Progress) -> list[dict[str, Any]]:
    """Compares four sides: Drake's alternation, our alternation and our pushes from one cube about the seed; our default from the seed.

    ``reached_seconds`` is when our certified region first had at least the volume of Drake's last one; None if never.
    ``time_ratios`` are Drake's seconds divided by that, for every run. ``seconds``, ``reached_seconds`` and ``time_ratio`` are medians.
    """
    scene = catalogue.scene(name)
    center = scene.to_s(catalogue.seed(name))
    C, d = catalogue.cube(center, HALF_WIDTH)
    cube = {"method": "polytope", "C": C.tolist(), "d": d.tolist(), "center": center.tolist()}
    alternation = {"pushes": 0, "max_rounds": ROUNDS, "tolerance": TOLERANCE}
    pushes = {"pushes": PUSHES, "max_rounds": 0}
    sides: dict[str, Callable[[], dict[str, Any]]] = {
        "Drake's alternation": lambda: _drakes(scene, C, d),
        "our alternation": lambda: _grown(name, cube, alternation),
        "our pushes": lambda: _grown(name, cube, pushes),
        "our default, from the seed": lambda: _grown(name, _seed(name), {}),
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
    """Makes one row of several runs that came to the same region."""
    ratios = [row["time_ratio"] for row in runs if row["time_ratio"]]
    medians = {
        name: statistics.median(row[name] for row in runs) if runs[0][name] else None
        for name in ("seconds", "reached_seconds", "time_ratio")
    }
    return {**runs[0], **medians, "time_ratios": ratios}


def _seed(name: str) -> dict[str, Any]:
    return {"q": catalogue.seed(name).tolist()}


def _grown(name: str, seed: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """Grows one region of ours and verifies its proof. If no region could be certified, the row says why."""
    start = time.perf_counter()
    try:
        region = grow(catalogue.scene(name), GrowthOptions(seed=seed, **options))
    except CirisError as error:
        return {"seconds": time.perf_counter() - start, "ellipsoid": 0.0, "faces": 0, "curve": [], "ended": str(error)}
    seconds, start, manifest = time.perf_counter() - start, time.perf_counter(), region.manifest
    verify_region(region.proof)
    return {
        "seconds": seconds,
        "verify_seconds": time.perf_counter() - start,
        "proof_bytes": len(region.proof),
        "ellipsoid": manifest["volume"]["ellipsoid"],
        "faces": len(manifest["halfspace_offsets"]),
        "curve": manifest["provenance"]["growth_curve"],
        "ended": manifest["provenance"]["reason"],
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
    return f"{row['scene']}, {row['way']}: ellipsoid {row['ellipsoid']:.3g}, {row['seconds']:.1f} s, {row['faces']} faces; {row['ended']}"
