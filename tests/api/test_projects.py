"""Two projects on one service: neither sees nor touches anything of the other, on any route that the OpenAPI document has."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import delete, exists, func, select, update
from sqlalchemy.orm import aliased

from api.access import KEYS_SECONDS
from certifier.model import Scene
from db import jobs, keys, motions, projects, regions, scenes, staging, webhooks
from db.keys import Scope
from db.models import JobRow, ProofRow, RegionRow, SceneRow
from db.session import Database
from tests.api.test_jobs import GROW
from tests.api.test_openapi import operations
from tests.db.builders import a_running_job, add_region
from tests.scenes import slider

WORKERS = {"list_workers", "get_worker", "pause_worker", "resume_worker", "drain_worker"}
ABOUT_THE_SERVICE = {"get_health", "get_readiness", "get_metrics", *WORKERS}
"""These say how the service is, in numbers, and name nothing of anybody. ``test_workers.py`` tests that of the workers."""
OF_ALL_PROJECTS = {"list_projects", "create_project", "get_any_project", "set_limits", "get_inventory"}
"""Only those who run the service may ask these; ``test_all_projects.py`` tests that nobody else learns anything by them."""
OWN = {
    "get_project",
    "list_project_events",
    "stream_project_events",
    "create_scene",
    "create_key",
    "list_keys",
    "revoke_key",
    "list_audit",
    "list_scenes",
    "list_jobs",
    "list_regions",
    "list_webhooks",
}
"""These name nothing, so they are about the caller's own project; tests of their own are below."""


@pytest.fixture
def theirs(database: Database, scene: Scene, region: str) -> dict[str, str]:
    """Ids of the default project, whose key is ``key``; ``stranger`` is an admin's key of another project."""
    with database.write() as session:
        job = regions.get(session, region).job_id
        webhooks.add(session, job, "https://example.org/", "whsec_" + "A" * 32)
        projects.add(session, "others")
        made = {name: keys.add(session, "admin", Scope.ADMIN, name) for name in ("default", "others")}
        scene_id = scenes.find(session, "slider")
        staging.stage(session, "slider", slider(posts=1))
        q, each = np.array([[0.0], [0.1]]), np.ones(1)
        arrays = {"path": q, "q": q, "t": np.array([0.0, 1.0]), "speed": each, "acceleration": each}
        motion = motions.add(session, scene_id, arrays, 0.01, b"proof of a motion", 10).id
    time.sleep(KEYS_SECONDS)
    return {
        "scene_id": scene_id,
        "job_id": job,
        "region_id": region,
        "motion_id": motion,
        "key": made["default"],
        "stranger": made["others"],
    }


def bearer(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


def naming(schema: dict[str, Any], schemas: dict[str, Any], theirs: dict[str, str], *, any_body: bool) -> list[dict[str, Any]]:
    """Returns valid bodies for a request of this schema that name the scene, and the region, of the others; or any, if its path does."""
    chosen = [schema, *schema.get("oneOf", []), *schema.get("anyOf", [])]
    bodies = []
    for one in chosen:
        described = schemas[one["$ref"].rpartition("/")[2]] if "$ref" in one else one
        for example in described.get("examples", []):
            bodies.append(renamed(example, theirs))
    return [body for body in bodies if any_body or any(one in str(body) for one in theirs.values())]


def renamed(value: Any, theirs: dict[str, str], name: str = "") -> Any:
    """Returns a body in which every scene, job and region is one of the others."""
    if isinstance(value, dict):
        return {key: renamed(part, theirs, key) for key, part in value.items()}
    if isinstance(value, list):
        return [renamed(part, theirs, name) for part in value]
    ids = {"scene": "scene_id", "jobs": "job_id", "region": "region_id"}
    return theirs[ids[name]] if name in ids and isinstance(value, str) else value


def requests(document: dict[str, Any], theirs: dict[str, str]) -> list[tuple[str, str, str, dict[str, Any]]]:
    """Returns a request or more for every operation that can name something of the others: (operation, method, path, options)."""
    found = []
    for name, (route, operation) in operations(document).items():
        if name in ABOUT_THE_SERVICE | OF_ALL_PROJECTS | OWN:
            continue
        method, path = route.split(" ", 1)
        values = {**theirs, "pair": "0", "name": "admin", "scene_name": "slider"}
        parameters = operation.get("parameters", [])
        asked = {p["name"]: "0" for p in parameters if p["in"] == "query" and p.get("required") and p["name"] != "scene"}
        asked |= {p["name"]: theirs["scene_id"] for p in parameters if p["name"] == "scene"}
        where = path.format(**values)
        content = operation.get("requestBody", {}).get("content", {})
        if content:
            bodies = naming(content["application/json"]["schema"], document["components"]["schemas"], theirs, any_body="{" in path)
            assert bodies, f"{name} has no example of a body, so nobody knows whether it keeps projects apart"
            found += [(name, method, where, {"json": body, "params": asked}) for body in bodies]
        else:
            assert "{" in path or asked, f"{name} names nothing; say above what it is about"
            found.append((name, method, where, {"params": asked}))
    return found


def test_no_operation_shows_or_changes_anything_of_another_project(client: TestClient, database: Database, theirs: dict[str, str]) -> None:
    document = client.get("/openapi.json", headers=bearer(theirs["key"])).json()
    before = everything(database)
    walked = requests(document, theirs)
    assert len({name for name, *_ in walked}) >= len(operations(document)) - len(ABOUT_THE_SERVICE | OF_ALL_PROJECTS | OWN)
    for name, method, path, options in walked:
        answer = client.request(method, path, headers=bearer(theirs["stranger"]), **options)
        assert answer.status_code == 404, f"{name} {path}: {answer.status_code} {answer.text}"
        codes = {"scene_not_found", "job_not_found", "region_not_found", "motion_not_found"}
        assert answer.json()["code"] in codes, f"{name}: {answer.text}"
        known = {value for key, value in theirs.items() if key.endswith("_id") and value not in path and value not in str(options)}
        assert not any(value in answer.text for value in known), name
    assert everything(database) == before


def everything(database: Database) -> list[tuple[object, ...]]:
    with database.read() as session:
        return [
            tuple(row) for model in (SceneRow, JobRow, RegionRow) for row in session.execute(select(model.__table__.c["id", "project"]))
        ]


def test_the_walk_would_find_what_is_shown(client: TestClient, theirs: dict[str, str]) -> None:
    """The same requests with the project's own key find the scene, the job and the region."""
    document = client.get("/openapi.json", headers=bearer(theirs["key"])).json()
    codes = {"scene_not_found", "job_not_found", "region_not_found"}
    order = sorted(requests(document, theirs), key=lambda request: request[1] == "DELETE")
    for name, method, path, options in order:
        if name == "stream_job_events":
            continue
        answer = client.request(method, path, headers=bearer(theirs["key"]), **options)
        if answer.headers["content-type"] == "application/problem+json":
            assert answer.json()["code"] not in codes, f"{name}: {answer.text}"


def test_lists_and_pages_are_empty_for_the_others(client: TestClient, theirs: dict[str, str]) -> None:
    ids = [theirs[name] for name in ("scene_id", "job_id", "region_id")]
    for path in ("/v1/scenes", "/v1/jobs", "/v1/regions", "/v1/webhooks", "/", "/scenes", "/regions", "/live"):
        mine, other = (client.get(path, headers=bearer(theirs[who])) for who in ("key", "stranger"))
        assert mine.status_code == other.status_code == 200
        assert any(one in mine.text for one in ids), path
        assert not any(one in other.text or one[:8] in other.text for one in ids), path
        assert "slider" not in other.text, path
    pages = [f"/jobs/{theirs['job_id']}", f"/regions/{theirs['region_id']}", f"/scenes/{theirs['scene_id']}", "/scenes/slider"]
    pages += [f"/compare/{kind}s?a={theirs[f'{kind}_id']}&b={theirs[f'{kind}_id']}" for kind in ("job", "scene")]
    for path in pages:
        assert client.get(path, headers=bearer(theirs["key"])).status_code == 200
        answer = client.get(path, headers=bearer(theirs["stranger"]) | {"Accept": "text/html"})
        assert answer.status_code == 404, path


def test_first_characters_and_names_find_nothing_of_the_others(client: TestClient, theirs: dict[str, str]) -> None:
    for path in (f"jobs/{theirs['job_id'][:8]}", f"regions/{theirs['region_id'][:8]}", f"scenes/{theirs['scene_id'][:8]}", "scenes/slider"):
        assert client.get(f"/v1/{path}", headers=bearer(theirs["key"])).status_code == 200
        answer = client.get(f"/v1/{path}", headers=bearer(theirs["stranger"]))
        assert answer.status_code == 404
        assert "slider" not in answer.json()["hint"], "names of others are not suggested"


def test_the_same_scene_in_two_projects_is_two_scenes(client: TestClient, database: Database, theirs: dict[str, str]) -> None:
    """Regions of one do not serve the other, and a name that both use means each one's own."""
    view = database.of("others")
    with view.write() as session:
        mine = scenes.add(session, slider(posts=2)).id
        again = scenes.add(session, slider(posts=2)).id
    assert mine == again != theirs["scene_id"]
    with view.write() as session:
        other = scenes.add(session, slider(posts=1)).id
    question = {"scene": "slider", "q": [[0.0]]}
    answers = {who: client.post("/v1/planning/contains", json=question, headers=bearer(theirs[who])).json() for who in ("key", "stranger")}
    assert (answers["key"]["scene"], answers["key"]["regions"]) == (theirs["scene_id"], 1)
    assert (answers["stranger"]["scene"], answers["stranger"]["regions"]) == (other, 0)
    answer = client.post("/v1/jobs", json=GROW | {"scene": mine}, headers=bearer(theirs["stranger"]))
    assert answer.status_code == 201
    assert client.get(f"/v1/jobs/{answer.json()['id']}", headers=bearer(theirs["key"])).status_code == 404


def test_a_region_of_another_project_cannot_be_recertified(client: TestClient, database: Database, theirs: dict[str, str]) -> None:
    with database.of("others").write() as session:
        mine = scenes.add(session, slider(posts=1)).id
    body = {"kind": "recertify", "scene": mine, "region": theirs["region_id"]}
    answer = client.post("/v1/jobs", json=body, headers=bearer(theirs["stranger"]))
    assert (answer.status_code, answer.json()["code"]) == (404, "region_not_found")


def test_deleting_a_region_leaves_the_proof_that_another_project_has(db: Database) -> None:
    """On both databases: the proof is looked for among the regions of every project."""
    with db.write() as session:
        projects.add(session, "others")
    made = {}
    for name in ("default", "others"):
        with db.of(name).write() as session:
            made[name] = add_region(session, a_running_job(session), proof=b"the same").id
    for name, left in (("default", True), ("others", False)):
        with db.of(name).write() as session:
            digest = regions.get(session, made[name]).proof_digest
            regions.delete(session, made[name])
        with db.read() as session:
            assert (session.get(ProofRow, digest) is not None) == left


def test_a_session_of_a_project_finds_nothing_else_in_any_way(db: Database) -> None:
    """By id, by column, in a join, in a subquery, with a lock, and in changes."""
    with db.write() as session:
        projects.add(session, "others")
    with db.of("default").write() as session:
        job = a_running_job(session)
        region = add_region(session, job)
        ids = {SceneRow: job.scene_id, JobRow: job.id, RegionRow: region.id}
    with db.of("others").write() as session:
        for model, row_id in ids.items():
            assert session.get(model, row_id) is None
            assert session.get(model, row_id, with_for_update=True, populate_existing=True) is None
            assert session.scalars(select(model.id)).all() == []
            assert session.scalar(select(func.count()).select_from(model)) == 0
            other = aliased(model)
            assert session.scalars(select(other.id)).all() == []
            assert session.scalar(select(exists().where(model.id == row_id))) is False
            assert session.scalar(select(func.count()).select_from(select(model.id).subquery())) == 0
            assert session.execute(update(model).values(project="others")).rowcount == 0  # type: ignore[attr-defined]
        assert session.execute(delete(RegionRow)).rowcount == 0  # type: ignore[attr-defined]
        joined = select(JobRow.id).join(SceneRow, SceneRow.id == JobRow.scene_id)
        assert session.scalars(joined).all() == []
    with db.of("default").read() as session:
        assert all(session.get(model, row_id) is not None for model, row_id in ids.items())


def test_a_job_is_of_its_scenes_project(db: Database) -> None:
    with db.write() as session:
        projects.add(session, "others")
    with db.of("others").write() as session:
        job = a_running_job(session)
        region = add_region(session, job)
    assert job.project == region.project == "others"
    with db.write() as session:  # as a worker, which sees everything, does for a region of a cover
        child, _ = jobs.create(session, kind="grow", scene_id=job.scene_id, options={}, parent_id=job.id, number=1)
        assert child.project == "others"


def test_keys_are_managed_within_the_project(client: TestClient, theirs: dict[str, str]) -> None:
    stranger, own = bearer(theirs["stranger"]), bearer(theirs["key"])
    made = client.post("/v1/keys", json={"name": "planner", "scope": "read"}, headers=stranger)
    assert made.status_code == 201
    time.sleep(KEYS_SECONDS)
    planner = bearer(made.json()["key"])
    assert client.get("/v1/jobs", headers=planner).json()["jobs"] == []
    assert client.get("/v1/keys", headers=planner).status_code == 403
    names = {
        who: [key["name"] for key in client.get("/v1/keys", headers=bearer(theirs[who])).json()["keys"]] for who in ("key", "stranger")
    }
    assert names == {"key": ["admin"], "stranger": ["planner", "admin"]}
    assert client.delete("/v1/keys/planner", headers=own).status_code == 404
    assert client.delete("/v1/keys/planner", headers=stranger).status_code == 204
    time.sleep(KEYS_SECONDS)
    assert client.get("/v1/jobs", headers=planner).status_code == 401
    lines = client.get("/v1/audit", headers=stranger).json()["lines"]
    assert [(line["action"], line["what"]) for line in lines] == [("key_revoked", "planner"), ("key_made", "planner (read)")]
    assert all(line["who"].startswith("admin (") for line in lines)
    assert client.get("/v1/audit", headers=own).json()["lines"] == []
    assert made.json()["key"] not in client.get("/v1/audit", headers=stranger).text + client.get("/v1/keys", headers=stranger).text


def test_the_first_key_is_not_made_over_http(client: TestClient) -> None:
    answer = client.post("/v1/keys", json={"name": "mine", "scope": "admin"})
    assert (answer.status_code, answer.json()["code"]) == (409, "first_key")
    assert client.get("/v1/keys").json() == {"keys": [], "next": None}


def test_lists_of_keys_come_in_pages(client: TestClient, theirs: dict[str, str]) -> None:
    own = bearer(theirs["key"])
    for i in range(4):
        client.post("/v1/keys", json={"name": f"k{i}", "scope": "read"}, headers=own)
    seen: list[str] = []
    after: str | None = None
    for _ in itertools.count():
        page = client.get("/v1/keys", headers=own, params={"limit": 2, **({"after": after} if after else {})}).json()
        seen += [key["name"] for key in page["keys"]]
        after = page["next"]
        if after is None:
            break
    assert seen == ["k3", "k2", "k1", "k0", "admin"]
