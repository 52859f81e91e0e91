"""examples/moveit_trajectory.py: trajectories as MoveIt and ROS write them, certified by a real service."""

from __future__ import annotations

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import BPoly

from certifier.scene.load import load_scene
from db import scenes
from db.session import Database

EXAMPLE = Path(__file__).parents[2] / "examples" / "moveit_trajectory.py"
PLANAR = Path(__file__).parents[2] / "examples" / "planar_2dof" / "scene.yaml"


def trajectory(names: list[str], *positions: list[float], **rates: list[float]) -> dict[str, Any]:
    return {"joint_names": names, "points": [{"positions": q, "time_from_start": 1.5 * k, **rates} for k, q in enumerate(positions)]}


FREE, TOUCHING = ([0.05, 0.1], [0.3, 0.2]), ([0.05, 0.1], [2.0, 2.0])
ORDER = ["elbow", "shoulder"]
REST = {"velocities": [0.0, 0.0]}


@pytest.fixture
def example(url: str, database: Database, tmp_path: Path) -> Any:
    with database.write() as session:
        scenes.add(session, load_scene(PLANAR))

    def run(document: object) -> subprocess.CompletedProcess[str]:
        (tmp_path / "trajectory.json").write_text(json.dumps(document))
        command = [sys.executable, EXAMPLE, "planar-2dof", tmp_path / "trajectory.json"]
        return subprocess.run(command, env=os.environ | {"CIRIS_URL": url}, capture_output=True, text=True, check=False)

    return run


def test_a_verdict_is_the_exit_status(example: Any) -> None:
    done = example(trajectory(ORDER, *FREE))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("certified: no collision in 1.5 s, ")
    stamped = {"joint_trajectory": trajectory(["arm/elbow", "arm/shoulder"], *FREE, **REST)}
    stamped["joint_trajectory"]["points"][1]["time_from_start"] = {"sec": 1, "nanosec": 500000000}
    stamped["joint_trajectory"]["points"][0]["time_from_start"] = {"secs": 0, "nsecs": 0}
    assert example(stamped).stdout.startswith("certified: no collision in 1.5 s, ")


def test_a_contact_has_its_time_and_its_joints(example: Any) -> None:
    done = example(trajectory(ORDER, *TOUCHING))
    assert (done.returncode, done.stderr) == (1, "")
    verdict, bodies, place = done.stdout.splitlines()
    assert verdict == "not certified: refuted"
    names, time = bodies.split(", ")
    at = float(time.removesuffix(" s after the start")) / 1.5
    assert names == "arm/lower/bar and obstacles/body/block"
    joints = {name: float(value) for name, value in (part.split(" = ") for part in place.split(", "))}
    assert joints["arm/elbow"] == pytest.approx(0.05 + at * 1.95, abs=1e-4)
    assert joints["arm/shoulder"] == pytest.approx(0.1 + at * 1.9, abs=1e-4)


@pytest.mark.parametrize("rates", [["velocities"], ["velocities", "accelerations"]])
def test_the_curve_is_the_one_of_the_controller(rates: list[str]) -> None:
    random, t = np.random.default_rng(0), np.array([0.0, 0.5, 2.0])
    values = random.normal(size=(3, 3, 2))
    points = [dict(zip(["positions", *rates], rows.tolist(), strict=False)) for rows in values]
    pieces, curved = runpy.run_path(str(EXAMPLE))["curve"](points, [1, 0], t)
    assert curved
    wanted = BPoly.from_derivatives(t, values[:, : 1 + len(rates), ::-1])
    assert pieces == pytest.approx(np.moveaxis(wanted.c, 1, 0))


@pytest.mark.parametrize(
    ("document", "words"),
    [
        (trajectory(["elbow"], [0.1], [0.2]), "joint_names: 0 of the names mean the joint arm/shoulder"),
        (trajectory(["elbow", "arm/elbow", "shoulder"], [0.1] * 3, [0.2] * 3), "2 of the names mean the joint arm/elbow"),
        (trajectory([*ORDER, "finger"], [0.1] * 3, [0.2] * 3), "not one joint of the scene for each of finger"),
        (trajectory(ORDER, [0.1], [0.2]), "points: this is no JointTrajectory (IndexError"),
        (trajectory(ORDER, [0.1, 9.0], [0.2, 0.1]), "q[0][0]"),
        ({"points": []}, "points: this is no JointTrajectory (KeyError: 'joint_names')"),
        ([], "points: this is no JointTrajectory"),
        ({**trajectory(ORDER, *FREE), "points": 2 * trajectory(ORDER, *FREE)["points"]}, "time_from_start does not ascend"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(example: Any, document: object, words: str) -> None:
    done = example(document)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
