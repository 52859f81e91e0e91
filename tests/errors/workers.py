"""Errors about workers that are asked for or asked to do something."""

from __future__ import annotations

import time

from api.access import KEYS_SECONDS
from db import keys, projects, workers
from db.keys import Scope
from db.states import WorkerState
from db.workers import Made, WorkerKind
from tests.errors.service import database
from tests.errors.trial import Table, Trial


def a_draining_one(t: Trial) -> str:
    with database(t).write() as session:
        workers.tell(session, Made("there:1:2", WorkerKind.SOLVE, "1", 2, 2, 2**32), WorkerState.DRAINING)
        session.flush()
        return workers.page(session).rows[0].id


def with_a_key_of_others(t: Trial) -> None:
    worker = a_draining_one(t)
    with database(t).write() as session:
        projects.add(session, "others")
        key = keys.add(session, "boss", Scope.ADMIN, "others")
    time.sleep(KEYS_SECONDS)
    t.ask("POST", f"/v1/workers/{worker}/pause", headers={"Authorization": f"Bearer {key}"})


WORKERS: Table = {
    ("worker_not_found", "worker"): [lambda t: t.ask("GET", "/v1/workers/nobody")],
    ("worker_draining", "worker"): [lambda t: t.ask("POST", f"/v1/workers/{a_draining_one(t)}/resume")],
    ("workers_shared", "Authorization"): [with_a_key_of_others],
}
