"""How jobs ended, by project, for monitoring. On both databases."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest

from certifier.outcome import DEADLINE, Outcome
from db import jobs, pairs, projects, scenes, statistics
from db.session import Database
from db.states import JobState
from db.statistics import OTHER, End, collect
from db.types import utcnow
from tests.db.builders import a_job, a_running_job
from tests.scenes import slider


@pytest.mark.parametrize(
    ("state", "outcome", "reason", "code", "end"),
    [
        (JobState.SUCCEEDED, Outcome.CERTIFIED, "as large as asked for", None, End.SUCCEEDED),
        (JobState.SUCCEEDED, Outcome.CERTIFIED, f"{DEADLINE}; the region is a small box about the seed", None, End.SUCCEEDED),
        (JobState.FAILED, Outcome.INCONCLUSIVE, DEADLINE, "no_region", End.DEADLINE),
        (JobState.FAILED, Outcome.ERROR, "pair 3 needs 40 s", "does_not_fit", End.REFUSED),
        (JobState.FAILED, Outcome.ERROR, "the coordinator failed", "coordination_failed", End.ERROR),
        (JobState.FAILED, Outcome.ERROR, DEADLINE, "worker_lost", End.ERROR),
        (JobState.FAILED, Outcome.ERROR, "the verifier refused the proof", "proof_invalid", End.ERROR),
    ],
)
def test_how_a_job_ended(db: Database, state: JobState, outcome: str, reason: str, code: str | None, end: End) -> None:
    error: dict[str, Any] | None = None if code is None else {"code": code, "message": "m", "field": None, "hint": None}
    with db.write() as session:
        job = a_job(session)
        jobs.start(session, job)
        jobs.finish(session, job, state, reason=reason, outcome=outcome, error=error)
        jobs.cancel(session, a_job(session).id)
        a_job(session)
    with db.read() as session:
        ended = collect(session).ended
    assert {key: number for key, number in ended.items() if number} == {("default", end): 1, ("default", End.CANCELLED): 1}


def test_only_so_many_projects_are_named(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(statistics, "PROJECTS", 2)
    for name in ("second", "third", "fourth"):
        with db.write() as session:
            projects.add(session, name)
        with db.of(name).write() as session:
            row = scenes.add(session, slider())
            job, _ = jobs.create(session, kind="grow", scene_id=row.id, options={"random_seed": 0})
            jobs.cancel(session, job.id)
    with db.read() as session:
        ended = collect(session).ended
    assert {project for project, _ in ended} == {"default", "second", OTHER}
    assert (ended["second", End.CANCELLED], ended[OTHER, End.CANCELLED]) == (1, 2)


def test_times_of_jobs_are_those_of_lately(db: Database) -> None:
    """From submission until a solver began, and until the end; by project, in order."""
    now = utcnow()
    with db.write() as session:
        for seconds, ago in ((4, 10), (2, 60), (7, 1000)):  # the last one ended more than a quarter of an hour ago
            job = a_job(session)
            job.created_at = now - timedelta(seconds=ago + 2 * seconds)
            job.claimed_at, job.finished_at = now - timedelta(seconds=ago + seconds), now - timedelta(seconds=ago)
        a_job(session)
    with db.read() as session:
        found = collect(session)
    assert found.waited == {"default": [pytest.approx(2), pytest.approx(4)]}
    assert found.took == {"default": [pytest.approx(4), pytest.approx(8)]}


def test_a_job_knows_when_a_solver_first_worked_on_it(db: Database) -> None:
    with db.write() as session:
        job = a_running_job(session, pair_count=2)
        assert job.claimed_at is None
        first = pairs.claim(session, job, lease_seconds=60, batch_seconds=1e-9)
        assert first is not None
        begun = job.claimed_at
        assert begun is not None
        pairs.claim(session, job, lease_seconds=60, batch_seconds=1e-9)
        assert job.claimed_at == begun
