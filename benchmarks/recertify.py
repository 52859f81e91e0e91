"""This module measures how soon a region is had again when something in its scene has changed, beside growing one anew.

A region is grown on an example. Then something far away is added, something moves by 2 cm or into the region, or something is taken away.
Every region is verified, and Drake alone looks for contacts at samples of it.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from certifier.errors import CirisError
from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow, recertify
from certifier.jobs.region import Region
from certifier.model import Polytope, Scene
from certifier.scene import load_scene
from certifier.verify.region import verify_region
from client.cores import cores

EXAMPLES = Path(__file__).parents[1] / "examples"
SCENES = ("arm_3dof", "ur3e_bin")
LIMIT = 60.0
"""Growing ends after this many seconds, both for the first region and for the one that is grown anew."""
SAMPLES = 100_000
"""Drake checks this many configurations of every region."""
POST = """<?xml version="1.0"?>
<sdf version="1.7"><model name="post"><link name="body"><collision name="box">
<geometry><box><size>0.2 0.2 0.4</size></box></geometry></collision></link></model></sdf>
"""
Edit = tuple[str, str, str]
"""A file of the example, a text in it, and the text that takes its place."""
_ADDED: Edit = (
    "scene.yaml",
    "directives:\n",
    "directives:\n  - add_model: {name: post, file: post.sdf}\n"
    "  - add_weld: {parent: world, child: post::body, X_PC: {translation: [-1.5, 1.5, 0.2]}}\n",
)
_OBSTACLES = "  - add_model: {name: obstacles, file: obstacles.sdf}\n  - add_weld: {parent: world, child: obstacles::body}\n"
_TABLE = "  - add_model: {name: table, file: table.sdf}\n  - add_weld: {parent: world, child: table::body}\n"
CHANGES: dict[str, dict[str, Edit]] = {
    "arm_3dof": {
        "a post added far away": _ADDED,
        "the pillar moved by 2 cm": ("obstacles.sdf", "0.45 0.4 0.5", "0.47 0.4 0.5"),
        "the ball moved into the region": ("obstacles.sdf", "0.4 -0.4 0.75", "0.4 -0.1 0.6"),
        "all obstacles taken away": ("scene.yaml", _OBSTACLES, ""),
    },
    "ur3e_bin": {
        "a post added far away": _ADDED,
        "the bin moved by 2 cm": ("scene.yaml", "[0.36, 0, 0]", "[0.38, 0, 0]"),
        "the bin moved into the region": ("scene.yaml", "[0.36, 0, 0]", "[0.30, 0, 0.06]"),
        "the table taken away": ("scene.yaml", _TABLE, ""),
    },
}


def changes(names: list[str], limit: float, progress: Progress) -> dict[str, Any]:
    """Measures every change of the examples and returns the document of ``ciris bench recertify``.

    Args:
        limit: seconds after which growing ends.
    """
    rows = []
    for name in names:
        q = catalogue.seed(name).tolist()
        first = grow(catalogue.scene(name), _grown(q), deadline_s=limit, processes=cores())
        progress(f"{name}: a region of {_volume(first):.3g} in {first.manifest['provenance']['seconds']:.0f} s")
        rows += [_row(name, change, first, q, limit, progress) for change in CHANGES[name]]
    return {"benchmark": "recertify", "machine": measure.machine(), "limit": limit, "samples": SAMPLES, "rows": rows}


def _row(name: str, change: str, first: Region, q: list[float], limit: float, progress: Progress) -> dict[str, Any]:
    with tempfile.TemporaryDirectory(prefix="ciris-") as folder:
        path = changed(name, CHANGES[name][change], Path(folder) / name)
        scene = load_scene(path)
        row: dict[str, Any] = {"example": name, "change": change, "before": _volume(first)}
        begun = time.perf_counter()
        try:
            again = recertify(scene, first.proof, [q], processes=cores())
        except CirisError as error:
            row |= {"seconds": time.perf_counter() - begun, "error": str(error)}
        else:
            row |= _again(path, scene, again, time.perf_counter() - begun) | _anew(scene, q, limit, _volume(again))
    progress(f"{name}, {change}: {row}")
    return row


def _again(path: Path, scene: Scene, again: Region, seconds: float) -> dict[str, Any]:
    """Returns the result of certifying a region again: how much is kept, whether it verifies, and whether Drake finds a contact in it."""
    from tests.oracles.original import collision  # the benchmarks are in a checkout, where the tests are

    said = again.manifest["provenance"]["recertified"]
    begun = time.perf_counter()
    verify_region(again.proof, cores())
    verifying = time.perf_counter() - begun
    polytope = Polytope(np.array(again.manifest["halfspace_normals"]), np.array(again.manifest["halfspace_offsets"]))
    return {
        "seconds": seconds,
        "verify_seconds": verifying,
        "volume": _volume(again),
        "kept": said["kept"],
        "carried": len(said["carried"]),
        "proved": len(said["proved"]),
        "cut": len(said["cut"]),
        "contact": collision(path, scene, polytope, SAMPLES) is not None,
    }


def _anew(scene: Scene, q: list[float], limit: float, volume: float) -> dict[str, Any]:
    """Grows a region of the changed scene, and says when it was as large as this, None if never, and how large it was in the end.

    Where there is none, it says why.
    """
    found: list[tuple[float, float]] = []
    begun = time.perf_counter()

    def had(region: Region) -> None:
        found.append((time.perf_counter() - begun, _volume(region)))

    try:
        had(grow(scene, _grown(q), deadline_s=limit, processes=cores(), deliver=had))
    except CirisError as error:
        return {"anew": None, "anew_error": str(error)}
    as_large = next((when for when, size in found if size >= volume), None)
    return {"anew": {"seconds": found[-1][0], "volume": found[-1][1], "as_large": as_large}}


def _grown(q: list[float]) -> GrowthOptions:
    return GrowthOptions.from_document({"kind": "grow", "seed": {"q": q}})


def _volume(region: Region) -> float:
    """Returns the volume of a region in joint positions."""
    return float(region.manifest["q_volume"]["value"])


def changed(name: str, edit: Edit, folder: Path) -> Path:
    """Writes an example with a change into a folder, and returns its scene file."""
    shutil.copytree(EXAMPLES / name, folder)
    (folder / "post.sdf").write_text(POST, encoding="utf-8")
    file, old, new = edit
    text = (folder / file).read_text(encoding="utf-8")
    assert old in text, f"{file} of {name} has changed: the benchmark is to be brought up to date"
    (folder / file).write_text(text.replace(old, new), encoding="utf-8")
    return folder / "scene.yaml"
