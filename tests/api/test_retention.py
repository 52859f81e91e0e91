"""Scenes, jobs and regions are deleted over HTTP, by admins, who are told first what goes with them."""

from __future__ import annotations

from datetime import timedelta

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from db import projects, regions, retention
from db.session import Database
from db.types import utcnow
from tests.api.test_jobs import GROW
from tests.api.test_openapi import operations


def test_a_scene_is_deleted_with_what_depends_on_it(client: TestClient, database: Database, region: str) -> None:
    scene_id = client.get("/v1/scenes/slider").json()["id"]
    told = client.get("/v1/scenes/slider/dependents").json()
    assert (told["jobs"], told["unfinished"], told["regions"]) == (1, 0, 1)
    assert told["bytes"] > 100
    assert client.post("/v1/planning/contains", json={"scene": "slider", "q": [[0.0]]}).json()["points"][0]["inside"]
    refused = client.delete(f"/v1/scenes/{scene_id}")
    assert (refused.status_code, refused.json()["code"]) == (409, "has_dependents")
    assert "1 job, 1 region" in refused.json()["detail"]
    assert client.delete(f"/v1/scenes/{scene_id}", params={"dependents": "delete"}).status_code == 204
    for path in ("scenes/slider", f"scenes/{scene_id}", f"regions/{region}"):
        assert client.get(f"/v1/{path}").status_code == 404
    assert client.get("/v1/jobs").json()["jobs"] == []
    assert client.post("/v1/planning/contains", json={"scene": "slider", "q": [[0.0]]}).status_code == 404
    (line,) = client.get("/v1/audit").json()["lines"]
    assert (line["action"], line["what"], line["who"]) == ("scene_deleted", scene_id, "anybody")


def test_the_regions_of_a_deleted_job_are_asked_about_no_more(client: TestClient, region: str) -> None:
    question = {"scene": "slider", "q": [[0.0]]}
    job = client.get(f"/v1/regions/{region}").json()["job"]
    assert client.post("/v1/planning/contains", json=question).json()["regions"] == 1
    assert client.get(f"/v1/jobs/{job}/dependents").json()["regions"] == 1
    assert client.delete(f"/v1/jobs/{job}", params={"dependents": "delete"}).status_code == 204
    answer = client.post("/v1/planning/contains", json=question).json()
    assert (answer["regions"], answer["points"][0]["inside"]) == (0, False)


def test_every_view_of_a_job_that_has_expired_answers(client: TestClient, database: Database, region: str) -> None:
    with database.write() as session:
        job = regions.get(session, region).job_id
        projects.get(session, "default").keep_days = 1.0
        assert retention.expire(session, utcnow() + timedelta(days=2)) == 1
    document = client.get("/openapi.json").json()
    for name, (route, _) in operations(document).items():
        method, path = route.split(" ", 1)
        if method == "GET" and "{job_id}" in path and name != "stream_job_events":
            named = {parameter["name"] for parameter in document["paths"][path]["get"].get("parameters", [])}
            answer = client.get(path.format(job_id=job, pair=0), params={"iteration": 0} if "iteration" in named else {})
            assert answer.status_code in (200, 404), f"{name}: {answer.status_code} {answer.text}"
    for path in (f"/jobs/{job}", f"/jobs/{job}/live", f"/regions/{region}", "/", "/scenes/slider"):
        assert client.get(path).status_code == 200, path
    assert client.post(f"/v1/regions/{region}/verify").json()["holds"]


def test_a_project_without_room_takes_nothing_more_but_shows_and_deletes(
    client: TestClient, database: Database, scene: Scene, region: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("COUNT_SECONDS", "COST"):
        monkeypatch.setattr(f"api.room.{name}", 0.0)
    stopped = client.post("/v1/jobs", json=GROW).json()["id"]
    client.post(f"/v1/jobs/{stopped}/cancel")
    size = client.get("/v1/project").json()["bytes"]
    with database.write() as session:
        projects.get(session, "default").max_bytes = size
    refused = client.post("/v1/jobs", json=GROW)
    assert (refused.status_code, refused.json()["code"]) == (403, "storage_quota")
    upload = client.post("/v1/scenes", files={"bundle": ("scene.zip", b"anything", "application/zip")})
    assert (upload.status_code, upload.json()["code"]) == (403, "storage_quota")
    again = client.post(f"/v1/jobs/{stopped}/retry")
    assert (again.status_code, again.json()["code"]) == (403, "storage_quota")
    assert client.get("/v1/regions").json()["regions"][0]["id"] == region
    assert client.delete(f"/v1/regions/{region}").status_code == 204
    assert client.post(f"/v1/jobs/{stopped}/retry").status_code == 201
    assert client.post("/v1/jobs", json=GROW).status_code == 201
    assert client.get("/v1/project").json() == {
        "name": "default",
        "scope": "admin",
        "bytes": client.get("/v1/project").json()["bytes"],
        "max_bytes": size,
        "keep_days": None,
        "solver_seconds": 0.2,
        "max_solver_seconds": None,
        "month_ends_at": client.get("/v1/project").json()["month_ends_at"],
        "created_at": client.get("/v1/project").json()["created_at"],
    }
    assert client.get("/v1/project").json()["bytes"] < size
