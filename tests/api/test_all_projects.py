"""Those who run the service manage projects over HTTP, and nobody else learns anything of them."""

from __future__ import annotations

import time
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import func, select

from api.access import KEYS_SECONDS
from certifier.model import Scene
from db import jobs, keys, projects, solver_time, workers
from db.keys import Scope
from db.models import ApiKeyRow, AuditRow, ProjectRow
from db.projects import MOST_BYTES, MOST_DAYS, MOST_SECONDS
from db.session import Database
from db.states import WorkerState
from db.workers import Made, WorkerKind
from tests.api.test_jobs import GROW
from tests.workers.service import eventually

Headers = dict[str, str]


@pytest.fixture
def made(database: Database, client: TestClient) -> dict[str, Headers]:
    """The headers of a key that runs the service, and of others that do not. There is a project ``others``."""
    wanted = (("boss", Scope.ADMIN, "default"), ("submitter", Scope.SUBMIT, "default"), ("stranger", Scope.ADMIN, "others"))
    with database.write() as session:
        projects.add(session, "others")
        found = {name: keys.add(session, name, scope, project) for name, scope, project in wanted}
    time.sleep(KEYS_SECONDS)
    return {name: {"Authorization": f"Bearer {key}"} for name, key in found.items()}


def lines(client: TestClient, headers: Headers) -> list[tuple[str, str]]:
    return [(line["action"], line["what"]) for line in client.get("/v1/audit", headers=headers).json()["lines"]]


def test_a_new_team_begins_without_anybody_at_the_services_machine(client: TestClient, made: dict[str, Headers]) -> None:
    boss = made["boss"]
    answer = client.post("/v1/projects", json={"name": "welding"}, headers=boss)
    assert answer.status_code == 201
    assert (answer.json()["name"], answer.json()["bytes"], answer.json()["max_bytes"]) == ("welding", 0, None)
    key = client.post("/v1/keys", json={"name": "alice", "scope": "admin", "project": "welding"}, headers=boss)
    assert key.status_code == 201
    alice = {"Authorization": f"Bearer {key.json()['key']}"}
    assert client.get("/v1/project", headers=alice).json()["name"] == "welding"
    assert client.post("/v1/keys", json={"name": "robot", "scope": "submit", "project": "welding"}, headers=alice).status_code == 201
    names = [one["name"] for one in client.get("/v1/projects", headers=boss).json()["projects"]]
    assert names == ["default", "others", "welding"]
    ours = [("key_made", "robot (submit)"), ("key_made", "alice (admin)"), ("project_made", "welding")]
    assert lines(client, alice) == ours
    assert lines(client, boss) == [("key_made", "welding: alice (admin)"), ("project_made", "welding")], "what they did elsewhere"
    assert lines(client, made["stranger"]) == []


def test_limits_hold_at_once_and_are_noted_with_the_values_before_and_after(
    client: TestClient, scene: Scene, database: Database, made: dict[str, Headers]
) -> None:
    boss = made["boss"]
    with database.write() as session:
        solver_time.add(session, "default", 60.0)
    assert client.post("/v1/jobs", json=GROW, headers=boss).status_code == 201
    for limits, code in (({"max_bytes": 1}, "storage_quota"), ({"max_bytes": None, "max_solver_seconds": 60}, "time_quota")):
        answer = client.patch("/v1/projects/default", json=limits, headers=boss)
        assert answer.status_code == 200
        assert {name: answer.json()[name] for name in limits} == limits
        refused = client.post("/v1/jobs", json=GROW, headers=boss)
        assert (refused.status_code, refused.json()["code"]) == (403, code)
    assert client.patch("/v1/projects/default", json={"max_solver_seconds": 0, "keep_days": 30}, headers=boss).status_code == 200
    assert client.patch("/v1/projects/default", json={"keep_days": 30}, headers=boss).status_code == 200, "which changes nothing"
    assert client.patch("/v1/projects/default", json={}, headers=boss).status_code == 200
    assert client.post("/v1/jobs", json=GROW, headers=boss).status_code == 201
    assert lines(client, boss) == [
        ("limits_set", "keep_days none -> 30, max_solver_seconds 60 -> none"),
        ("limits_set", "max_bytes 1 -> none, max_solver_seconds none -> 60"),
        ("limits_set", "max_bytes none -> 1"),
    ]
    assert client.patch("/v1/projects/others", json={"keep_days": 7}, headers=boss).status_code == 200
    assert lines(client, made["stranger"]) == [("limits_set", "keep_days none -> 7")]
    assert lines(client, boss)[0] == ("limits_set", "others: keep_days none -> 7")


def test_nobody_else_learns_whether_a_project_exists(client: TestClient, database: Database, made: dict[str, Headers]) -> None:
    """For every route and every key that does not run the service, a project that exists and one that does not look the same."""

    def rows() -> list[Any]:
        with database.read() as session:
            counts = [session.scalar(select(func.count()).select_from(model)) for model in (ProjectRow, AuditRow, ApiKeyRow)]
            return [*counts, *(projects.limits(row) for row in projects.all_of(session))]

    before = rows()
    for who, code in (("stranger", "other_projects"), ("submitter", "scope_missing")):
        said = []
        for name in ("default", "others", "nobody"):
            asked: list[tuple[str, str, Any]] = [
                ("GET", "/v1/projects", None),
                ("GET", f"/v1/projects?after={name}", None),
                ("POST", "/v1/projects", {"name": name}),
                ("GET", f"/v1/projects/{name}", None),
                ("PATCH", f"/v1/projects/{name}", {"keep_days": 1}),
                ("PATCH", f"/v1/projects/{name}", {"keep_days": -1}),
                ("GET", f"/v1/inventory?after={name}", None),
                ("GET", f"/inventory?after={name}", None),
                ("GET", f"/inventory/live?after={name}", None),
            ]
            if name != "others":  # which is the stranger's own
                asked.append(("POST", "/v1/keys", {"name": "mine", "scope": "read", "project": name}))
            answers = [client.request(method, path, json=body, headers=made[who]) for method, path, body in asked]
            assert {(answer.status_code, answer.json()["code"]) for answer in answers} == {(403, code)}, name
            said.append({answer.text for answer in answers})
        assert said[0] == said[1] == said[2], "the answers do not tell which projects there are"
    assert rows() == before
    assert "inventory" not in client.get("/project", headers=made["stranger"]).text


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "code", "field", "said"),
    [
        ("POST", "", {"name": ""}, 422, "invalid_request", "name", "a name has up to 64 letters"),
        ("POST", "", {"name": "a b"}, 422, "invalid_request", "name", "a name has up to 64 letters"),
        ("POST", "", {"name": "x" * 65}, 422, "invalid_request", "name", "a name has up to 64 letters"),
        ("POST", "", {}, 422, "invalid_request", "name", "field required"),
        ("POST", "", {"name": "others"}, 422, "project_name", "name", "there is a project 'others' already"),
        ("GET", "/nobody", None, 404, "project_not_found", "project", "there is no project 'nobody'"),
        ("PATCH", "/nobody", {"keep_days": 1}, 404, "project_not_found", "project", "there is no project 'nobody'"),
        ("PATCH", "/others", {"max_bytes": MOST_BYTES + 1}, 422, "invalid_request", "max_bytes", str(MOST_BYTES)),
        ("PATCH", "/others", {"max_bytes": 1e19}, 422, "invalid_request", "max_bytes", f"less than or equal to {MOST_BYTES}"),
        ("PATCH", "/others", {"max_bytes": 10**400}, 422, "invalid_request", "max_bytes", str(MOST_BYTES)),
        ("PATCH", "/others", {"max_bytes": -1}, 422, "invalid_request", "max_bytes", "greater than or equal to 0"),
        ("PATCH", "/others", {"max_bytes": 0.5}, 422, "invalid_request", "max_bytes", "valid integer"),
        ("PATCH", "/others", {"max_bytes": "5"}, 422, "invalid_request", "max_bytes", "integer"),
        ("PATCH", "/others", {"keep_days": MOST_DAYS + 1}, 422, "invalid_request", "keep_days", str(MOST_DAYS)),
        ("PATCH", "/others", {"max_solver_seconds": 2 * MOST_SECONDS}, 422, "invalid_request", "max_solver_seconds", "less than"),
        ("PATCH", "/others", {"days": 3}, 422, "invalid_request", "days", "there is no such field"),
    ],
)
def test_what_is_wrong_is_said(
    client: TestClient, made: dict[str, Headers], method: str, path: str, body: Any, status: int, code: str, field: str, said: str
) -> None:
    answer = client.request(method, f"/v1/projects{path}", json=body, headers=made["boss"])
    problem = answer.json()
    assert (answer.status_code, problem["code"], problem["field"]) == (status, code, field)
    assert said in problem["detail"]
    assert problem["hint"]
    assert lines(client, made["boss"]) == []


def test_a_key_of_no_project_is_refused(client: TestClient, made: dict[str, Headers]) -> None:
    answer = client.post("/v1/keys", json={"name": "alice", "scope": "admin", "project": "nobody"}, headers=made["boss"])
    assert (answer.status_code, answer.json()["code"], answer.json()["field"]) == (404, "project_not_found", "project")


def test_projects_come_in_pages(client: TestClient, database: Database, made: dict[str, Headers]) -> None:
    with database.write() as session:
        for i in range(3):
            projects.add(session, f"p{i}")
    for path in ("/v1/projects", "/v1/inventory"):
        seen: list[str] = []
        after: str | None = None
        while True:
            page = client.get(path, headers=made["boss"], params={"limit": 2, **({"after": after} if after else {})}).json()
            seen += [project["name"] for project in page["projects"]]
            after = page["next"]
            if after is None:
                break
        assert seen == ["default", "others", "p0", "p1", "p2"], path
    answer = client.get("/v1/inventory", params={"after": "nobody"}, headers=made["boss"])
    assert (answer.status_code, answer.json()["code"], answer.json()["field"]) == (422, "cursor", "after")


def test_the_inventory_says_what_projects_have_and_who_works(
    client: TestClient, database: Database, region: str, made: dict[str, Headers]
) -> None:
    with database.write() as session:
        solver_time.add(session, "others", 60.0)
        workers.tell(session, Made("host:1:1", WorkerKind.SOLVE, "1.2", 4, 8, 2**34), WorkerState.RUNNING)
        workers.tell(session, Made("host:2:1", WorkerKind.SOLVE, "1.2", 2, 8, 2**34), WorkerState.RUNNING)
        workers.tell(session, Made("host:3:1", WorkerKind.CONTROL, "1.1", 1, 8, 2**34), WorkerState.PAUSED)
    for _ in range(3):
        job = client.post("/v1/jobs", json=GROW, headers=made["boss"]).json()["id"]
    with database.write() as session:
        jobs.claimed(jobs.get(session, job))
    keyed = client.get("/v1/projects/default", headers=made["boss"]).json()
    found: dict[str, Any] = {}

    def counted() -> bool:
        found.update(client.get("/v1/inventory", headers=made["boss"]).json())
        return found["counted_at"] is not None

    eventually(counted, "a busy machine has counted", 60)
    default, others = found["projects"]
    assert {name: default["has"][name] for name in ("scenes", "regions", "maps", "keys")} == {
        "scenes": 1,
        "regions": 1,
        "maps": 0,
        "keys": 2,
    }
    assert default["has"]["bytes"] == keyed["bytes"] > 0
    assert (default["has"]["jobs_running"], default["has"]["jobs_waiting"]) == (1, 2)
    assert default["has"]["key_used_at"] is not None
    assert (others["has"]["keys"], others["has"]["key_used_at"], others["has"]["bytes"], others["solver_seconds"]) == (1, None, 0, 60.0)
    crew = [(one["kind"], one["version"], one["state"], one["workers"], one["processes"]) for one in found["workers"]]
    assert crew == [("control", "1.1", "paused", 1, 1), ("solve", "1.2", "running", 2, 6)]
    assert set(found["messages"]) == {"control", "solve"}
    for sort, first in (("name", "default"), ("solver_seconds", "others"), ("bytes", "default"), ("keys", "default"), ("jobs", "default")):
        answer = client.get("/v1/inventory", params={"sort": sort, "limit": 1}, headers=made["boss"]).json()
        assert [project["name"] for project in answer["projects"]] == [first], sort
    assert client.get("/v1/inventory", params={"sort": "age"}, headers=made["boss"]).status_code == 422
