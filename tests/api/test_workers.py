"""The workers over HTTP: what they do, who may ask something of them, and what other projects do not see."""

from __future__ import annotations

import os
import time
from datetime import datetime, timedelta

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import update

from api import probes
from api.access import KEYS_SECONDS
from db import jobs, keys, leases, projects, work, workers
from db.keys import Scope
from db.models import JobRow, WorkerRow
from db.session import Database
from db.states import WorkerState
from db.types import utcnow
from db.workers import GONE_SECONDS, Made, WorkerKind
from tests.api.test_metrics import samples
from tests.db.builders import a_running_job
from tests.workers.service import eventually

SOLVE, CONTROL = leases.name_of(os.getppid()), leases.this_worker()
"""This process's parent stands for a worker, whose process claims; the control worker is this process itself."""


@pytest.fixture
def crew(database: Database) -> dict[str, str]:
    """A solve worker and a control worker; kind -> id."""
    for process, kind in ((SOLVE, WorkerKind.SOLVE), (CONTROL, WorkerKind.CONTROL)):
        with database.write() as session:
            workers.tell(session, Made(process, kind, "1.2", 4, 8, 2**34), WorkerState.RUNNING)
    with database.read() as session:
        return {row.kind: row.id for row in workers.page(session).rows}


@pytest.fixture
def busy(database: Database, crew: dict[str, str]) -> str:
    """A job of which the solve worker holds a pair, while the control worker decides about it."""
    with database.write() as session:
        job = a_running_job(session)
        assert work.claim(session, job.id, lease_seconds=60, batch_seconds=0.5) is not None
        job.coordinator, job.coordinator_since, job.coordinator_until = CONTROL, utcnow(), utcnow() + timedelta(seconds=60)
        return job.id


def key_of(database: Database, project: str, scope: Scope = Scope.ADMIN) -> dict[str, str]:
    with database.write() as session:
        key = keys.add(session, f"{project}-{scope}", scope, project)
    return {"Authorization": f"Bearer {key}"}


def test_the_list_says_what_each_worker_does_and_since_when(
    client: TestClient, crew: dict[str, str], database: Database, busy: str
) -> None:
    with database.read() as session:
        began = jobs.get(session, busy).created_at
    listed = {worker["kind"]: worker for worker in client.get("/v1/workers").json()["workers"]}
    solve, control = listed["solve"], listed["control"]
    assert (solve["id"], solve["processes"], solve["cores"], solve["memory_bytes"]) == (crew["solve"], 4, 8, 2**34)
    assert (solve["state"], solve["wanted"], solve["busy"], solve["version"]) == ("running", "running", 1, "1.2")
    assert solve["process"] == f"{solve['host']}:{SOLVE.split(':', 1)[1]}"
    (pairs,), (decision,) = solve["work"], control["work"]
    assert (pairs["job"], pairs["work"], pairs["pairs"], pairs["process"]) == (busy, "pairs", [0], CONTROL)
    assert (decision["job"], decision["work"]) == (busy, "decide")
    for piece in (pairs, decision):
        since, until = datetime.fromisoformat(piece["since"]), datetime.fromisoformat(piece["until"])
        assert began <= since <= utcnow() < until
    assert client.get(f"/v1/workers/{crew['solve'][:8]}").json() == solve
    (of_job, _) = client.get(f"/v1/jobs/{busy}/workers").json()["workers"]
    assert of_job == pairs, "both routes say it alike"


def test_the_list_comes_in_pages(client: TestClient, crew: dict[str, str]) -> None:
    first = client.get("/v1/workers", params={"limit": 1}).json()
    second = client.get("/v1/workers", params={"limit": 1, "after": first["next"]}).json()
    assert {worker["id"] for worker in first["workers"] + second["workers"]} == set(crew.values())
    assert second["next"] is None


def test_pausing_resuming_and_draining(client: TestClient, database: Database, crew: dict[str, str]) -> None:
    path = f"/v1/workers/{crew['solve']}"
    for verb, state in (("pause", "paused"), ("pause", "paused"), ("resume", "running"), ("drain", "draining")):
        answer = client.post(f"{path}/{verb}")
        assert (answer.status_code, answer.json()["wanted"], answer.json()["state"]) == (202, state, "running")
        assert client.get(path).json()["wanted"] == state
    refused = client.post(f"{path}/resume")
    assert (refused.status_code, refused.json()["code"]) == (409, "worker_draining")
    noted = client.get("/v1/audit").json()["lines"]
    assert [line["action"] for line in noted] == ["worker_drained", "worker_resumed", "worker_paused", "worker_paused"]
    assert {line["what"] for line in noted} == {SOLVE}


def test_who_is_gone_is_not_listed(client: TestClient, database: Database, crew: dict[str, str]) -> None:
    with database.write() as session:
        session.execute(update(WorkerRow).values(seen_at=utcnow() - timedelta(seconds=GONE_SECONDS + 1)))
    assert client.get("/v1/workers").json()["workers"] == []
    answer = client.post(f"/v1/workers/{crew['solve']}/pause")
    assert (answer.status_code, answer.json()["code"]) == (404, "worker_not_found")


def test_another_project_sees_the_workers_but_neither_its_jobs_nor_pauses_them(
    client: TestClient, database: Database, crew: dict[str, str], busy: str
) -> None:
    with database.write() as session:
        projects.add(session, "others")
    mine, others, reader = key_of(database, "default"), key_of(database, "others"), key_of(database, "default", Scope.READ)
    time.sleep(KEYS_SECONDS)
    answer = client.get("/v1/workers", headers=others)
    assert busy not in answer.text
    assert {worker["kind"]: worker["busy"] for worker in answer.json()["workers"]} == {"solve": 1, "control": 0}
    assert busy in client.get("/v1/workers", headers=reader).text
    for verb in ("pause", "resume", "drain"):
        path = f"/v1/workers/{crew['solve']}/{verb}"
        refused = client.post(path, headers=others)
        assert (refused.status_code, refused.json()["code"]) == (403, "workers_shared")
        assert client.post(path, headers=reader).json()["code"] == "scope_missing"
    assert client.get(f"/v1/workers/{crew['solve']}", headers=mine).json()["wanted"] == "running"


@pytest.fixture
def counted_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Statistics that took long to count, as on a busy machine, are believed for a while; here they are not."""
    monkeypatch.setattr(probes, "COST", 0.0)


def say(client: TestClient, name: str, value: float) -> None:
    """The metrics say so. On a busy machine, they are without statistics, or have the ones before, until these are counted."""
    eventually(lambda: samples(client.get("/metrics").text).get(name) == value, f"{name} is {value}", 30)


@pytest.mark.usefixtures("counted_anew")
def test_what_fails_in_a_worker_can_be_seen(client: TestClient, database: Database, crew: dict[str, str]) -> None:
    say(client, "ciris_workers_in_trouble", 0)
    with database.write() as session:
        workers.tell(session, Made(CONTROL, WorkerKind.CONTROL, "1.2", 4, 8, 2**34), WorkerState.RUNNING, "expiry failed: OverflowError")
    assert client.get(f"/v1/workers/{crew['control']}").json()["trouble"] == "expiry failed: OverflowError"
    assert client.get(f"/v1/workers/{crew['solve']}").json()["trouble"] is None
    say(client, "ciris_workers_in_trouble", 1)


@pytest.mark.usefixtures("counted_anew")
def test_the_metrics_say_how_many_would_be_busy(client: TestClient, database: Database, crew: dict[str, str], busy: str) -> None:
    say(client, "ciris_workers_wanted", 4)  # one pair of a second is running, three are open
    say(client, 'ciris_workers{kind="solve",state="running"}', 1)
    say(client, 'ciris_workers{kind="solve",state="paused"}', 0)
    with database.write() as session:
        assert jobs.cancel(session, busy).state == "cancelling"
    with database.write() as session:
        session.execute(update(JobRow).values(open_pairs=0))
    say(client, "ciris_workers_wanted", 1)
