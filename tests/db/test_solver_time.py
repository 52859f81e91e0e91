"""The time of solvers that a project uses is counted by month, and has a limit."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import select

from certifier.errors import CirisError
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from db import jobs, pairs, projects, retention, solver_time, work
from db.models import DEFAULT_PROJECT, SolverTimeRow
from db.session import Database
from db.states import JobState
from tests.db.builders import a_job, a_running_job, a_scene


def used(db: Database, project: str = DEFAULT_PROJECT) -> float:
    with db.of(project).read() as session:
        return solver_time.used(session, project)


def test_the_seconds_of_pairs_count_once_they_are_saved(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, pair_count=4).id
    with db.write() as session:
        claim = work.claim(session, job_id, lease_seconds=60, batch_seconds=2.0)
        assert isinstance(claim, pairs.Claim)
        assert len(claim.pairs) == 2
    assert used(db) == 0.0, "a forecast is no work"
    took = {(pair.index, pair.part): PairResult(Outcome.CERTIFIED, Stage.SOS, 3.0, margin=0.01, proof=b"p") for pair in claim.pairs}
    for _ in range(2):
        with db.write() as session:
            pairs.save(session, claim, took)
        assert used(db) == 6.0, "results of pairs that are not held any more are dropped"


def test_of_what_solvers_have_done_lately_half_is_forgotten_every_quarter_of_a_minute(db: Database) -> None:
    with db.write() as session:
        projects.add(session, "others")
        solver_time.add(session, DEFAULT_PROJECT, 8.0)
        row = session.scalars(select(SolverTimeRow)).one()
        assert row.counted_at is not None
        row.counted_at -= timedelta(seconds=3 * solver_time.HALF_LIFE_SECONDS)
    with db.read() as session:
        assert solver_time.lately(session) == pytest.approx({(DEFAULT_PROJECT, None): 1.0}, rel=0.1)
    with db.write() as session:
        solver_time.add(session, DEFAULT_PROJECT, 2.0)
        solver_time.add(session, "others", 5.0)
        solver_time.add(session, DEFAULT_PROJECT, 4.0, "a key")
        of_keys = {(DEFAULT_PROJECT, None): 3.0, ("others", None): 5.0, (DEFAULT_PROJECT, "a key"): 4.0}
        assert solver_time.lately(session) == pytest.approx(of_keys, rel=0.1)
        for row in session.scalars(select(SolverTimeRow).where(SolverTimeRow.key_id == "a key")):
            assert row.counted_at is not None
            row.counted_at -= timedelta(seconds=2 * solver_time.FORGOTTEN_SECONDS)
        session.flush()
        assert (DEFAULT_PROJECT, "a key") not in solver_time.lately(session)
        assert solver_time.used_by_all(session) == {DEFAULT_PROJECT: 14.0, "others": 5.0}
    assert used(db) == 14.0, "of what counts for the limit nothing is forgotten"


def test_deleting_jobs_gives_no_time_back(db: Database) -> None:
    with db.write() as session:
        job = a_job(session)
        solver_time.add(session, job.project, 60.0)
        jobs.cancel(session, job.id)
        retention.delete_job(session, job.id, dependents=True)
    assert used(db) == 60.0


def test_many_count_at_once(db: Database) -> None:
    def count(_: int) -> None:
        with db.write() as session:
            solver_time.add(session, DEFAULT_PROJECT, 0.5)

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(count, range(64))) == [None] * 64
    assert used(db) == 32.0


def at(monkeypatch: pytest.MonkeyPatch, *moment: int) -> None:
    monkeypatch.setattr(solver_time, "utcnow", lambda: datetime(*moment, tzinfo=UTC))  # type: ignore[arg-type, misc]


def test_a_project_that_has_used_its_time_starts_jobs_again_next_month(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    at(monkeypatch, 2026, 1, 31, 23, 59)
    with db.write() as session:
        projects.add(session, "others")
        projects.get(session, DEFAULT_PROJECT).max_solver_seconds = 100.0
        under_way = a_job(session)
        solver_time.add(session, "others", 1000.0)
        solver_time.add(session, DEFAULT_PROJECT, 99.9)
        a_job(session)
        solver_time.add(session, DEFAULT_PROJECT, 0.2)
        again = f"retry:{under_way.id}"
        jobs.cancel(session, under_way.id)
    refused: Sequence[dict[str, object]] = ({}, {"idempotency_key": "new"}, {"retry": True})
    for asked in refused:
        with db.write() as session, pytest.raises(CirisError) as error:
            jobs.retry(session, under_way.id) if "retry" in asked else a_job(session, **asked)
        assert (error.value.code, error.value.message) == (
            "time_quota",
            "the project default has used 100 of the 100 s of solvers that it may use in 2026-01",
        )
        assert "it may start jobs again on 2026-02-01 at 00:00 UTC" in error.value.hint
        assert "`ciris project set default --max-solver-seconds N`" in error.value.hint
    with db.write() as session:
        a_job(session, parent_id=under_way.id, number=0)  # the region of a cover that is under way
    at(monkeypatch, 2026, 2, 1)
    with db.write() as session:
        assert jobs.retry(session, under_way.id).idempotency_key == again
        assert a_job(session).state == JobState.QUEUED
        assert solver_time.used(session, DEFAULT_PROJECT) == 0.0
    with db.read() as session:
        rows = session.execute(select(SolverTimeRow.project, SolverTimeRow.month).order_by(SolverTimeRow.project)).all()
    assert [tuple(row) for row in rows] == [("default", "2026-01"), ("others", "2026-01")]


def test_a_repeated_request_finds_its_job_when_the_time_is_used_up(db: Database) -> None:
    with db.write() as session:
        scene_id = a_scene(session).id
        job, made = jobs.create(session, kind="grow", scene_id=scene_id, options={}, idempotency_key="k", request_digest="d")
        projects.get(session, DEFAULT_PROJECT).max_solver_seconds = 1.0
        solver_time.add(session, DEFAULT_PROJECT, 1.0)
    with db.write() as session:
        again, made_again = jobs.create(session, kind="grow", scene_id=scene_id, options={}, idempotency_key="k", request_digest="d")
        assert (again.id, made, made_again) == (job.id, True, False)


@pytest.mark.parametrize(("month", "ends"), [((2026, 12, 31), (2027, 1, 1)), ((2028, 2, 1), (2028, 3, 1)), ((2026, 11, 30), (2026, 12, 1))])
def test_a_month_ends(monkeypatch: pytest.MonkeyPatch, month: tuple[int, ...], ends: tuple[int, ...]) -> None:
    at(monkeypatch, *month, 12, 30)
    assert solver_time.month_ends() == datetime(*ends, tzinfo=UTC)  # type: ignore[arg-type, misc]
