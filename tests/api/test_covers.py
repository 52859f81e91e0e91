"""Covers over HTTP: what is asked for, what is refused, and what is told of them and of the jobs that grow their regions."""

from __future__ import annotations

from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier import stored
from certifier.model import Scene
from db import jobs, scenes
from db.models import JobRow
from db.session import Database
from db.settings import settings
from planner.cover.machine import advance, begin
from planner.cover.options import CoverOptions
from planner.cover.state import Scouted
from tests.certifier.scenes import planar_arm

COVER = {"kind": "cover", "scene": "slider"}


def asked(client: TestClient, **options: Any) -> dict[str, Any]:
    answer = client.post("/v1/jobs", json=COVER | {"options": options})
    assert answer.status_code == 201, answer.json()
    job: dict[str, Any] = answer.json()
    return job


def with_child(database: Database, cover_id: str) -> JobRow:
    with database.write() as session:
        cover = jobs.lock(session, cover_id)
        child, _ = jobs.create(session, kind="grow", scene_id=cover.scene_id, options={"kind": "grow"}, parent_id=cover.id, number=0)
    return child


def test_a_cover_is_a_job_with_options_of_its_own(client: TestClient, scene: Scene) -> None:
    job = asked(client, seeds=[[0.1]], connect=[[0.0], [-0.2]], paths=[[[0.0], [0.1]]], coverage=0.9, connected=True, regions=7)
    options = CoverOptions.from_document(job["options"])
    assert (options.seeds, options.connect, options.paths) == (((0.1,),), ((0.0,), (-0.2,)), (((0.0,), (0.1,)),))
    assert (options.coverage, options.connected, options.regions, options.stages) == (0.9, True, 7, None)
    assert (job["kind"], job["state"], job["parent"]) == ("cover", "queued", None)


@pytest.mark.parametrize(("links", "stages"), [(4, None), (5, 1)])
def test_the_regions_of_robots_with_many_joints_end_with_their_first_stage(
    client: TestClient, database: Database, links: int, stages: int | None
) -> None:
    with database.write() as session:
        body = COVER | {"scene": scenes.add(session, planar_arm(links)).id}
    assert client.post("/v1/jobs", json=body).json()["options"]["stages"] == stages
    assert client.post("/v1/jobs", json=body | {"options": {"stages": 3}}).json()["options"]["stages"] == 3


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"connect": [[0.0], [0.1, 0.2]]}, "options.connect[1]"),
        ({"seeds": [[5.0]]}, "options.seeds[0][0]"),
        ({"paths": [[[0.0], [5.0]]]}, "options.paths[0][1][0]"),
        ({"paths": [[[0.0]]]}, "options.paths[0]"),
        ({"connect": [[0.0]]}, "options.connect"),
        ({"coverage": 0}, "options.coverage"),
        ({"coverage": 1.2}, "options.coverage"),
        ({"regions": 0}, "options.regions"),
        ({"at_once": 1000}, "options.at_once"),
        ({"region_seconds": 0}, "options.region_seconds"),
        ({"colour": 1}, "options.colour"),
        ({"seeds": [["x"]]}, "options.seeds[0][0]"),
    ],
)
def test_what_makes_no_sense_is_refused(client: TestClient, scene: Scene, options: dict[str, Any], field: str) -> None:
    answer = client.post("/v1/jobs", json=COVER | {"options": options})
    assert (answer.status_code, answer.json()["field"]) == (422, field)


def test_the_jobs_of_its_regions_are_listed_apart_and_name_it(client: TestClient, scene: Scene, database: Database) -> None:
    cover = asked(client)
    child = with_child(database, cover["id"])
    assert [job["id"] for job in client.get("/v1/jobs").json()["jobs"]] == [cover["id"]]
    (listed,) = client.get("/v1/jobs", params={"parent": cover["id"]}).json()["jobs"]
    assert (listed["id"], listed["parent"]) == (child.id, cover["id"])
    assert client.get("/v1/jobs", params={"parent": "nothing"}).status_code == 404


def test_what_it_has_come_to_is_told(client: TestClient, scene: Scene, database: Database) -> None:
    cover = asked(client, connect=[[0.0], [-0.2]])
    before = client.get(f"/v1/jobs/{cover['id']}/cover").json()
    assert (before["coverage"], before["regions"], before["grown"], before["missing"], before["curve"]) == (None, [], [], None, [])
    child = with_child(database, cover["id"])
    seen = Scouted(version=3, regions=3, samples=100, covered=40, components=(2, 1), largest=30, connect=(0, 1), obstacles=("no way",))
    with database.write() as session:
        job = jobs.lock(session, cover["id"])
        jobs.keep_growth(session, job, stored.document(advance(begin(CoverOptions.from_document(job.options)).state, seen).state))
    found = client.get(f"/v1/jobs/{cover['id']}/cover").json()
    assert found["coverage"] == {"value": 0.4, "stderr": pytest.approx(0.049, abs=1e-3), "samples": 100}
    assert (found["components"], found["largest"], found["connected"], found["connect"]) == ([2, 1], 0.75, False, [0, 1])
    assert found["missing"] == ["the configurations to connect are in 2 components"]
    assert found["obstacles"] == ["no way"]
    (obstacle,) = client.get(f"/v1/jobs/{cover['id']}/obstacles").json()["obstacles"]
    assert (obstacle["pair"], obstacle["text"]) == (None, "no way")
    assert [(grown["job"], grown["number"], grown["region"]) for grown in found["grown"]] == [(child.id, 0, None)]


def test_other_jobs_are_no_covers(client: TestClient, scene: Scene) -> None:
    job = client.post("/v1/jobs", json={"kind": "grow", "scene": "slider", "seed": {"q": [0.0]}}).json()
    answer = client.get(f"/v1/jobs/{job['id']}/cover")
    assert (answer.status_code, answer.json()["code"]) == (404, "cover_not_found")


def test_its_page_shows_its_regions_and_theirs_shows_it(client: TestClient, scene: Scene, database: Database) -> None:
    cover = asked(client)
    child = with_child(database, cover["id"])
    page, of_child, home = (client.get(path).text for path in (f"/jobs/{cover['id']}", f"/jobs/{child.id}", "/"))
    assert f"/jobs/{child.id}" in page
    assert "Regions of this cover" in page
    assert f"/jobs/{cover['id']}" in of_child
    assert cover["id"] in home
    assert child.id not in home


def test_its_regions_do_not_count_for_the_quota(
    client: TestClient, scene: Scene, database: Database, environment: pytest.MonkeyPatch
) -> None:
    environment.setenv("CIRIS_MAX_JOBS_PER_KEY", "2")
    settings.cache_clear()
    cover = asked(client)
    with_child(database, cover["id"])
    asked(client)
    assert client.post("/v1/jobs", json=COVER).json()["code"] == "quota_exceeded"
