"""Rows of workers, and how many would be busy, on both databases."""

from __future__ import annotations

from datetime import timedelta

import pytest
from sqlalchemy import update

from certifier.errors import CirisError
from db import jobs, leases, projects, steps, work, workers
from db.models import PairRow, WorkerRow
from db.session import Database
from db.states import WorkerState
from db.types import utcnow
from db.workers import GONE_SECONDS, Made, WorkerKind
from tests.db.builders import a_job, a_running_job

HERE = leases.this_worker()


def made(process: str = "there:1:2") -> Made:
    return Made(process, WorkerKind.SOLVE, "1", 4, 4, 2**34)


def enter(db: Database, process: str = "there:1:2", state: WorkerState = WorkerState.RUNNING) -> str:
    with db.write() as session:
        workers.tell(session, made(process), state)
    with db.read() as session:
        return next(row.id for row in workers.page(session).rows if row.process == process)


def silence(db: Database, seconds: float) -> None:
    with db.write() as session:
        session.execute(update(WorkerRow).values(seen_at=utcnow() - timedelta(seconds=seconds)))


def test_a_worker_tells_and_is_told(db: Database) -> None:
    worker = enter(db)
    assert enter(db) == worker, "it has one row"
    with db.write() as session:
        assert workers.ask(session, worker[:8], WorkerState.PAUSED).wanted == "paused"
    with db.read() as session:
        assert workers.get(session, worker).state == "running", "it has not said yet that it pauses"
        assert workers.wanted(session, "there:1:2") is WorkerState.PAUSED
    with db.write() as session:
        assert workers.tell(session, made(), WorkerState.PAUSED) is WorkerState.PAUSED
        workers.leave(session, "there:1:2")
    with db.read() as session:
        assert workers.wanted(session, "there:1:2") is None
    with db.write() as session:
        assert workers.tell(session, made(), WorkerState.PAUSED) is WorkerState.PAUSED, "it goes on as it was"


def test_a_worker_that_starts_is_to_run(db: Database) -> None:
    with db.write() as session:
        for state in (WorkerState.STARTING, WorkerState.COMPILING):
            assert workers.tell(session, made(), state) is WorkerState.RUNNING
            assert workers.state(session, "there:1:2") is state
            assert workers.solvers(session) == 0, "it takes no work yet"
        (row,) = workers.page(session).rows
        workers.ask(session, row.id, WorkerState.PAUSED)
        assert workers.tell(session, made(), WorkerState.RUNNING) is WorkerState.PAUSED, "it learns of it when it runs"
        assert workers.state(session, "there:2:2") is None


def test_draining_cannot_be_taken_back(db: Database) -> None:
    worker = enter(db)
    for state in (WorkerState.DRAINING, WorkerState.DRAINING):
        with db.write() as session:
            workers.ask(session, worker, state)
    for state in (WorkerState.RUNNING, WorkerState.PAUSED):
        with db.write() as session, pytest.raises(CirisError, match="ending") as refused:
            workers.ask(session, worker, state)
        assert refused.value.code == "worker_draining"


def test_who_says_nothing_is_gone(db: Database) -> None:
    worker = enter(db)
    silence(db, GONE_SECONDS + 1)
    with db.read() as session:
        assert workers.page(session).rows == []
        assert set(workers.counts(session).values()) == {0}
        assert workers.gone(session) == [worker]
        with pytest.raises(CirisError) as refused:
            workers.get(session, worker)
    assert refused.value.code == "worker_not_found"


def test_who_is_dead_on_this_host_is_gone_at_once(db: Database) -> None:
    here, dead = enter(db, HERE), enter(db, HERE.rpartition(":")[0] + ":1")
    with db.read() as session:
        assert workers.gone(session) == [dead]
    with db.write() as session:
        workers.forget(session, [dead])
    with db.read() as session:
        assert [row.id for row in workers.page(session).rows] == [here]
        assert workers.counts(session)["solve", "running"] == 1


def busy(db: Database) -> int:
    with db.read() as session:
        return work.busy_solvers(session, batch_seconds=0.5)


def claim(db: Database, job_id: str) -> None:
    with db.write() as session:
        assert work.claim(session, job_id, lease_seconds=60, batch_seconds=0.5) is not None


def forecast(db: Database, seconds: float) -> None:
    with db.write() as session:
        session.execute(update(PairRow).values(forecast_seconds=seconds))


def test_nobody_would_be_busy_without_work(db: Database) -> None:
    with db.write() as session:
        a_job(session)  # which nobody has looked at yet
    assert busy(db) == 0


def test_long_pairs_want_a_process_each_and_short_ones_share_it(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, pair_count=200).id  # of 1 s each
    assert busy(db) == 200
    forecast(db, 0.05)
    assert busy(db) == 20
    forecast(db, 0.0)
    assert busy(db) == 2, "no more than a hundred are claimed together"
    claim(db, job_id)
    assert busy(db) == 2, "one is busy, and the rest is for another"
    claim(db, job_id)
    assert busy(db) == 2


def test_many_pairs_are_claimed_in_longer_batches(db: Database) -> None:
    with db.write() as session:
        a_running_job(session, pair_count=2000)
    forecast(db, 1.0)
    assert busy(db) == 1000, "of 2 s each while that many are open"


def test_a_job_waits_for_one_step(db: Database) -> None:
    with db.write() as session:
        job = a_job(session)
        jobs.start(session, job)
        steps.add(session, job, "propose", {})
        job_id = job.id
    assert busy(db) == 1
    claim(db, job_id)
    assert busy(db) == 1


def test_what_workers_hold_is_seen_by_projects_as_far_as_it_is_theirs(db: Database) -> None:
    with db.write() as session:
        projects.add(session, "others")
        job_id = a_running_job(session).id
    claim(db, job_id)
    (parent,) = {row.parent for row in _running(db)}
    assert parent is not None
    for view, found in ((db, 1), (db.of("default"), 1), (db.of("others"), 0)):
        with view.read() as session:
            assert len(leases.of_workers(session, PairRow, [parent])) == found
            assert leases.count_of_workers(session) == {parent: 1}


def _running(db: Database) -> list[PairRow]:
    with db.read() as session:
        return [row for row in session.query(PairRow) if row.state == "running"]
