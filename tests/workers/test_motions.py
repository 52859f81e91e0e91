"""Motions that are certified by jobs: asked for over HTTP, carried out by real worker processes, on both databases."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from api.app import create_app
from certifier.jobs.motion import certify
from certifier.model import Scene
from certifier.motion.given import motion_of
from certifier.verify.file import verify_file
from db import jobs, scenes, steps
from db.models import JobRow, StepRow
from db.session import database
from tests.certifier.motions import swing
from tests.workers import service as workers_service
from tests.workers.service import Service, ended, events_of, eventually
from workers.app import send_coordinate

pytestmark = [pytest.mark.usefixtures("service"), pytest.mark.lengthy]

FREE = [[0.2, -0.4], [-0.4, 0.3]]
LAPS = 600


asked = partial(workers_service.asked, kind="certify-path")


@pytest.fixture
def client(service: Service) -> Iterator[TestClient]:
    with TestClient(create_app(), base_url="http://127.0.0.1:8643") as client:
        yield client


def submit(scene: Scene, motion: dict[str, Any], seconds: float | None = None) -> str:
    """Commits a job as the API does, without its checks."""
    with database().write() as session:
        row = scenes.add(session, scene)
        job, _ = jobs.create(session, kind="certify-path", scene_id=row.id, options=motion, deadline_seconds=seconds)
    send_coordinate(job.id)
    return job.id


def step_of(job_id: str) -> StepRow | None:
    with database().read() as session:
        return next(iter(steps.of_job(session, job_id)), None)


def running(job_id: str) -> StepRow:
    """The step, once somebody works on it."""
    return eventually(lambda: step if (step := step_of(job_id)) and step.state == "running" else None, "the step runs")


def long(laps: int = LAPS) -> dict[str, Any]:
    """A motion of the planar arm, to and fro, that takes seconds."""
    to_and_fro = np.tile(FREE, (laps, 1)) + np.linspace(0, 0.01, len(FREE) * laps)[:, None]
    return {"q": to_and_fro.tolist(), "tube": True}


def test_a_motion_is_certified_as_by_a_plain_call_and_its_proof_holds(client: TestClient, planar: Scene) -> None:
    job_id = asked(client, planar, q=FREE, tube=True)
    job = ended(job_id)
    assert (job.state, job.outcome, job.error) == ("succeeded", "certified", None)
    found = client.get(f"/v1/jobs/{job_id}/motion").json()
    expected = certify(planar, motion_of(planar, {"q": FREE}), tube=True)
    answer = client.get(f"/v1/jobs/{job_id}/motion/proof")
    assert answer.content == expected.proof
    statement = verify_file(answer.content)
    assert (statement.kind, statement.scene.hash) == ("motion", planar.hash)
    for name, value in expected.document().items():
        assert "seconds" in name or found[name] == value, name
    told = [(event.data["kind"], event.data["state"]) for event in events_of(job_id) if event.kind == "step"]
    assert told == [("motion", "open"), ("motion", "done")]


def test_a_contact_is_an_answer(client: TestClient) -> None:
    job = ended(asked(client, swing(-0.01), s=[[-0.5], [0.6]], space="q"))
    assert (job.state, job.outcome, job.error) == ("succeeded", "refuted", None)
    assert "touch, on piece 0" in (job.reason or "")
    found = client.get(f"/v1/jobs/{job.id}/motion").json()
    assert (found["outcome"], found["guarantee"], found["stop"]["piece"]) == ("refuted", "none", 0)
    statement = verify_file(client.get(f"/v1/jobs/{job.id}/motion/proof").content)
    assert statement.kind == "motion", "the beginning is proved"


def test_a_motion_that_begins_in_contact_has_no_proof(client: TestClient) -> None:
    job = ended(asked(client, swing(-0.01), q=[[0.0], [0.5]]))
    assert (job.state, job.outcome) == ("succeeded", "refuted")
    assert client.get(f"/v1/jobs/{job.id}/motion").json()["proof"] is None
    refused = client.get(f"/v1/jobs/{job.id}/motion/proof")
    assert (refused.status_code, refused.json()["code"]) == (404, "proof_not_found")


def test_another_worker_begins_again_when_one_is_killed(client: TestClient, planar: Scene) -> None:
    job_id = asked(client, planar, **long())
    os.kill(int((running(job_id).worker or "").rsplit(":", 2)[1]), signal.SIGKILL)
    job = ended(job_id)
    assert (job.state, job.outcome) == ("succeeded", "certified")
    step = step_of(job_id)
    assert step is not None
    assert (step.attempts, step.deaths) == (2, 1)
    assert verify_file(client.get(f"/v1/jobs/{job_id}/motion/proof").content).kind == "motion"


def test_cancelling_ends_the_search(client: TestClient, planar: Scene) -> None:
    def cancelled(job_id: str) -> JobRow:
        running(job_id)
        client.post(f"/v1/jobs/{job_id}/cancel")
        return ended(job_id, seconds=30)

    job = cancelled(submit(planar, long(20 * LAPS)))
    assert (job.state, job.outcome) == ("cancelled", None)
    step = step_of(job.id)
    assert step is not None
    assert step.state == "skipped"
    assert client.get(f"/v1/jobs/{job.id}/motion").status_code == 404
    again = cancelled(client.post(f"/v1/jobs/{job.id}/retry").json()["id"])
    assert (again.options, again.state) == (job.options, "cancelled")


def test_the_deadline_ends_the_search_without_a_verdict(client: TestClient, planar: Scene) -> None:
    ended(submit(planar, long(1)), seconds=180)  # a solver is ready then
    job_id = submit(planar, long(60 * LAPS), seconds=10.0)
    job = ended(job_id, seconds=60)
    assert (job.state, job.outcome, job.reason) == ("succeeded", "inconclusive", "the deadline was reached")
    refused = client.get(f"/v1/jobs/{job_id}/motion")
    assert (refused.status_code, refused.json()["code"]) == (404, "motion_not_found")
    assert "the deadline was reached" in refused.json()["detail"]


def test_what_is_no_motion_fails_the_job_with_its_place(planar: Scene) -> None:
    job = ended(submit(planar, {"q": [[0.0, 0.0], [0.0, 99.0]], "tube": False}))
    assert (job.state, job.outcome) == ("failed", "error")
    assert job.error is not None
    assert (job.error["code"], job.error["field"]) == ("outside_limits", "q[1][1]")
