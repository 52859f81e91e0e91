"""This module takes robots as people ship them from their model files to a verified region, by the commands that a new user types."""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks import commands, measure, models
from benchmarks.measure import Progress
from certifier.errors import CirisError

DEADLINE = 300.0
"""Seconds that a region may take."""


def robots(names: list[str], deadline: float, progress: Progress) -> dict[str, Any]:
    """Drafts a scene, checks it, grows a region and verifies its proof for each robot. Returns the document of ``ciris bench robots``.

    Raises:
        CirisError: ``unknown_robot``.
    """
    for name in names:
        if name not in models.ROBOTS:
            raise CirisError("unknown_robot", f"there is no robot {name!r}", hint=f"robots: {', '.join(models.ROBOTS)}")
    rows = []
    for name in names:
        rows.append({"robot": name, **_row(name, deadline)})
        progress(f"{name}: {rows[-1]['ended']}, {rows[-1]['seconds']} s")
    return {"benchmark": "robots", "machine": measure.machine(), "deadline": deadline, "rows": rows}


def _row(name: str, deadline: float) -> dict[str, Any]:
    """Returns what the commands said, and the seconds of each by the clock. The first that fails is the last."""
    row: dict[str, Any] = {"ended": "verified", "seconds": {}}
    with tempfile.TemporaryDirectory() as place:
        directory = Path(place)
        model = models.write(name, directory)
        scene, proof = str(directory / "cell" / "scene.yaml"), str(directory / "region.proof")
        try:
            _timed(row, "scene", "init", str(model.robot), "--world", str(model.world), "--out", scene)
            checked = json.loads(_timed(row, "scene", "check", scene, "--json"))
            row |= {"joints": len(checked["joints"]), "pairs": len(checked["pairs"]), "ignored": len(checked["ignored"])}
            region = json.loads(_timed(row, "grow", scene, "--local", "--deadline", f"{deadline:g}", "--json", "--out", proof))
            row |= {"share": measure.share(region)["value"], "faces": len(region["halfspace_offsets"])}
            row["proof_bytes"] = Path(proof).stat().st_size
            _timed(row, "verify", proof)
        except CirisError as failed:
            row["ended"] = failed.message
    return row


def _timed(row: dict[str, Any], *arguments: str) -> str:
    """Runs a command of ciris and returns what it prints.

    Raises:
        CirisError: ``command_failed``.
    """
    verb, start = " ".join(arguments[: 2 if arguments[0] == "scene" else 1]), time.perf_counter()
    done = commands.run(*arguments)
    row["seconds"][verb] = round(time.perf_counter() - start, 1)
    return commands.output(done)
