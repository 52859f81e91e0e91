"""A program that asks for a job hears what will probably end it at once; the job is made all the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from certifier.conditioned import with_conditions
from certifier.conditions import InBall
from certifier.model import WORLD
from certifier.scene.load import load_scene
from db import scenes
from db.session import Database
from jobs.checks import blocked
from tests.certifier.scenes import planar_arm

PLANAR = Path(__file__).parents[2] / "examples" / "planar_2dof" / "scene.yaml"


@pytest.fixture
def scene_id(database: Database) -> str:
    with database.write() as session:
        return scenes.add(session, load_scene(PLANAR)).id


def seed(*contain: list[float]) -> dict[str, Any]:
    return {"q": [0.0, 0.0], "contain": list(contain)}


def test_what_is_between_configurations_to_contain_is_warned_of(client: TestClient, scene_id: str) -> None:
    asked = {"kind": "grow", "scene": scene_id, "seed": seed([0.75, 1.5])}
    (warning,) = client.post("/v1/jobs", json=asked).json()["warnings"]
    assert warning.startswith("a region cannot hold the straight line in s from seed.q to seed.contain[0]: ")
    assert warning.endswith(", as computed; the job will probably end at once")
    near = {**asked, "seed": seed([0.01, 0.01])}
    made = client.post("/v1/jobs/batch", json={"jobs": [near, asked]}).json()["jobs"]
    assert [job["warnings"] for job in made] == [[], [warning]]
    assert "warnings" not in client.get(f"/v1/jobs/{made[0]['id']}").json()
    assert client.post("/v1/jobs", json={"kind": "cover", "scene": scene_id}).json()["warnings"] == []


def test_a_configuration_that_touches_is_named_itself() -> None:
    (warning,) = blocked(load_scene(PLANAR), {"seed.q": [0.0, 0.0], "seed.contain[0]": [0.5, 0.5]})
    assert warning.startswith("a region cannot hold seed.contain[0]: ")


def test_a_polytope_in_a_ball_refutes_nothing() -> None:
    """A configuration in the ball and not in its polytope is no reason to warn."""
    arm = planar_arm()
    scene = with_conditions(arm, [InBall("near", ("arm/link2/bar",), WORLD, (0.0, 0.0, 0.0), 0.1)])
    assert blocked(scene, {"seed.q": [0.0, 0.0], "seed.contain[0]": [0.01, 0.01]}) == []


def test_many_pairs_are_looked_at_in_fewer_configurations(monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[int] = []
    scene = load_scene(PLANAR)
    monkeypatch.setattr("jobs.checks.LOOKED_AT", 20 * len(scene.pairs))
    monkeypatch.setattr("jobs.checks.contacts", lambda _, s: looked.append(len(s)) or [[] for _ in np.atleast_2d(s)])
    blocked(scene, {f"seed.contain[{i}]": [0.0, 0.0] for i in range(4)})
    assert looked == [4 + 6 * 2]
