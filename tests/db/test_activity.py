"""What jobs do now, in words: who is missing, who comes first, who works, who is silent. On both databases."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import pytest
from sqlalchemy import update
from sqlalchemy.orm import Session

from db import activity, clock, jobs, leases, projects, scenes, steps, work, workers
from db.models import DEFAULT_PROJECT, JobRow, PairRow, WorkerRow
from db.session import Database
from db.states import JobState, WorkerState
from db.workers import Made, WorkerKind
from tests.db.builders import a_job, a_running_job
from tests.scenes import slider

SOLVER, CONTROL = (Made(f"host:{number}:1", kind, "1.0", 2, 2, 2**30) for number, kind in enumerate((WorkerKind.SOLVE, WorkerKind.CONTROL)))


def does(session: Session, *rows: JobRow) -> list[str]:
    said = activity.of_jobs(session, rows)
    return [said[row.id] for row in rows]


def crew(session: Session, *made: Made, state: WorkerState = WorkerState.RUNNING) -> None:
    for one in made:
        workers.tell(session, one, state)


def claimed(session: Session, job: JobRow) -> None:
    assert work.claim(session, job.id, lease_seconds=60, batch_seconds=0.5) is not None


def test_a_job_without_a_solver_does_not_run(db: Database) -> None:
    with db.write() as session:
        crew(session, CONTROL)
        begun, seeding = a_running_job(session), a_job(session)
        jobs.start(session, seeding)
        steps.add(session, seeding, "propose", {})
        assert [begun.state, seeding.state] == ["running", "running"]
        assert does(session, begun, seeding) == ["queued: no worker"] * 2
        crew(session, SOLVER, state=WorkerState.PAUSED)
        assert does(session, begun, seeding) == ["queued: all workers paused"] * 2
        crew(session, SOLVER, state=WorkerState.DRAINING)
        assert does(session, begun) == ["queued: no worker"], "one that ends takes none"


def test_a_job_that_has_not_begun_does_not_come_next_where_nobody_would_work_on_it(db: Database) -> None:
    with db.write() as session:
        crew(session, CONTROL)
        new = a_job(session)
        assert does(session, new) == ["queued: no worker"]
        crew(session, SOLVER, state=WorkerState.PAUSED)
        assert does(session, new) == ["queued: all workers paused"]
        workers.leave(session, SOLVER.process)
        crew(session, SOLVER)
        assert does(session, new) == ["queued: next"]


def test_a_worker_that_starts_is_there_and_takes_no_work_yet(db: Database) -> None:
    with db.write() as session:
        crew(session, CONTROL)
        begun, new = a_running_job(session), a_job(session)
        for state, said in ((WorkerState.STARTING, activity.STARTING), (WorkerState.COMPILING, activity.COMPILING)):
            crew(session, SOLVER, state=state)
            assert does(session, begun, new) == [f"queued: {said}"] * 2
        other = replace(SOLVER, process="host:2:1")
        crew(session, other, state=WorkerState.PAUSED)
        assert does(session, begun) == [f"queued: {activity.COMPILING}"], "it goes on by itself, and nobody has to resume the other"
        crew(session, other)
        assert does(session, begun) == ["queued: next"]


def test_a_worker_that_is_silent_for_a_minute_is_none(db: Database) -> None:
    with db.write() as session:
        crew(session, SOLVER, CONTROL)
        job = a_running_job(session)
        assert does(session, job) == ["queued: next"]
        session.execute(update(WorkerRow).values(seen_at=clock.now(session) - timedelta(seconds=61)))
        assert does(session, job) == ["queued: no worker"]


def test_a_job_that_nobody_has_decided_about_waits_for_a_control_worker(db: Database) -> None:
    with db.write() as session:
        first, second, third = (a_job(session) for _ in range(3))
        assert does(session, first) == ["queued: no worker"]
        crew(session, SOLVER)
        assert does(session, first) == ["queued: no control worker"]
        crew(session, CONTROL, state=WorkerState.PAUSED)
        assert does(session, first) == ["queued: all control workers paused"]
        crew(session, CONTROL)
        assert does(session, third, first, second) == ["queued: behind 2 others", "queued: next", "queued: behind 1 other"]


def test_jobs_wait_behind_those_that_get_a_worker_first(db: Database) -> None:
    with db.write() as session:
        crew(session, SOLVER, CONTROL)
        waiting = [a_running_job(session) for _ in range(3)]
        for row, served in zip(waiting, (2.0, 0.0, 1.0), strict=True):
            row.served = served
        session.flush()
        assert does(session, *waiting) == ["queued: behind 2 others", "queued: next", "queued: behind 1 other"]


def test_who_keeps_what_was_asked_about_all_jobs_still_places_one_that_came_since(db: Database) -> None:
    kept = activity.Kept()
    with db.write() as session:
        crew(session, SOLVER, CONTROL)
        first = a_job(session)
        assert activity.of_jobs(session, [first], kept) == {first.id: "queued: next"}
        second = a_job(session)
        assert activity.of_jobs(session, [second], kept) == {second.id: "queued: behind 1 other"}
        workers.leave(session, CONTROL.process)
        assert activity.of_jobs(session, [first], kept) == {first.id: "queued: next"}, "the database was not asked again"
        assert does(session, first) == ["queued: no control worker"]


def test_jobs_of_other_projects_count_among_the_others(db: Database) -> None:
    with db.write() as session:
        crew(session, SOLVER, CONTROL)
        for _ in range(2):
            a_running_job(session)
        projects.add(session, "other")
    with db.of("other").write() as session:
        assert projects.get(session, "other").name != DEFAULT_PROJECT
        row = scenes.add(session, slider())
        job, _ = jobs.create(session, kind="grow", scene_id=row.id, options={"random_seed": 0})
        jobs.start(session, job, served=5.0)
        steps.add(session, job, "propose", {})
        session.flush()
        assert does(session, job) == ["queued: behind 1 other"]  # projects take turns, so it comes before the second job of the first one


def test_a_job_works_while_a_lease_lasts_and_is_stalled_after_it(db: Database) -> None:
    with db.write() as session:
        crew(session, SOLVER, CONTROL)
        job = a_running_job(session)
        claimed(session, job)
        assert does(session, job) == ["working"]
        session.execute(update(PairRow).values(lease_until=clock.now(session) - timedelta(seconds=1)))
        assert does(session, job) == ["stalled: its worker gives no sign of life"]


def test_a_job_works_while_somebody_decides(db: Database) -> None:
    with db.write() as session:
        crew(session, SOLVER, CONTROL)
        job = a_job(session)
        jobs.coordinate(job, clock.now(session), 60)
        session.flush()
        assert does(session, job) == ["working"]


def test_a_cover_that_ends_is_not_called_cancelled(db: Database) -> None:
    """Nobody has cancelled it: it stops the jobs of its last regions."""
    with db.write() as session:
        crew(session, SOLVER, CONTROL)
        cover = a_job(session)
        cover.state = JobState.RUNNING
        first, second = (a_job(session) for _ in range(2))
        for child in (first, second):
            child.parent_id = cover.id
        first.state = JobState.CANCELLING
        session.flush()
        assert does(session, cover) == ["queued: next"], "the second one goes on"
        second.state = JobState.CANCELLING
        session.flush()
        assert does(session, cover) == ["ending: what it has begun is being stopped"]


def test_who_keeps_what_was_asked_sees_work_that_came_since(db: Database) -> None:
    kept = activity.Kept()
    with db.write() as session:
        crew(session, CONTROL)
        former, job, cover = (a_job(session) for _ in range(3))
        for row in (former, job, cover):
            jobs.start(session, row)
        steps.add(session, former, "propose", {})
        assert activity.of_jobs(session, [former, job, cover], kept) == {
            former.id: "queued: no worker",
            job.id: "queued: next",
            cover.id: "queued: next",
        }
        steps.add(session, job, "propose", {})
        child = a_job(session, parent_id=cover.id, number=0)
        jobs.start(session, child)
        steps.add(session, child, "propose", {})
        assert activity.of_jobs(session, [job, cover], kept) == {job.id: "queued: no worker", cover.id: "queued: no worker"}


def test_a_cover_works_while_its_regions_grow_although_it_lost_its_own_worker(db: Database) -> None:
    with db.write() as session:
        crew(session, SOLVER, CONTROL)
        cover = a_job(session)
        jobs.start(session, cover)
        child = a_job(session, parent_id=cover.id, number=0)
        jobs.start(session, child)
        for row in (cover, child):
            step = steps.add(session, row, "propose", {})
            session.flush()
            step.state, step.lease_until = leases.RUNNING, clock.now(session) + timedelta(seconds=-1 if row is cover else 60)
        session.flush()
        assert does(session, cover, child) == ["working", "working"]


@pytest.mark.parametrize("working", [True, False])
def test_a_cover_does_what_its_regions_do(db: Database, working: bool) -> None:
    with db.write() as session:
        crew(session, CONTROL)
        cover = a_job(session)
        jobs.start(session, cover)
        grown = [a_job(session, parent_id=cover.id, number=number) for number in range(2)]
        for row in grown:
            jobs.start(session, row)
            steps.add(session, row, "propose", {})
        if working:
            claimed(session, grown[1])
        assert does(session, cover) == ["working" if working else "queued: no worker"]


def test_the_others_are_in_their_state(db: Database) -> None:
    with db.write() as session:
        ended, cancelling = a_job(session), a_running_job(session)
        jobs.cancel(session, ended.id)
        claimed(session, cancelling)
        jobs.cancel(session, cancelling.id)
        session.refresh(ended)
        session.refresh(cancelling)
        assert does(session, ended, cancelling) == [JobState.CANCELLED, JobState.CANCELLING]
