"""A service for tests: real worker processes on a real queue and a real database, and the views of it that tests need."""

from __future__ import annotations

import base64
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from certifier.orphans import die_with_parent
from db import events, jobs, scenes
from db.models import EventRow, JobRow, PairRow
from db.session import database
from db.settings import settings
from db.states import JOB, unfinished
from tests.db.builders import all_pairs
from workers.app import celery_app, send_coordinate

ROOT = Path(__file__).parents[2]
PATIENCE_SECONDS = 180.0
"""For machines that are busy with other things; nothing is to take that long."""
SECRET_KEY = base64.b64encode(bytes(range(32))).decode()
Found = TypeVar("Found")


@contextmanager
def environment(**variables: str) -> Iterator[None]:
    """The process's settings, database and Celery app as these variables say, for a while."""
    caches = (settings, database, celery_app, scenes.load)
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"CIRIS_SECRET_KEY": SECRET_KEY, **variables}.items():
            patch.setenv(name, value)
        for cache in caches:
            cache.cache_clear()
        try:
            yield
        finally:
            database().close()
            celery_app().close()
            for cache in caches:
                cache.cache_clear()


def eventually(look: Callable[[], Found | None], what: str, seconds: float = PATIENCE_SECONDS, every: float = 0.01) -> Found:
    """The first true answer. Looks again after ``every`` seconds, which is longer where a look makes others work."""
    until = time.monotonic() + seconds
    while not (found := look()):
        if time.monotonic() > until:
            raise AssertionError(f"{what}: not within {seconds} s")
        time.sleep(every)
    return found


COMMANDS = {"control": ["workers", "control"], "solve": ["workers", "solve"], "solve-2": ["workers", "solve"], "api": ["api"]}


class Service:
    """Worker processes, and the API, with the settings of this process's environment."""

    def __init__(self, logs: Path) -> None:
        self._logs = logs
        self._workers: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str) -> None:
        with (self._logs / f"{name}.log").open("ab") as log:
            self._workers[name] = subprocess.Popen(
                [sys.executable, "-m", *COMMANDS[name]],
                cwd=ROOT,
                stdout=log,
                stderr=log,
                preexec_fn=partial(die_with_parent, signal.SIGKILL),
            )

    def pid(self, name: str) -> int:
        return self._workers[name].pid

    def status(self, name: str) -> int | None:
        """The status with which a worker ended by itself; None while it runs."""
        return self._workers[name].poll()

    def kill(self, name: str) -> None:
        """Kills a whole worker, as the kernel does when memory runs out."""
        self._workers[name].kill()
        self._workers[name].wait()

    def dismiss(self, name: str) -> None:
        """Kills a worker, if it was started, for good."""
        if name in self._workers:
            self.kill(name)
            del self._workers[name]

    def start_again(self) -> None:
        """Starts what ended by itself, as a supervisor does: a worker that finds a child dead as it reconnects to Redis ends."""
        for name, worker in list(self._workers.items()):
            if worker.poll() is not None:
                self.start(name)

    def children(self, name: str) -> list[int]:
        """The processes that a worker has forked."""
        pid = self._workers[name].pid
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]

    def stop(self) -> None:
        for worker in self._workers.values():
            worker.send_signal(signal.SIGQUIT)
        for worker in self._workers.values():
            try:
                worker.wait(10)
            except subprocess.TimeoutExpired:
                worker.kill()
                worker.wait()

    def log(self) -> str:
        return "\n".join(path.read_text() for path in sorted(self._logs.glob("*.log")))


@contextmanager
def running_service(
    database_url: str, queue_url: str, logs: Path, workers: Sequence[str] = ("control", "solve"), **variables: str
) -> Iterator[Service]:
    """A control worker and two solving processes, which take half a minute of a processor's time to start; or some of these workers."""
    given = {"CIRIS_DATABASE_URL": database_url, "CIRIS_REDIS_URL": queue_url, "CIRIS_SOLVE_PROCESSES": "2", "CIRIS_SWEEP_SECONDS": "0.5"}
    given["CIRIS_HEARTBEAT_FILE"] = str(logs / "alive")
    with environment(**{**given, **variables}):
        service = Service(logs)
        try:
            for name in workers:
                service.start(name)
            yield service
        finally:
            service.stop()


def submit(scene: Scene, options: dict[str, Any], kind: str | None = None, **values: Any) -> str:
    """Commits a job and asks for its coordination; returns its id."""
    with database().write() as session:
        row = scenes.add(session, scene)
        job, _ = jobs.create(session, kind=kind or options["kind"], scene_id=row.id, options=options, **values)
    send_coordinate(job.id)
    return job.id


def asked(client: TestClient, scene: Scene, kind: str, **request: Any) -> str:
    """Asks for a job over HTTP, and returns its id."""
    with database().write() as session:
        row = scenes.add(session, scene)
    answer = client.post("/v1/jobs", json={"kind": kind, "scene": row.id, **request})
    assert answer.status_code == 201, answer.json()
    return str(answer.json()["id"])


def job_of(job_id: str) -> JobRow:
    with database().read() as session:
        return jobs.get(session, job_id)


def pairs_of(job_id: str) -> list[PairRow]:
    with database().read() as session:
        return list(all_pairs(session, job_id))


def events_of(job_id: str) -> list[EventRow]:
    with database().read() as session:
        return list(events.since(session, job_id))


def ended(job_id: str, seconds: float = PATIENCE_SECONDS) -> JobRow:
    """The job, once it has ended."""

    def look() -> JobRow | None:
        job = job_of(job_id)
        return None if job.state in unfinished(JOB) else job

    return eventually(look, f"job {job_id} ends", seconds)


def holder(row: PairRow) -> int:
    """The process that holds a pair."""
    return int((row.worker or "").rsplit(":", 2)[1])


def kill_holder(job_id: str, index: int, attempt: int) -> None:
    """Waits until the pair is being certified for the ``attempt``-th time and kills the process that does it."""

    def look() -> PairRow | None:
        return next(
            (row for row in pairs_of(job_id) if row.pair_index == index and row.state == "running" and row.attempts == attempt), None
        )

    os.kill(holder(eventually(look, f"attempt {attempt} at pair {index}")), signal.SIGKILL)
