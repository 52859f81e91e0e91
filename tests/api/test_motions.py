"""Motions over HTTP: certified by a child process, with a proof that holds, or with the first contact."""

from __future__ import annotations

import base64
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.schemas.motions import JobMotion, MotionResponse
from certifier.jobs.motion import certify
from certifier.model import Scene
from certifier.motion.given import given, motion_of
from certifier.proof.motion import Space
from certifier.verify.file import verify_file
from db import scenes
from db.session import Database
from tests.certifier.motions import swing

ROUTE = "/v1/planning/certify-path"
JOB = {"kind": "certify-path", "scene": "slider"}


def test_a_motion_is_certified_with_its_proof(client: TestClient, scene: Scene) -> None:
    found = client.post(ROUTE, json={"scene": "slider", "q": [[0.1], [-0.3], [0.0]], "tube": True, "prove": True}).json()
    assert (found["outcome"], found["guarantee"], found["waypoints"], found["stop"]) == ("certified", "exact", 3, None)
    assert found["scene"] == {"name": "slider", "hash": scene.hash}
    assert found["tube"] > 0
    statement = verify_file(base64.b64decode(found["proof"]))
    assert (statement.kind, statement.scene.hash) == ("motion", scene.hash)


def test_the_answer_is_that_of_a_plain_call(client: TestClient, database: Database) -> None:
    """About a motion that touches, straight in q between waypoints in s."""
    scene, waypoints = swing(-0.01), [[-0.5], [0.6]]
    with database.write() as session:
        scenes.add(session, scene)
    found = client.post(ROUTE, json={"scene": scene.name, "s": waypoints, "space": "q"}).json()
    expected = certify(scene, given(scene, waypoints, Space.S, Space.Q)).document() | {"proof": None}
    assert set(MotionResponse.model_fields) == set(expected)
    for name in set(expected) - {"seconds", "verify_seconds"}:
        assert found[name] == expected[name], name
    assert (found["outcome"], found["space"], found["proof"]) == ("refuted", "q", None)


def test_clearance_and_padding_are_answered_as_by_a_plain_call(client: TestClient, database: Database) -> None:
    scene, waypoints = swing(0.01), [[-0.5], [0.6]]
    with database.write() as session:
        scenes.add(session, scene)
    motion = given(scene, waypoints, Space.Q)
    for padding, outcome in ((0.004, "certified"), (0.006, "refuted")):
        asked = {"scene": scene.name, "q": waypoints, "clearance": True, "padding": padding, "prove": True}
        found = client.post(ROUTE, json=asked).json()
        expected = certify(scene, motion, padding=padding, clearance=True).document()
        for name in set(expected) - {"seconds", "verify_seconds"}:
            assert found[name] == expected[name], name
        assert (found["outcome"], found["padding"]) == (outcome, padding)
        assert found["proved_distance"] >= 2 * padding
        if outcome == "certified":
            assert 0.0099 <= found["clearance"] <= 0.01
            assert {found["nearest"]["a"], found["nearest"]["b"]} == {geometry.name for geometry in scene.geometries}


def test_the_stored_verdict_of_an_earlier_version_is_read() -> None:
    scene = swing(0.01)
    known = certify(scene, given(scene, [[-0.5], [0.6]], Space.Q)).document()
    stored = {name: value for name, value in known.items() if name not in ("padding", "proved_distance", "clearance", "nearest")}
    assert JobMotion.model_validate({**stored, "proof": None}).model_dump(mode="json") == {**known, "proof": None}


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize(
    "curve",
    [
        {"bezier": [[[0.1], [-0.3], [0.0]], [[0.0], [0.2], [0.1]]]},
        {"knots": [0, 0, 0, 1, 5, 5, 5], "control_points": [[0.1], [-0.3], [0.3], [0.0]]},
    ],
    ids=["bezier", "spline"],
)
def test_a_curve_is_certified_as_by_a_plain_call(client: TestClient, scene: Scene, curve: dict[str, Any], space: Space) -> None:
    found = client.post(ROUTE, json={"scene": "slider", "space": space, "prove": True} | curve).json()
    assert (found["outcome"], found["degree"], found["waypoints"], found["space"]) == ("certified", 2, 3, space)
    assert any("of 2 polynomial pieces of degree 2" in line for line in verify_file(base64.b64decode(found["proof"])).lines)
    expected = certify(scene, motion_of(scene, curve, space)).document()
    assert {name: found[name] for name in ("proved_distance", "margin", "intervals")} == {
        name: expected[name] for name in ("proved_distance", "margin", "intervals")
    }


def test_a_job_keeps_the_motion_as_it_was_given_and_a_retry_copies_it(client: TestClient, scene: Scene, database: Database) -> None:
    motion = {"knots": [0, 0, 0, 1, 5, 5, 5], "control_points": [[0.1], [-0.3], [0.3], [0.0]], "space": "s"}
    answer = client.post("/v1/jobs", json=JOB | motion | {"deadline_seconds": 60})
    job = answer.json()
    assert (answer.status_code, job["kind"], job["state"], job["options"]) == (
        201,
        "certify-path",
        "queued",
        motion | {"tube": False, "padding": 0.0, "clearance": False},
    )
    waits = client.get(f"/v1/jobs/{job['id']}/motion")
    assert (waits.status_code, waits.json()["code"]) == (404, "motion_not_found")
    assert client.post(f"/v1/jobs/{job['id']}/cancel").json()["state"] == "cancelled"
    again = client.post(f"/v1/jobs/{job['id']}/retry").json()
    assert (again["kind"], again["options"], again["retry_of"]) == (job["kind"], job["options"], job["id"])


@pytest.mark.parametrize("route", [ROUTE, "/v1/jobs"])
@pytest.mark.parametrize(
    ("body", "code", "field"),
    [
        ({"q": [[0.1], [0.1, 0.2]]}, "motion_shape", "q"),
        ({"q": [[0.1], [99]]}, "outside_limits", "q[1][0]"),
        ({"q": [[0.1]]}, "invalid_request", "q"),
        ({"q": [[0.1], [0.2]], "s": [[0.1], [0.2]]}, "invalid_request", "body"),
        ({}, "invalid_request", "body"),
        ({"q": [[0.1], [0.2]], "space": "x"}, "invalid_request", "space"),
        ({"bezier": [[[0.1], [0.2]]], "q": [[0.1], [0.2]]}, "invalid_request", "body"),
        ({"bezier": [[[0.1]]]}, "invalid_request", "bezier[0]"),
        ({"bezier": [[[0.1]] * 17]}, "invalid_request", "bezier[0]"),
        ({"bezier": [[[0.1], [0.2]], [[0.1], [0.2]]]}, "curve_not_continuous", "bezier[1][0]"),
        ({"bezier": [[[0.1], [99], [0.2]]]}, "outside_limits", "bezier[0][1][0]"),
        ({"knots": [0, 0, 1, 1]}, "invalid_request", "body"),
        ({"knots": [0, 0, 1, 0.5], "control_points": [[0.1], [0.2]]}, "knots", "knots[3]"),
        ({"knots": [0, 0, 0, 1, 1], "control_points": [[0.1], [0.2]]}, "curve_shape", "knots"),
        ({"q": [[0.1], [0.2]], "speed": 1}, "invalid_request", "speed"),
        ({"q": [[0.1], [0.2]], "padding": -1e-3}, "invalid_request", "padding"),
        ({"q": [[0.1], [0.2]], "padding": "5 mm"}, "invalid_request", "padding"),
        ({"q": [[0.1], [0.2]], "padding": 1e7}, "padding", "padding"),
    ],
)
def test_what_is_no_motion_is_refused_with_its_place(
    client: TestClient, scene: Scene, route: str, body: dict[str, object], code: str, field: str
) -> None:
    answer = client.post(route, json=(JOB if route == "/v1/jobs" else {"scene": "slider"}) | body)
    assert (answer.status_code, answer.json()["code"], answer.json()["field"]) == (422, code, field)


def test_an_unknown_scene_is_named(client: TestClient, scene: Scene) -> None:
    answer = client.post(ROUTE, json={"scene": "glider", "q": [[0.1], [0.2]]})
    assert (answer.status_code, answer.json()["code"]) == (404, "scene_not_found")
