"""A scene has a warning about conditions that no configuration keeps."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from certifier.model import Scene
from certifier.pair.collisions import contacts
from certifier.scene.conditions import constrained, read_conditions
from certifier.scene.load import load_scene
from client.cli import main

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="module")
def cell() -> Scene:
    return load_scene(EXAMPLES / "ur3e_bin/scene.yaml")


def turning(joints: dict[str, int], *degrees: float) -> dict[str, Any]:
    return {"range": {"joints": {f"arm/{name}_joint": sign for name, sign in joints.items()}, "degrees": [*degrees]}}


def box(lower: list[float], upper: list[float], **more: Any) -> dict[str, Any]:
    return {"inside": {"what": [{"body": "arm/wrist_3", "point": [0, 0, 0]}], "box": {"lower": lower, "upper": upper}, **more}}


def ball(x: float, radius: float) -> dict[str, Any]:
    return {"inside": {"what": [{"body": "arm/wrist_3", "point": [0, 0, 0]}], "ball": {"center": [x, 0, 0.3], "radius": radius}}}


def cone(axis: list[int], along: list[int], degrees: float) -> dict[str, Any]:
    return {"cone": {"body": "arm/wrist_3", "axis": axis, "along": along, "degrees": degrees}}


def said(cell: Scene, *conditions: dict[str, Any]) -> tuple[Scene, list[str]]:
    """The scene with conditions named a, b, ..., and what is said beside its own warnings."""
    made = constrained(cell, read_conditions([{"name": "abc"[i], **one} for i, one in enumerate(conditions)]))
    return made, [warning for warning in made.warnings if warning not in cell.warnings]


LEFT, RIGHT = box([0.1, 0.1, 0.1], [0.5, 0.5, 0.5]), box([0.1, -0.5, 0.1], [0.5, -0.1, 0.5])


@pytest.mark.parametrize(
    ("conditions", "why"),
    [
        ((turning({"elbow": 1}, 10, 40), turning({"elbow": 1}, 50, 80)), "no value of 'arm/elbow_joint' is in the ranges of both"),
        ((turning({"elbow": 1}, 10, 40), turning({"elbow": -1}, 50, 80)), "no value of 'arm/elbow_joint' is in the ranges of both"),
        (
            (turning({"elbow": 1, "wrist_1": -1}, 0, 30), turning({"wrist_1": 1, "elbow": -1}, 10, 30)),
            "no value of 'arm/elbow_joint' - 'arm/wrist_1_joint' is in the ranges of both",
        ),
        ((LEFT, RIGHT), "the point (0, 0, 0) m of 'arm/wrist_3' has to be in two zones that do not meet"),
        ((LEFT, ball(-0.5, 0.3)), "the point (0, 0, 0) m of 'arm/wrist_3' has to be in two zones that do not meet"),
        ((ball(0.5, 0.2), ball(-0.5, 0.2)), "the point (0, 0, 0) m of 'arm/wrist_3' has to be in two zones that do not meet"),
        ((cone([0, 0, 1], [0, 0, 1], 20), cone([0, 0, 1], [1, 0, 0], 60)), "both are about directions of 'arm/wrist_3'"),
        ((cone([0, 0, 1], [0, 0, 1], 20), cone([1, 0, 0], [0, 0, 1], 60)), "both are about directions of 'arm/wrist_3'"),
    ],
)
def test_two_that_exclude_each_other_are_told(cell: Scene, conditions: tuple[dict[str, Any], ...], why: str) -> None:
    made, (warning,) = said(cell, *conditions)
    assert warning.startswith(f"the conditions 'a' and 'b' exclude each other: {why}")
    # Nothing at random keeps both, so the warning is true.
    q = np.random.default_rng(0).uniform(made.q_lower, made.q_upper, (300, made.n))
    apart = [{made.pairs[i].a.split("/")[1] for i in found} for found in contacts(made, made.to_s(q))]
    assert all(found & {"a", "b"} for found in apart)


@pytest.mark.parametrize(
    "conditions",
    [
        (turning({"elbow": 1}, 10, 60), turning({"elbow": 1}, 50, 80)),
        (turning({"shoulder_pan": 1}, -10, 40), turning({"shoulder_pan": 1}, 380, 400)),
        (turning({"elbow": 1}, 10, 40), turning({"wrist_1": 1}, 50, 80)),
        (LEFT, box([0.3, 0.3, 0.3], [0.6, 0.6, 0.6])),
        (LEFT, box([0.1, -0.5, 0.1], [0.5, -0.1, 0.5], of="arm/base")),
        (ball(0.5, 0.6), ball(-0.5, 0.6)),
        (cone([0, 0, 1], [0, 0, 1], 40), cone([0, 0, 1], [1, 0, 0], 60)),
        (cone([0, 0, 1], [0, 0, 1], 20), cone([1, 0, 0], [1, 0, 0], 20)),
    ],
)
def test_two_that_agree_somewhere_are_not(cell: Scene, conditions: tuple[dict[str, Any], ...]) -> None:
    assert said(cell, *conditions)[1] == []


def test_one_that_the_joint_limits_exclude_is_told_alone(cell: Scene) -> None:
    """The lift of the shoulder goes from -171.9 to 0 degrees."""
    assert said(cell, turning({"shoulder_lift": 1}, 10, 60), turning({"shoulder_lift": 1}, -20, -10))[1] == [
        "no configuration keeps the condition 'a': 'arm/shoulder_lift_joint' is never in its range within the joint limits"
    ]


def test_a_scene_file_and_its_check_tell_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(EXAMPLES / "ur3e_bin", tmp_path / "cell")
    path = tmp_path / "cell/scene.yaml"
    conditions = [{"name": "left", **LEFT}, {"name": "right", **RIGHT}]
    path.write_text(f"{path.read_text()}\n{yaml.safe_dump({'conditions': conditions})}")
    assert main(["scene", "check", str(path), "--q", ",".join(["0", "-1.5", "1", "0", "0", "0"])]) == 1
    assert "warning: the conditions 'left' and 'right' exclude each other" in capsys.readouterr().out
