"""This module measures how fast a scene is covered: by the service's certified regions, by a map, and by IRIS regions without certificates.

Each case is a cover of an example, with its goals and its deadline. The service runs separately, with a data directory that may be kept.
IRIS goes by the same rules for its seeds, in as many processes and for as long; its regions count as they are proposed. Drake's own is
IrisZo. A map grows until the coverage is reached, in as many processes and for as long.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import catalogue, iris_cover, measure
from benchmarks.measure import Progress
from benchmarks.service import running
from benchmarks.svg import Panel, draw
from certifier.jobs.map import grow_map
from certifier.model import Scene
from certifier.seeding.options import Method
from ciris.synchronous.client import Client

CIRIS, DRAKE, ZO, MAP = "ciris", "drake", "iris_zo", "map"
WAYS = {
    CIRIS: "certified regions",
    MAP: "a map",
    DRAKE: "IRIS regions, no certificates",
    ZO: "Drake's IrisZo, no certificates",
}
"""How the picture calls the ways."""


@dataclass(frozen=True)
class Case:
    """A cover to measure: the example, what is asked for, and the seconds until its deadline."""

    example: str
    deadline_s: float
    options: dict[str, Any] = field(default_factory=dict)


SHELF = {
    "above": [-0.34, 0.66, 0.29, -0.28, 0.88, 0.22, -0.97],
    "left": [0.75, 1.2, 0.02, -0.39, -1.53, 0.56, 0.96],
    "right": [-0.97, 1.12, 0.85, -0.5, 0.8, 0.31, -1.57],
    "in the upper shelf": [-0.05, 0.44, 0.02, -1.01, -1.61, 0.11, -1.06],
    "in the lower shelf": [-0.31, 0.68, 0.22, -1.44, 0.67, -0.84, 0.54],
}
"""Free configurations of iiwa_shelf whose hand is above, beside and in the shelves."""
CASES = {
    "planar_2dof": Case("planar_2dof", 120, {"coverage": 0.95, "connected": True}),
    "arm_3dof": Case("arm_3dof", 300, {"coverage": 0.85, "connected": True}),
    "ur3e_bin": Case("ur3e_bin", 600, {"coverage": 0.99, "connected": True}),
    "iiwa_shelf": Case("iiwa_shelf", 600, {"connect": list(SHELF.values())}),
    "iiwa_shelf_free": Case("iiwa_shelf", 300, {"coverage": 0.95, "stages": 1}),
    "iiwa_gripper": Case("iiwa_gripper", 300, {"coverage": 0.95, "stages": 1}),
}


def cover(
    names: list[str],
    ways: list[str],
    processes: int,
    deadline_s: float | None,
    data: Path | None,
    verify: bool,
    progress: Progress,
    **more: Any,
) -> dict[str, Any]:
    """Covers the examples of cases in these ways, one after the other. Returns the document of ``ciris bench cover``.

    Args:
        data: directory that keeps the services' data, in one of its own for each case; None for one that is removed.
        verify: whether the service checks the proof of every region once more, after the cover.
        more: options of the covers besides the cases'.

    Raises:
        CirisError: the service does not start, or refuses the cover.
    """
    rows = []
    for name in names:
        case = CASES[name]
        options, seconds, scene = {**case.options, **more}, deadline_s or case.deadline_s, catalogue.scene(case.example)
        runs = {}
        if CIRIS in ways:
            runs[CIRIS] = _certified(case, options, processes, seconds, data and data / name, verify, progress)
        if MAP in ways:
            runs[MAP] = _mapped(scene, options, processes, seconds, progress)
        for way, method in ((DRAKE, Method.IRIS), (ZO, Method.IRIS_ZO)):
            if way in ways:
                runs[way] = iris_cover.cover(scene, options, processes, seconds, partial(_tell, progress, way), method)
        rows.append({"case": name, "scene": case.example, "options": options, "deadline_seconds": seconds, "runs": runs})
    return {"benchmark": "cover", "machine": measure.machine(), "processes": processes, "rows": rows}


def _tell(progress: Progress, way: str, point: dict[str, Any]) -> None:
    progress(_line(way, point))


def _mapped(scene: Scene, options: dict[str, Any], processes: int, seconds: float, progress: Progress) -> dict[str, Any]:
    """Grows the scene's map."""
    points: list[dict[str, Any]] = []

    def tell(_: str, now: dict[str, Any]) -> None:
        points.append({"seconds": now["seconds"], "coverage": now["coverage"], "stderr": now["error"], "cells": now["cells"]})
        progress(f"{MAP} {now['seconds']:.1f} s: {100 * now['coverage']:.1f} +- {100 * now['error']:.1f} % proved, {now['cells']} cells")

    found = grow_map(scene, options.get("coverage", 1.0), seconds, processes, tell)
    tell(MAP, {"seconds": found.seconds, "coverage": found.coverage.share, "error": found.coverage.error, "cells": found.cells})
    return {"points": points, "reason": found.reason, "seconds": found.seconds, "cells": found.cells}


def picture(document: dict[str, Any]) -> str:
    """Draws the coverage of all ways over the seconds as SVG, one panel for each case."""
    panels = []
    for row in document["rows"]:
        series = {WAYS[way]: [(point["seconds"], point["coverage"]) for point in run["points"]] for way, run in row["runs"].items()}
        panels.append(Panel(row["scene"], series))
    return draw(panels, "share covered, over seconds", share=True)


@contextmanager
def _directory(data: Path | None) -> Iterator[Path]:
    if data is not None:
        yield data.absolute()
        return
    with tempfile.TemporaryDirectory() as directory:
        yield Path(directory) / "data"


def _certified(
    case: Case, options: dict[str, Any], processes: int, seconds: float, data: Path | None, verify: bool, progress: Progress
) -> dict[str, Any]:
    """Has a service of its own cover the example."""
    with _directory(data) as directory, running(directory, processes) as service, Client(service.url) as client:
        found, points = covered(client, case, options, seconds, progress)
        holding = [client.verify(region)["holds"] for region in found["regions"]] if verify else []
        return {
            "points": points,
            "reason": found["reason"],
            "seconds": found["seconds"],
            "coverage": found["coverage"],
            "regions": len(found["regions"]),
            "components": found["components"],
            "connect": found["connect"],
            "begun": len(found["grown"]),
            "without_region": sum(grown["region"] is None for grown in found["grown"]),
            **({"proofs_hold": sum(holding)} if verify else {}),
        }


def covered(
    client: Client, case: Case, options: dict[str, Any], seconds: float, progress: Progress
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Lets a service cover the example. Returns the final state of the cover, and the looks at the scene on the way."""
    scene = client.add_scene(catalogue.FILES[case.example])
    request = {"kind": "cover", "scene": scene["id"], "options": options, "deadline_seconds": seconds}
    job, _ = client.create_job(request)
    begun, points = _time(job["created_at"]), []
    for event in client.events(job["id"]):
        if event["kind"] == "cover":
            points.append(iris_cover.point((_time(event["created_at"]) - begun).total_seconds(), event["data"]))
            progress(_line(CIRIS, points[-1]))
    return client.cover(job["id"]), points


def table(way: str, run: dict[str, Any]) -> list[tuple[str, ...]]:
    """Returns the rows of a table about one way: coverage over the seconds, and how the regions are connected."""
    return [
        (
            way,
            f"{point['seconds']:.1f}",
            f"{100 * point['coverage']:.1f} ± {100 * point['stderr']:.1f}",
            str(point["regions"]),
            str(len(point["components"])),
            f"{100 * point['largest']:.1f}",
            " ".join("-" if part is None else str(part) for part in point["connect"]),
        )
        if "regions" in point
        else (way, f"{point['seconds']:.1f}", f"{100 * point['coverage']:.1f} ± {100 * point['stderr']:.1f}", "", "", "", "")
        for point in run["points"]
    ]


def _line(way: str, point: dict[str, Any]) -> str:
    return (
        f"{way} {point['seconds']:.1f} s: {100 * point['coverage']:.1f} +- {100 * point['stderr']:.1f} % covered by {point['regions']} "
        f"regions in {len(point['components'])} components, {100 * point['largest']:.1f} % of it in the largest; connect {point['connect']}"
    )


def _time(text: str) -> datetime:
    return datetime.fromisoformat(text)
