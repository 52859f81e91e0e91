"""Configurations that somebody asked about and nothing proved are kept, for a map to begin with, and for their project alone."""

from __future__ import annotations

import time
from datetime import timedelta
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import func, select

from api import unanswered
from api.access import KEYS_SECONDS
from certifier.model import Scene
from db import jobs, keys, projects, questions, retention, scenes
from db.keys import Scope
from db.models import QuestionRow
from db.session import Database
from db.settings import settings
from db.types import utcnow
from tests.api.test_planning import blocked


@pytest.fixture
def keeping(environment: pytest.MonkeyPatch, monkeypatch: pytest.MonkeyPatch) -> None:
    environment.setenv("CIRIS_KEPT_QUESTIONS", "3")
    settings.cache_clear()
    monkeypatch.setattr(unanswered, "SECONDS", 0.05)


def kept(database: Database, scene_id: str, count: int, seconds: float = 10.0) -> list[list[float]]:
    """What is kept of a scene, as soon as it is this many."""
    until = time.monotonic() + seconds
    while True:
        with database.read() as session:
            found = questions.latest(session, scene_id)
        if len(found) == count or time.monotonic() > until:
            return found
        time.sleep(0.02)


def ask(client: TestClient, question: str, **body: Any) -> Any:
    answer = client.post(f"/v1/planning/{question}", json={"scene": "slider", **body})
    assert answer.status_code == 200, answer.json()
    return answer.json()


def test_what_nothing_proves_is_kept_once_and_the_latest_stays(client: TestClient, region: str, database: Database, keeping: None) -> None:
    with database.read() as session:
        scene_id = scenes.find(session, "slider")
    ask(client, "contains", q=[[0.1], [0.9], [5.0], [0.9], [0.9 + 1e-9]])
    assert kept(database, scene_id, 1) == [[pytest.approx(0.9)]], "what is proved or outside the limits is not kept, and the same only once"
    stop = ask(client, "path", q=[[0.0], [0.4]])["uncovered"]["q"]
    assert kept(database, scene_id, 2) == [stop, [pytest.approx(0.9)]]
    ask(client, "segment", q=[[[0.5], [0.6]], [[0.0], [0.1]]])
    assert kept(database, scene_id, 3)[0] == [0.5]
    assert ask(client, "plan", start=[0.1], goal=[0.8], regions_only=True)["reason"] == "goal_uncovered"
    deadline = time.monotonic() + 10
    while [0.8] not in (found := kept(database, scene_id, 3)) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert [0.8] in found
    assert len(found) == 3, "the oldest ones go"


def test_a_service_that_keeps_no_questions_writes_nothing(client: TestClient, region: str, database: Database) -> None:
    ask(client, "contains", q=[[0.9]])
    with database.read() as session:
        assert questions.latest(session, scenes.find(session, "slider")) == []


def test_a_map_begins_with_what_was_asked_and_is_free(client: TestClient, scene: Scene, database: Database, keeping: None) -> None:
    with database.write() as session:
        scene_id = scenes.add(session, blocked(scene)).id  # with a post at 0.5
        questions.note(session, scene_id, np.array([[0.9], [0.5]]), 3, utcnow())
    body = {"kind": "map", "scene": "slider", "options": {"at": [[0.1]], "asked": True}}
    made = client.post("/v1/jobs", json=body, headers={"Idempotency-Key": "once"})
    assert made.status_code == 201, made.json()
    with database.write() as session:
        options = jobs.get(session, made.json()["id"]).options
        questions.note(session, scene_id, np.array([[0.8]]), 3, utcnow())
    assert (options["at"], options["asked"]) == ([[0.1], [0.9]], False)
    again = client.post("/v1/jobs", json=body, headers={"Idempotency-Key": "once"})
    assert again.json()["id"] == made.json()["id"], "the request is the same, whatever was asked meanwhile"
    later = client.post("/v1/jobs", json=body).json()["id"]
    plain = client.post("/v1/jobs", json=body | {"options": {"at": [[0.1]]}}).json()["id"]
    with database.read() as session:
        assert jobs.get(session, later).options["at"] == [[0.1], [0.8], [0.9]]
        assert jobs.get(session, plain).options["at"] == [[0.1]]


def test_what_one_project_asks_is_nothing_to_another(client: TestClient, scene: Scene, database: Database, keeping: None) -> None:
    with database.write() as session:
        projects.add(session, "others")
        key = {name: keys.add(session, "admin", Scope.ADMIN, name) for name in ("default", "others")}
        ids = {"default": scenes.find(session, "slider")}
    time.sleep(KEYS_SECONDS)
    of = {name: {"Authorization": f"Bearer {value}"} for name, value in key.items()}
    with database.of("others").write() as session:
        ids["others"] = scenes.add(session, scene).id
    asked = {"scene": "slider", "q": [[0.9]]}
    assert client.post("/v1/planning/contains", json=asked, headers=of["default"]).status_code == 200
    assert kept(database, ids["default"], 1) == [[0.9]]
    for name, at in (("default", [[0.9]]), ("others", [])):
        body = {"kind": "map", "scene": "slider", "options": {"asked": True}}
        made = client.post("/v1/jobs", json=body, headers=of[name])
        assert made.status_code == 201, made.json()
        with database.read() as session:
            assert jobs.get(session, made.json()["id"]).options["at"] == at
            assert questions.latest(session, ids["others"]) == []
    with database.of("others").read() as session:
        assert questions.latest(session, ids["default"]) == []


def test_questions_go_with_their_scene_and_after_the_days_of_their_project(database: Database, scene: Scene) -> None:
    scene_id, now = scene.hash[:16], utcnow()
    with database.write() as session:
        questions.note(session, scene_id, np.array([[0.9]]), 3, now - timedelta(days=3))
        questions.note(session, scene_id, np.array([[0.5]]), 3, now)
        questions.note(session, "nothing", np.array([[0.5]]), 3, now)
        retention.expire(session, now)
        assert len(questions.latest(session, scene_id)) == 2, "the project keeps everything"
        projects.get(session, "default").keep_days = 2.0
        session.flush()
        retention.expire(session, now)
        assert questions.latest(session, scene_id) == [[0.5]]
        retention.delete_scene(session, scene_id, dependents=True)
        assert session.scalar(select(func.count()).select_from(QuestionRow)) == 0
