"""examples/planner_ompl.py: OMPL plans by the contacts of a real service, which certifies the path or sends OMPL around a contact."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ompl import util

import ciris
from certifier.scene.load import load_scene
from db import scenes
from db.session import Database

EXAMPLE = Path(__file__).parents[2] / "examples" / "planner_ompl.py"
PLANAR = Path(__file__).parents[2] / "examples" / "planar_2dof" / "scene.yaml"
START, GOAL = [0.2, 0.3], [2.0, 1.0]
"""A bar is between them."""


@pytest.fixture
def program(database: Database) -> dict[str, Any]:
    util.RNG.setSeed(1)
    util.setLogLevel(util.LogLevel.LOG_WARN)
    with database.write() as session:
        scenes.add(session, load_scene(PLANAR))
    return runpy.run_path(str(EXAMPLE))


def test_a_contact_between_samples_makes_ompl_plan_around_it(url: str, program: dict[str, Any]) -> None:
    """The first path goes straight through the bar, as one may whose samples lie on both sides of it."""
    with ciris.connect(url) as service:
        scene = service.scene("planar-2dof")
        assert not service.certify_path(scene, [START, GOAL])
        planner = program["Planner"](service, scene, patience=20)
        through, sampled = [np.array([START, GOAL])], planner.path
        planner.path = lambda *ends: through.pop() if through else sampled(*ends)
        waypoints = planner.certified(START, GOAL)
        assert planner.contacts
        assert service.certify_path(scene, waypoints)
    assert [waypoints[0].tolist(), waypoints[-1].tolist()] == [START, GOAL]


def test_what_is_near_a_contact_is_avoided(url: str, program: dict[str, Any]) -> None:
    with ciris.connect(url) as service:
        planner = program["Planner"](service, service.scene("planar-2dof"), patience=1)
        assert planner.free(START)
        planner.contacts.append(np.array(START) + 0.01)
        assert not planner.free(START)
        assert not planner.free([9.0, 0.0])
        assert planner.certified(START, GOAL) is None


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["planar-2dof", "--start", "0.1", "0.05", "--goal", "1", "-1.5"], 0, "the whole path is proved to be free of collision"),
        (["planar-2dof", "--start", "0.1", "--goal", "0.1", "0.2"], 2, "the last number must be 2"),
        (["nowhere", "--start", "0.1", "--goal", "0.1"], 2, "there is no scene 'nowhere'"),
    ],
)
def test_the_program_says_how_it_went(url: str, program: dict[str, Any], arguments: list[str], status: int, words: str) -> None:
    environment = os.environ | {"CIRIS_URL": url}
    done = subprocess.run([sys.executable, EXAMPLE, *arguments], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    assert words in done.stderr
    assert "Traceback" not in done.stderr
