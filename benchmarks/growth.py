"""How large regions grow and how soon: our ways to grow one beside each other, and beside Drake's alternation from the same start."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from certifier.errors import CirisError
from certifier.growth import GrowthOptions
from certifier.local import grow
from certifier.model import Array, Scene
from certifier.polytope import inscribed_ellipsoid
from certifier.reference import Reference

WAYS: dict[str, dict[str, Any]] = {
    "uniform contraction": {"contraction": "uniform", "pushes": 0, "max_rounds": 0},
    "targeted contraction": {"pushes": 0, "max_rounds": 0},
    "targeted, then (12)": {"pushes": 0},
    "targeted, then pushes": {"max_rounds": 0},
    "default": {},
}
"""Options of a grow job, each with the default seeding."""
AGAINST = ("planar_2dof", "arm_3dof")
"""Examples on which Drake's alternation ends within minutes."""
HALF_WIDTH, ROUNDS, TOLERANCE = 0.05, 10, 1e-3
"""Of the cube that both sides start from, and Drake's own limits for the alternation."""


def growth(names: list[str], against: bool, progress: Progress) -> dict[str, Any]:
    """Grow a region on every example in every way; the document of ``ciris bench growth``."""
    # the first run loads the compiled kernels
    _grown(names[0], {**_seed(names[0]), "method": "box"}, {"pushes": 0, "max_rounds": 0})
    ways = []
    for name in names:
        for way, options in WAYS.items():
            ways.append({"scene": name, "way": way, **_grown(name, _seed(name), options)})
            progress(_line(ways[-1]))
    sides = [row for name in AGAINST if name in names for row in _against(name, progress)] if against else []
    return {"benchmark": "growth", "machine": measure.machine(), "ways": ways, "against": sides}


def _against(name: str, progress: Progress) -> list[dict[str, Any]]:
    """Drake's alternation from a cube about the seed; our alternation from the same cube; our default from the seed itself."""
    scene = catalogue.scene(name)
    center = scene.to_s(catalogue.seed(name))
    C, d = catalogue.cube(center, HALF_WIDTH)
    cube = {"method": "polytope", "C": C.tolist(), "d": d.tolist(), "center": center.tolist()}
    alternation = {"pushes": 0, "max_rounds": ROUNDS, "tolerance": TOLERANCE}
    sides: dict[str, Callable[[], dict[str, Any]]] = {
        "Drake's alternation": lambda: _drakes(scene, C, d),
        "our alternation": lambda: _grown(name, cube, alternation),
        "our default, from the seed": lambda: _grown(name, _seed(name), {}),
    }
    rows: list[dict[str, Any]] = []
    for way, run in sides.items():
        row = {"scene": name, "way": way, **run()}
        drakes = rows[0] if rows else row
        row |= {"time_ratio": drakes["seconds"] / row["seconds"], "volume_ratio": row["ellipsoid"] / drakes["ellipsoid"]}
        progress(_line(row))
        rows.append(row)
    return rows


def _seed(name: str) -> dict[str, Any]:
    return {"q": catalogue.seed(name).tolist()}


def _grown(name: str, seed: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """One region of ours, its proof verified. Where none could be certified, the row says why."""
    start = time.process_time()
    try:
        manifest = grow(catalogue.scene(name), GrowthOptions(seed=seed, **options)).manifest
    except CirisError as error:
        return {"seconds": time.process_time() - start, "ellipsoid": 0.0, "polytope": 0.0, "faces": 0, "rounds": 0, "ended": str(error)}
    return {
        "seconds": time.process_time() - start,
        "ellipsoid": manifest["volume"]["ellipsoid"],
        "polytope": manifest["volume"]["polytope"],
        "faces": len(manifest["halfspace_offsets"]),
        "rounds": len(manifest["provenance"]["growth_curve"]),
        "ended": manifest["provenance"]["reason"],
    }


def _drakes(scene: Scene, C: Array, d: Array) -> dict[str, Any]:
    start = time.process_time()
    rounds = Reference(scene).alternate(C, d, ROUNDS, TOLERANCE)
    seconds = time.process_time() - start
    if not rounds:
        return {"seconds": seconds, "ellipsoid": 0.0, "polytope": None, "faces": 0, "rounds": 0, "ended": "the start was not certified"}
    last = scene.polytope(*rounds[-1])
    volume = inscribed_ellipsoid(last).volume
    return {"seconds": seconds, "ellipsoid": volume, "polytope": None, "faces": len(last.d), "rounds": len(rounds), "ended": ""}


def _line(row: dict[str, Any]) -> str:
    return f"{row['scene']}, {row['way']}: ellipsoid {row['ellipsoid']:.3g}, {row['seconds']:.1f} s, {row['faces']} faces; {row['ended']}"
