"""Trajectories over HTTP, through really certified regions; a real child process makes the curves."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import func, select

from api import advice, graph
from certifier.model import Scene
from certifier.proof.motion import MotionProof
from certifier.verify.file import verify_file
from db import motions, scenes
from db.models import ProofRow
from db.session import Database
from db.settings import settings
from tests.api.conftest import store_region
from tests.api.test_planning import a_part
from tests.scenes import slider


def plan(client: TestClient, start: object, goal: object, **limits: object) -> dict[str, Any]:
    asked = {"scene": "slider", "start": start, "goal": goal, "regions_only": True, **limits}
    answer = client.post("/v1/planning/plan", json=asked)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_trajectory_names_its_regions_and_is_a_covered_path(client: TestClient, region: str, database: Database) -> None:
    more = store_region(database, a_part(0.1, 0.7))
    found = plan(client, [-0.2], [0.6], speed=0.5, acceleration=[1.0])
    assert (found["found"], found["complete"], found["regions"], found["guarantee"]) == (True, True, 2, "exact")
    assert (found["reason"], found["nearest"], found["gap"], found["uncovered"]) == (None, None, None, None)
    assert (found["q"][0], found["q"][-1], found["t"][0], found["t"][-1]) == ([-0.2], [0.6], 0.0, found["duration"])
    assert (found["length"], found["duration"]) == (pytest.approx(0.8), pytest.approx(0.8 / 0.5 + 0.5 / 1.0, rel=0.05))
    assert [piece["region"] for piece in found["pieces"]] == [region, more]
    velocity = np.diff(np.ravel(found["q"])) / np.diff(found["t"])
    assert np.abs(velocity).max() <= 0.5
    between = (np.diff(found["t"])[:-1] + np.diff(found["t"])[1:]) / 2
    assert np.abs(np.diff(velocity) / between).max() <= 1.0 + 1e-6
    path = client.post("/v1/planning/path", json={"scene": "slider", "q": found["q"], "times": found["t"]}).json()
    assert (path["covered"], path["pieces"]) == (True, found["pieces"])


def test_an_end_may_be_a_region_by_the_beginning_of_its_id(client: TestClient, region: str, database: Database) -> None:
    more = store_region(database, a_part(0.1, 0.7))
    there = plan(client, [-0.2], more[:13])
    assert (there["found"], there["q"][-1]) == (True, [pytest.approx(0.1, abs=1e-2)])
    stays = plan(client, region, more)
    assert (stays["found"], stays["length"], stays["t"]) == (True, 0.0, [0.0, 0.0])


@pytest.mark.parametrize(("start", "goal", "reason"), [(0.9, 0.1, "start_uncovered"), (0.1, 0.9, "goal_uncovered")])
def test_an_end_outside_of_all_regions_is_shown_the_nearest(
    client: TestClient, region: str, start: float, goal: float, reason: str
) -> None:
    answer = plan(client, [start], [goal])
    assert (answer["found"], answer["reason"], answer["q"], answer["t"], answer["pieces"]) == (False, reason, [], [], [])
    assert (answer["nearest"]["region"], answer["nearest"]["distance"]) == (region, pytest.approx(0.7))
    assert plan(client, [5.0], [0.1])["nearest"] is None, "5 m is beyond the joint's limits"


def test_regions_apart_are_told_with_the_gap_between_them(client: TestClient, region: str, database: Database) -> None:
    beside, far = store_region(database, a_part(0.1, 0.4)), store_region(database, a_part(0.6, 0.9))
    answer = plan(client, [-0.2], [0.8])
    assert (answer["found"], answer["reason"], answer["complete"]) == (False, "disconnected", True)
    gap = answer["gap"]
    assert (gap["start_regions"], gap["goal_regions"], gap["start"], gap["goal"]) == (2, 1, beside, far)
    assert (gap["distance"], gap["q"]) == (pytest.approx(0.2), [pytest.approx(0.5)])
    assert (gap["q_start"], gap["q_goal"]) == ([pytest.approx(0.4)], [pytest.approx(0.6)])
    store_region(database, a_part(0.3, 0.7))
    assert plan(client, [-0.2], [0.8])["found"], "a region over the gap joins them"


def test_a_gap_without_a_free_place_advises_none(
    client: TestClient, region: str, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    store_region(database, a_part(0.6, 0.9))
    monkeypatch.setattr(advice, "in_collision", lambda scene, s, room: np.ones(len(s), dtype=bool))
    assert plan(client, [0.1], [0.8])["gap"]["q"] is None
    (gap,) = client.get("/v1/planning/graph?scene=slider").json()["gaps"]
    assert gap["q"] is None


def test_an_answer_without_all_overlaps_says_so(
    client: TestClient, region: str, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    store_region(database, a_part(0.1, 0.7))
    monkeypatch.setattr(graph, "COMPARE_SECONDS", -1.0)
    answer = plan(client, region, [0.6])
    assert (answer["found"], answer["reason"], answer["complete"]) == (False, "disconnected", False)


def test_overlaps_that_are_kept_follow_the_regions(client: TestClient, region: str, database: Database) -> None:
    more = store_region(database, a_part(0.1, 0.7))
    assert plan(client, [-0.2], [0.6])["found"]
    kept = client.app.state.links._kept  # type: ignore[attr-defined]
    assert [version for version, _ in kept.values()] == [2]
    assert client.delete(f"/v1/regions/{more}").status_code == 204
    store_region(database, a_part(0.3, 0.7))
    apart = plan(client, [-0.2], [0.6])
    assert (apart["version"], apart["reason"]) == (4, "disconnected")
    assert [version for version, _ in kept.values()] == [4]


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"start": [0.1, 0.2], "goal": [0.1]}, "start"),
        ({"start": [0.1], "goal": []}, "goal"),
        ({"start": [0.1], "goal": "abc"}, "goal"),
        ({"start": [0.1]}, "body"),
        ({"start": [0.1], "goal": [0.1], "speed": 0}, "speed"),
        ({"start": [0.1], "goal": [0.1], "speed": [1, 2]}, "speed"),
        ({"start": [0.1], "goal": [0.1], "acceleration": "fast"}, "acceleration"),
    ],
)
def test_what_makes_no_sense_is_refused(client: TestClient, scene: Scene, body: dict[str, object], field: str) -> None:
    answer = client.post("/v1/planning/plan", json={"scene": "slider"} | body)
    assert (answer.status_code, answer.json()["field"].split(".")[0]) == (422, field)


def test_a_region_of_another_scene_is_no_end(client: TestClient, region: str, database: Database) -> None:
    with database.write() as session:
        other = scenes.add(session, slider(posts=1)).id
    answer = client.post("/v1/planning/plan", json={"scene": other, "start": [0.1], "goal": region})
    assert (answer.status_code, answer.json()["code"], answer.json()["field"]) == (422, "region_elsewhere", "goal")


def ask(client: TestClient, start: object, goal: object, **more: object) -> dict[str, Any]:
    return plan(client, start, goal, regions_only=False, **more)


def test_without_regions_a_motion_is_found_proved_and_kept(client: TestClient, scene: Scene, database: Database) -> None:
    found = ask(client, [-0.5], [0.9], prove=True)
    assert (found["found"], found["regions"], found["guarantee"], found["reason"]) == (True, 0, "exact", None)
    assert (found["q"][0], found["q"][-1], found["length"]) == ([-0.5], [0.9], pytest.approx(1.4))
    assert [(piece["region"], piece["motion"]) for piece in found["pieces"]] == [(None, found["motion"])]
    data = base64.b64decode(found["proof"])
    assert (verify_file(data).kind, verify_file(data).scene.hash) == ("motion", scene.hash)
    assert MotionProof.from_bytes(data, scene).motion.controls.tolist() == found["q"]
    kept = client.get(f"/v1/planning/motions/{found['motion'][:8]}/proof")
    assert MotionProof.from_bytes(kept.content, scene).rho == found["tube"]
    assert verify_file(kept.content).kind == "motion"
    again = ask(client, [-0.5], [0.9])
    assert {**again, "proof": None} == {**found, "proof": None}
    slower = ask(client, [-0.5], [0.9], speed=0.5)
    assert (slower["motion"], slower["duration"] > found["duration"]) == (found["motion"], True)
    assert max(np.abs(np.diff(np.ravel(slower["q"])) / np.diff(slower["t"]))) <= 0.5
    back = ask(client, [0.7], [-0.5 - found["tube"] / 2])
    assert (back["motion"], back["q"][0], back["length"]) == (found["motion"], [0.7], pytest.approx(1.2 + found["tube"] / 2))
    with database.read() as session:
        assert len([row.id for row in motions.since(session, scenes.find(session, "slider"), 0)]) == 1


def test_what_is_kept_answers_questions_about_points_and_paths(client: TestClient, scene: Scene, database: Database) -> None:
    motion = ask(client, [-0.5], [0.9])
    asked = {"scene": "slider", "q": [[0.0], [-0.5 - 2 * motion["tube"]]]}
    points = client.post("/v1/planning/contains", json=asked).json()["points"]
    assert [(point["inside"], point["motions"]) for point in points] == [(True, [motion["motion"]]), (False, [])]
    path = client.post("/v1/planning/path", json={"scene": "slider", "q": [[-0.4], [0.8], [0.1]]}).json()
    assert (path["covered"], [piece["motion"] for piece in path["pieces"]]) == (True, [motion["motion"]])
    beyond = client.post("/v1/planning/path", json={"scene": "slider", "q": [[0.0], [-1.0]]}).json()
    assert (beyond["covered"], beyond["uncovered"]["q"]) == (False, [pytest.approx(-0.5 - motion["tube"])])


def test_a_kept_motion_makes_no_later_answer_worse(client: TestClient, scene: Scene) -> None:
    """Not its slower limits, and not its detour, whichever was asked first."""
    slow = ask(client, [-0.5], [0.9], speed=0.01)
    fast = ask(client, [-0.5], [0.9], speed=1.0)
    assert slow["duration"] > 100 > 5 > fast["duration"]
    detour = client.post("/v1/planning/plan", json={"scene": "slider", "start": [-0.3], "goal": [0.2], "via": [[0.8]]}).json()
    assert detour["length"] == pytest.approx(1.7)
    for start in (-0.3, -0.29):
        assert ask(client, [start], [0.2])["length"] == pytest.approx(0.2 - start)


def test_the_oldest_motions_go(client: TestClient, scene: Scene, database: Database, environment: pytest.MonkeyPatch) -> None:
    environment.setenv("CIRIS_KEPT_MOTIONS", "2")
    settings.cache_clear()
    first, second, third = (ask(client, [-0.9 + goal], [goal])["motion"] for goal in (0.1, 0.5, 0.9))
    with database.read() as session:
        assert [row.id for row in motions.since(session, scenes.find(session, "slider"), 0)] == [second, third]
        assert session.scalar(select(func.count()).select_from(ProofRow)) == 2
    assert ask(client, [-0.8], [0.1])["motion"] not in (first, second, third)


def test_a_motion_goes_through_what_is_asked_for_to_the_nearest_goal(client: TestClient, scene: Scene) -> None:
    found = client.post("/v1/planning/plan", json={"scene": "slider", "start": [0.0], "goals": [[0.9], [-0.3]], "via": [[0.2]]}).json()
    assert (found["found"], found["q"][-1], found["length"]) == (True, [-0.3], pytest.approx(0.7))
    assert min(abs(q[0] - 0.2) for q in found["q"]) < 1e-9


@pytest.mark.parametrize(
    ("more", "reason", "where"),
    [
        ({"start": [1.5], "goal": [0.1]}, "start_outside_limits", "start"),
        ({"start": [0.1], "goal": [1.5]}, "goal_outside_limits", "goal"),
        ({"start": [0.1], "goals": [[1.5], [1.6]]}, "goal_outside_limits", "goals[0]"),
        ({"start": [0.1], "goal": [0.2], "via": [[0.3], [1.5]]}, "via_outside_limits", "via[1]"),
    ],
)
def test_a_joint_outside_its_limits_is_named(client: TestClient, scene: Scene, more: dict[str, Any], reason: str, where: str) -> None:
    answer = client.post("/v1/planning/plan", json={"scene": "slider", **more}).json()
    assert (answer["found"], answer["reason"], answer["collision"]) == (False, reason, None)
    assert answer["limit"] == {"where": where, "joint": "model/slide", "value": 1.5, "lower": -1.0, "upper": 1.0}


@pytest.mark.parametrize(
    "more",
    [
        {"goal": [0.1], "goals": [[0.1]]},
        {"goals": [[0.1]], "regions_only": True},
        {"goal": [0.1], "via": [[0.1]], "regions_only": True},
        {"goal": [0.1], "seconds": 0},
        {"goal": [0.1], "seconds": 1000},
    ],
)
def test_what_does_not_go_together_is_refused(client: TestClient, scene: Scene, more: dict[str, Any]) -> None:
    assert client.post("/v1/planning/plan", json={"scene": "slider", "start": [0.1], **more}).status_code == 422
