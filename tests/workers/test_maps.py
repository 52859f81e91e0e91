"""Maps that jobs grow: asked for over HTTP, worked on by real worker processes, on both databases, any of which may die."""

from __future__ import annotations

import os
import signal
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import func, select, update

from api.app import create_app
from certifier.jobs.map import grow_map
from certifier.model import WORLD, Scene
from certifier.pair.collisions import in_collision
from certifier.proof.map import MapProof
from certifier.verify.file import verify_file
from ciris.free_set import FreeSet
from db import jobs, projects, scenes
from db.models import JobRow, MapPieceRow, StepRow
from db.session import database
from tests.certifier.scenes import box, planar_arm
from tests.workers import service as workers_service
from tests.workers.service import Service, ended, events_of, eventually, job_of
from workers.app import send_coordinate

pytestmark = [pytest.mark.usefixtures("service"), pytest.mark.lengthy]

FREE, HIT = [0.2, -0.4], [0.0, 1.5]
COVERAGE = 0.84
"""Of the arm: rounds with several pieces, in some seconds."""


asked = partial(workers_service.asked, kind="map", former="none")


@pytest.fixture
def client(service: Service) -> Iterator[TestClient]:
    with TestClient(create_app(), base_url="http://127.0.0.1:8643") as client:
        yield client


@pytest.fixture(scope="module")
def local(arm: tuple[Scene, np.ndarray]) -> bytes:
    return grow_map(arm[0], COVERAGE).proof.to_bytes()


def found(client: TestClient, job_id: str) -> dict[str, Any]:
    answer = client.get(f"/v1/jobs/{job_id}/map")
    assert answer.status_code == 200, answer.json()
    told: dict[str, Any] = answer.json()
    return told


def proof_of(client: TestClient, job_id: str) -> bytes:
    answer = client.get(f"/v1/jobs/{job_id}/map/proof")
    assert answer.status_code == 200, answer.json()
    return answer.content


def held(job_id: str, kind: str, besides: str | None = None) -> StepRow | None:
    with database().read() as session:
        mine = (StepRow.job_id == job_id, StepRow.kind == kind, StepRow.state == "running", StepRow.worker != (besides or ""))
        return session.scalar(select(StepRow).where(*mine).order_by(StepRow.id.desc()).limit(1))


def rounds(job_id: str) -> int:
    with database().read() as session:
        last = session.scalar(select(func.max(MapPieceRow.round)).where(MapPieceRow.job_id == job_id))
        return 0 if last is None else last + 1


def kill(row: StepRow) -> None:
    os.kill(int((row.worker or "").rsplit(":", 2)[1]), signal.SIGKILL)


def assert_nothing_is_left(job_id: str) -> None:
    """What was only for the growth is gone."""
    with database().read() as session:
        assert session.scalar(select(func.count()).select_from(MapPieceRow).where(MapPieceRow.job_id == job_id)) == 0
        kinds = Counter(session.scalars(select(StepRow.kind).where(StepRow.job_id == job_id)))
    assert "piece" not in kinds
    assert kinds["accept"] == 1


def stored_after(client: TestClient, job: JobRow) -> dict[str, Any]:
    """What is stored of the map of a job that was ended early, after checking its proof."""
    told = found(client, job.id)
    assert told["stored"]["cells"] > 0
    assert verify_file(proof_of(client, job.id)).kind == "map"
    assert_nothing_is_left(job.id)
    return told


def test_a_map_is_that_of_a_plain_call_and_its_free_set_is_free(client: TestClient, planar: Scene) -> None:
    ways = [[FREE, HIT]]
    job = ended(asked(client, planar, options={"coverage": 0.95, "at": [FREE, HIT], "paths": ways}))
    assert (job.state, job.outcome, job.error) == ("succeeded", "certified", None), job.error
    told = found(client, job.id)
    expected = grow_map(planar, 0.95, at=planar.to_s(np.array([FREE, HIT])), ways=np.array(ways))
    assert proof_of(client, job.id) == expected.proof.to_bytes()
    assert (told["coverage"]["value"], told["cells"], told["stored"]["cells"]) == (expected.coverage.share, expected.cells, expected.cells)
    assert [one["state"] for one in told["stored"]["at"]] == ["proved", "in_collision"] == expected.wanted
    assert told["curve"][-1][1] == expected.coverage.share
    free = FreeSet.of_bytes(client.get(f"/v1/jobs/{job.id}/map/free-set").content, "the free set")
    assert free.scene == planar.hash
    assert told["stored"]["paths"] == [free.share_of(ways[0])]
    assert 0 < free.share_of(ways[0]) < 1
    q = np.random.default_rng(3).uniform(planar.q_lower, planar.q_upper, size=(20_000, planar.n))
    collides, proved = in_collision(planar, planar.to_s(q)), free.contains(q)
    assert not (collides & proved).any()
    assert proved[~collides].mean() > 0.93
    told_of = [(event.data["kind"], event.data["state"]) for event in events_of(job.id) if event.kind == "step"]
    assert told_of == [("map", "open"), ("map", "done"), ("accept", "open"), ("accept", "done")]
    assert_nothing_is_left(job.id)


def test_questions_are_answered_by_the_latest_map(client: TestClient, planar: Scene) -> None:
    scene = replace(planar, padding=planar.padding + 1e-6)  # a scene of its own, without a map
    job_id = asked(client, scene, options={"coverage": 0.95})

    def ask(question: str, **body: Any) -> dict[str, Any]:
        answer = client.post(f"/v1/planning/{question}", json={"scene": scene_id, **body})
        assert answer.status_code == 200, answer.json()
        told: dict[str, Any] = answer.json()
        return told

    scene_id = job_of(job_id).scene_id
    before = ask("contains", q=[FREE])
    assert (before["map"], before["points"][0]["map"], before["points"][0]["inside"]) == (None, None, False)
    assert ended(job_id).outcome == "certified"
    rng = np.random.default_rng(5)
    q = rng.uniform(scene.q_lower, scene.q_upper, size=(500, scene.n))
    after, collides = ask("contains", q=q.tolist()), in_collision(scene, scene.to_s(q))
    proved = np.array([point["inside"] for point in after["points"]])
    assert after["map"] == job_id
    assert [point["map"] for point in after["points"]] == proved.tolist()
    assert not (proved & collides).any()
    assert proved[~collides].mean() > 0.9
    near = [point["nearest"] for point in ask("nearest", q=q.tolist())["points"]]
    assert {(point["region"], point["map"]) for point in near} == {(None, job_id)}
    assert [point["distance"] == 0 for point in near] == proved.tolist()
    assert all(point["inside"] for point in ask("contains", q=[point["q"] for point in near])["points"])
    free = np.flatnonzero(proved)[:200].reshape(-1, 2)
    answers = ask("segment", q=q[free].tolist())["segments"]
    covered = np.array([answer["covered"] for answer in answers])
    assert 0 < covered.sum() < len(covered)
    for ends, answer in zip(q[free], answers, strict=True):
        between = ends[0] + np.linspace(0, 1, 200)[:, None] * (ends[1] - ends[0])
        if answer["covered"]:
            assert not in_collision(scene, scene.to_s(between)).any()
            assert [(piece["begin"], piece["end"], piece["map"], piece["guarantee"]) for piece in answer["pieces"]] == [
                (0.0, 1.0, job_id, "exact")
            ]
    start, goal = q[free[covered][0]]
    path = ask("path", q=[start.tolist(), goal.tolist(), start.tolist(), HIT], times=[0, 1, 2.5, 3])
    assert not path["covered"]
    end = path["uncovered"]["time"]
    assert [(piece["begin"], piece["end"], piece["map"]) for piece in path["pieces"]] == [(0.0, end, job_id)]
    assert path["uncovered"]["segment"] == 2
    assert 2.5 < end < 3, "the map goes on for a part of the last segment"
    until = start + np.linspace(0, (end - 2.5) / 0.5, 200)[:, None] * (np.array(HIT) - start)
    assert not in_collision(scene, scene.to_s(until)).any()
    assert not ask("segment", space="s", s=scene.to_s(q[free[covered][:1]]).tolist())["segments"][0]["covered"], "a map knows motions in q"


def test_pieces_on_several_processes_give_the_same_map(client: TestClient, arm: tuple[Scene, np.ndarray], local: bytes) -> None:
    job_id = asked(client, arm[0], options={"coverage": COVERAGE})
    leader = eventually(lambda: held(job_id, "map"), "a process leads the map").worker
    helper = eventually(lambda: held(job_id, "piece", besides=leader), "another process works on a piece")
    assert ended(job_id).outcome == "certified"
    assert helper.worker is not None
    notes = [event.data for event in events_of(job_id) if event.kind == "note"]
    looked = [note["cells"] for note in notes]
    assert looked == sorted(looked)
    assert looked[0] > 0
    busy = {process for note in notes for process, seconds in note["work"].items() if seconds > 0}
    assert helper.worker in busy
    shown = client.get(f"/v1/jobs/{job_id}/timeline").json()
    assert {shown["processes"][bar["process"]] for bar in shown["bars"] if bar["work"] == "piece"} == busy
    rates = [rate["cells"] for rate in shown["rates"]]
    assert min(rates) >= 0
    assert max(rates) > 0
    assert proof_of(client, job_id) == local
    assert_nothing_is_left(job_id)


@pytest.mark.parametrize("kind", ["map", "piece"])
def test_the_map_is_the_same_when_a_process_is_killed(client: TestClient, arm: tuple[Scene, np.ndarray], local: bytes, kind: str) -> None:
    job_id = asked(client, arm[0], options={"coverage": COVERAGE})
    eventually(lambda: rounds(job_id) >= 3, "three rounds are over")
    kill(eventually(lambda: held(job_id, kind), f"a process holds a {kind}"))
    job = ended(job_id)
    assert (job.state, job.outcome) == ("succeeded", "certified")
    assert proof_of(client, job_id) == local
    assert_nothing_is_left(job_id)


def test_the_deadline_leaves_what_is_proved(client: TestClient, arm: tuple[Scene, np.ndarray]) -> None:
    eventually(lambda: "solve" in [worker["kind"] for worker in client.get("/v1/workers").json()["workers"]], "a solver is ready", 120)
    job = ended(asked(client, arm[0], options={"coverage": 1.0}, deadline_seconds=15.0), seconds=60)
    assert (job.state, job.outcome, job.reason) == ("succeeded", "inconclusive", "the deadline was reached")
    assert stored_after(client, job)["coverage"]["value"] > 0


def test_cancelling_leaves_what_is_proved(client: TestClient, arm: tuple[Scene, np.ndarray]) -> None:
    job_id = asked(client, arm[0])
    eventually(lambda: rounds(job_id) >= 3, "three rounds are over")
    early = client.get(f"/v1/jobs/{job_id}/map/proof")
    assert (early.status_code, early.json()["code"]) == (404, "map_not_found")
    client.post(f"/v1/jobs/{job_id}/cancel")
    job = ended(job_id, seconds=60)
    assert (job.state, job.outcome) == ("cancelled", None)
    stored_after(client, job)


def test_bodies_that_always_touch_leave_an_empty_map(client: TestClient) -> None:
    job = ended(asked(client, planar_arm(1, box("world/obstacle", WORLD, (0.3, 0.3, 0.3))), options={"at": [[0.0]]}))
    assert (job.state, job.outcome, job.reason) == ("succeeded", "inconclusive", "nothing is left that a map could prove")
    told = found(client, job.id)
    assert (told["ended"], told["cells"], told["stored"]["free_set"]) == ("nothing_left", 0, False)
    assert told["stored"]["at"] == [{"q": [0.0], "state": "in_collision"}]
    assert verify_file(proof_of(client, job.id)).kind == "map"


def test_a_map_without_a_free_set_has_none_to_give(client: TestClient, planar: Scene) -> None:
    job = ended(asked(client, replace(planar, padding=planar.padding + 2e-6), options={"coverage": 0.5}))
    with database().write() as session:  # as where a pair had no cell at the deadline
        session.execute(update(StepRow).where(StepRow.job_id == job.id, StepRow.kind == "accept").values(data=None))
    refused = client.get(f"/v1/jobs/{job.id}/map/free-set")
    assert (refused.status_code, refused.json()["code"]) == (404, "proof_not_found")
    asked_for = client.post("/v1/planning/contains", json={"scene": job.scene_id, "q": [FREE]}).json()
    assert asked_for["map"] is None


def test_a_map_gives_way_to_other_jobs(client: TestClient, arm: tuple[Scene, np.ndarray], planar: Scene) -> None:
    """Two maps lead both processes; a third job gets one of them within seconds."""
    long = [asked(client, arm[0], options={"coverage": 1.0, "random_seed": seed}) for seed in (1, 2)]
    for job_id in long:
        eventually(lambda job_id=job_id: held(job_id, "map"), "a process leads the map")
    short = asked(client, planar, options={"coverage": 0.9})
    assert ended(short, seconds=40).outcome == "certified"
    for job_id in long:
        assert job_of(job_id).state == "running"
        client.post(f"/v1/jobs/{job_id}/cancel")
        ended(job_id, seconds=60)


def test_a_former_map_is_taken_over_and_may_be_deleted_meanwhile(client: TestClient, planar: Scene) -> None:
    first = ended(asked(client, planar, options={"coverage": 0.8}))
    data = proof_of(client, first.id)
    moved = replace(planar, pairs=planar.pairs[1:])
    job_id = asked(client, moved, options={"coverage": 0.9}, former=first.id[:8])
    eventually(lambda: job_of(job_id).state != "queued" or None, "the job has begun")
    refused = client.delete(f"/v1/jobs/{first.id}")
    assert (refused.status_code, refused.json()["code"], "1 map" in refused.json()["detail"]) == (409, "has_dependents", True)
    assert client.delete(f"/v1/jobs/{first.id}?dependents=delete").status_code == 204
    job = ended(job_id)
    assert (job.outcome, job.options["former"]) == ("certified", first.id)
    assert proof_of(client, job.id) == grow_map(moved, 0.9, former=MapProof.from_bytes(data)).proof.to_bytes()
    assert proof_of(client, job.id) != grow_map(moved, 0.9).proof.to_bytes()
    with database().write() as session:
        row = scenes.add(session, moved)
        gone, _ = jobs.create(session, kind="map", scene_id=row.id, options={**job.options, "former": first.id})
    send_coordinate(gone.id)
    late = ended(gone.id)
    assert (late.state, (late.error or {})["code"], (late.error or {})["field"]) == ("failed", "map_not_found", "former")
    refused = client.post("/v1/jobs", json={"kind": "map", "scene": row.id, "former": first.id})
    assert (refused.status_code, refused.json()["code"], refused.json()["field"]) == (404, "job_not_found", "former")


def test_a_map_begins_with_the_one_of_the_project_that_proves_most_of_the_same_bodies(client: TestClient, planar: Scene) -> None:
    """The second scene has an obstacle more. A map of another project, which proves more, is not looked at."""
    here = replace(planar, padding=planar.padding + 3e-6)
    few, many = (ended(asked(client, here, options={"coverage": share})) for share in (0.3, 0.8))
    with database().write() as session:
        projects.add(session, "others")
    with database().of("others").write() as session:
        theirs = scenes.add(session, here)
        hidden, _ = jobs.create(session, kind="map", scene_id=theirs.id, options={**many.options, "coverage": 0.97})
    send_coordinate(hidden.id)
    assert ended(hidden.id).outcome == "certified"
    data = proof_of(client, many.id)
    more = replace(here, pairs=here.pairs[1:])
    for scene, former, expected in ((more, many.id, MapProof.from_bytes(data)), (planar_arm(limit=1.7), None, None)):
        job = ended(asked(client, scene, options={"coverage": 0.9}, former=None))
        assert job.options["former"] == former
        assert proof_of(client, job.id) == grow_map(scene, 0.9, former=expected).proof.to_bytes()
    again = ended(asked(client, here, options={"coverage": 0.7}, former=None))
    told = found(client, again.id)
    assert told["coverage"]["value"] >= 0.7, "it is known although no round was needed"
    assert 0 < told["cells"] == told["stored"]["cells"]
    anew = ended(asked(client, more, options={"coverage": 0.9}))
    assert (anew.options["former"], proof_of(client, anew.id)) == ("none", grow_map(more, 0.9).proof.to_bytes())
    assert few.outcome == "certified"


def test_another_kind_of_job_has_no_map(client: TestClient, planar: Scene) -> None:
    with database().write() as session:
        row = scenes.add(session, planar)
    other = client.post("/v1/jobs", json={"kind": "certify-path", "scene": row.id, "q": [FREE, FREE]}).json()["id"]
    for route in ("map", "map/proof", "map/free-set"):
        refused = client.get(f"/v1/jobs/{other}/{route}")
        assert (refused.status_code, refused.json()["code"]) == (404, "map_not_found")
    refused = client.post("/v1/jobs", json={"kind": "map", "scene": row.id, "former": other})
    assert (refused.status_code, refused.json()["code"], refused.json()["field"]) == (404, "map_not_found", "former")


def test_configurations_beyond_the_limits_are_refused(client: TestClient, planar: Scene) -> None:
    with database().write() as session:
        row = scenes.add(session, planar)
    refused = client.post("/v1/jobs", json={"kind": "map", "scene": row.id, "options": {"at": [FREE, [9.0, 0.0]]}})
    assert refused.status_code == 422
    assert refused.json()["field"] == "options.at[1][0]"
    refused = client.post("/v1/jobs", json={"kind": "map", "scene": row.id, "options": {"paths": [[FREE, HIT], [FREE, [9.0, 0.0]]]}})
    assert (refused.status_code, refused.json()["field"]) == (422, "options.paths[1][1][0]")
