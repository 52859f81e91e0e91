"""Workers that come and go, on a real queue and both databases: what they say of themselves, and pausing, resuming, draining, dying."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator

import numpy as np
import pytest
from sqlalchemy import text

from certifier.model import Scene
from db import machine, version, workers
from db.leases import name_of
from db.models import WorkerRow
from db.session import database
from db.settings import SPARE
from db.states import WorkerState
from tests.workers.options import box_around
from tests.workers.service import Service, ended, events_of, eventually, job_of, pairs_of, submit
from workers.app import SOLVE, celery_app, send_work, waiting

pytestmark = pytest.mark.lengthy

LINGER_SECONDS = 3.0
"""Tests wait for this many seconds for what must not happen."""


@pytest.fixture
def crew(service: Service) -> Iterator[Service]:
    """A control worker and a solve worker with two processes, which may be killed; those that follow find others in their place."""
    for name in ("control", "solve"):
        seen(service, name)
    yield service
    service.dismiss("solve-2")
    service.start_again()


def row_of(crew: Service, name: str) -> WorkerRow | None:
    with database().read() as session:
        return next((row for row in workers.page(session).rows if row.process == name_of(crew.pid(name))), None)


def seen(crew: Service, name: str, state: WorkerState = WorkerState.RUNNING) -> WorkerRow:
    """The row of a worker, once it says that it is in this state."""

    def look() -> WorkerRow | None:
        row = row_of(crew, name)
        return row if row is not None and row.state == state else None

    return eventually(look, f"{name} is {state}", 60)


def ask(crew: Service, name: str, state: WorkerState) -> None:
    row = row_of(crew, name)
    assert row is not None
    with database().write() as session:
        workers.ask(session, row.id, state)


def unacknowledged() -> int:
    """How many messages workers have taken and not acknowledged."""
    with celery_app().connection_for_read() as connection:
        return int(connection.default_channel.client.hlen("unacked"))


@pytest.mark.slow
def test_workers_say_what_they_are_and_leave(crew: Service) -> None:
    solve, control = seen(crew, "solve"), seen(crew, "control")
    assert (solve.kind, solve.processes, solve.cores) == ("solve", 2, machine.cores())
    assert (control.kind, control.processes) == ("control", 1)
    assert (solve.wanted, solve.state, solve.memory_bytes) == ("running", "running", machine.memory_bytes())
    os.kill(crew.pid("solve"), signal.SIGQUIT)
    eventually(lambda: crew.status("solve") is not None, "the worker ends")
    assert row_of(crew, "solve") is None, "it took its row with it"


def test_a_solve_worker_runs_once_one_of_its_processes_can_take_work(crew: Service) -> None:
    """Each loads for seconds. Nobody is to be told meanwhile that a job is next."""
    crew.start("solve-2")
    eventually(lambda: len(crew.children("solve-2")) == 2 + SPARE, "it forks its processes", 60)
    loading = crew.children("solve-2")
    for child in loading:
        os.kill(child, signal.SIGSTOP)
    time.sleep(LINGER_SECONDS)
    row = row_of(crew, "solve-2")
    for child in loading:
        os.kill(child, signal.SIGCONT)
    assert row is not None
    assert row.state == WorkerState.STARTING
    assert seen(crew, "solve-2")


def test_a_worker_that_was_killed_is_forgotten(crew: Service) -> None:
    crew.kill("solve")
    eventually(lambda: row_of(crew, "solve") is None, "the sweeper forgets it", 30)
    assert row_of(crew, "control") is not None


@pytest.mark.slow
def test_a_paused_worker_takes_nothing_and_loses_no_message(crew: Service, planar: Scene) -> None:
    ask(crew, "solve", WorkerState.PAUSED)
    seen(crew, "solve", WorkerState.PAUSED)
    job = submit(planar, box_around(np.zeros(2), 0.1))
    eventually(lambda: waiting(SOLVE), "the control worker, or the sweeper, or each of them has sent a message")
    send_work(5)
    time.sleep(LINGER_SECONDS)
    assert {row.state for row in pairs_of(job)} == {"open"}
    left = waiting(SOLVE)
    assert (left in (6, 7), unacknowledged()) == (True, 0), "the messages stay where they are"
    with celery_app().connection_for_read() as connection:
        connection.default_channel.client.client_kill_filter(_type="normal", skipme=True)
    time.sleep(LINGER_SECONDS)
    assert {row.state for row in pairs_of(job)} == {"open"}, "it connects to Redis anew, and consumes from nothing then"
    assert waiting(SOLVE) == left
    ask(crew, "solve", WorkerState.RUNNING)
    assert ended(job).outcome == "certified"
    seen(crew, "solve")


@pytest.mark.slow
def test_what_a_paused_worker_leaves_the_others_do(crew: Service, planar: Scene) -> None:
    crew.start("solve-2")
    seen(crew, "solve-2")
    ask(crew, "solve", WorkerState.PAUSED)
    seen(crew, "solve", WorkerState.PAUSED)
    job = submit(planar, box_around(np.zeros(2), 0.1))
    assert ended(job).outcome == "certified"
    assert {row.parent for row in pairs_of(job)} == {name_of(crew.pid("solve-2"))}
    ask(crew, "solve", WorkerState.RUNNING)


def test_a_drained_worker_finishes_what_it_holds_and_ends_well(crew: Service, arm: tuple[Scene, np.ndarray]) -> None:
    scene, s = arm
    abandoned = unacknowledged()  # those of workers that other tests have killed
    job = submit(scene, box_around(s, 0.05))
    held = eventually(lambda: [row.id for row in pairs_of(job) if row.state == "running"], "it holds something")
    ask(crew, "solve", WorkerState.PAUSED)
    ask(crew, "solve", WorkerState.DRAINING)
    eventually(lambda: crew.status("solve") is not None, "it ends")
    assert crew.status("solve") == 0
    assert row_of(crew, "solve") is None
    done = [row for row in pairs_of(job) if row.id in held]
    assert {(row.state, row.attempts) for row in done} == {("certified", 1)}
    eventually(lambda: unacknowledged() <= abandoned, "its messages are given back", 10)
    crew.start("solve-2")
    assert ended(job).outcome == "certified"
    assert not [event for event in events_of(job) if event.kind == "lost"], "nothing was taken from anybody"


@pytest.mark.slow
def test_processes_that_die_are_replaced_while_the_worker_tells_of_itself(crew: Service, planar: Scene) -> None:
    """Each is forked anew from a process with a thread that uses the database."""
    for round in range(3):
        for child in crew.children("solve"):
            os.kill(child, signal.SIGKILL)
        job = submit(planar, box_around(np.zeros(2), 0.1 + 0.01 * round))
        assert ended(job).outcome == "certified"
    assert crew.status("solve") is None
    began = seen(crew, "solve").seen_at
    eventually(lambda: seen(crew, "solve").seen_at > began, "it tells that it lives", 30)
    assert job_of(job).state == "succeeded"


def test_workers_of_another_version_end_and_say_what_to_do(crew: Service) -> None:
    """Somebody migrates the database to a version that they do not know."""
    newest = version.revisions()[-1]
    with database().writer.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    try:
        for name in ("control", "solve"):
            assert eventually(lambda name=name: crew.status(name), f"{name} ends", 60) == os.EX_UNAVAILABLE  # type: ignore[misc]
        crew.start("solve-2")
        assert eventually(lambda: crew.status("solve-2"), "it does not start", 60) == 2
        assert crew.log().count("this worker ends, and gives back what it holds: CIRIS_DATABASE_URL: the database is at revision 9999") == 2
        assert "error: CIRIS_DATABASE_URL: the database is at revision 9999, and this version of ciris" in crew.log()
        assert f"works with {newest} (install the version that migrated it" in crew.log()
    finally:
        with database().writer.begin() as connection:
            connection.execute(text(f"UPDATE alembic_version SET version_num = '{newest}'"))
