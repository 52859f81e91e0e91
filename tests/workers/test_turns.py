"""Coordination, called directly, on a real queue without workers and on both databases."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select, update
from sqlalchemy.exc import OperationalError

from certifier.errors import CirisError
from certifier.outcome import Outcome
from certifier.pair.forecast import forecast
from db import jobs, leases, pairs, projects, regions, retention, solver_time, steps, transaction, workers
from db.models import DEFAULT_PROJECT, JobRow, PairRow, ProofRow, StepRow
from db.session import database
from db.settings import settings
from db.states import WorkerState
from db.types import utcnow
from db.workers import Made, WorkerKind
from jobs import admission
from jobs.scenes import load_scene
from tests.db.builders import a_job, add_iteration
from tests.scenes import slider
from tests.services import Queue
from tests.workers.options import box_around, grow_box
from tests.workers.service import environment, events_of, job_of, pairs_of, submit
from tests.workers.turning import ELSEWHERE, Away, work_all
from workers import sweeper, turns
from workers.app import SOLVE, waiting
from workers.solver import Piece, work
from workers.turns import coordinate

pytestmark = pytest.mark.usefixtures("here")


def test_a_job_begins_once_however_often_it_is_coordinated(job_id: str) -> None:
    before = [(event.seq, event.kind) for event in events_of(job_id)]
    for _ in range(3):
        coordinate(job_id)
    assert [(event.seq, event.kind) for event in events_of(job_id)] == before
    assert [row.state for row in pairs_of(job_id)] == ["open"] * 3
    assert (waiting(SOLVE), job_of(job_id).turn) == (1, 1)


def test_work_is_done_once(job_id: str) -> None:
    with environment(CIRIS_BATCH_SECONDS="1e-9"):
        assert work_all() == [Piece(job_id, False), Piece(job_id, False), Piece(job_id, True)]
    assert [(row.state, row.attempts) for row in pairs_of(job_id)] == [("certified", 1)] * 3


def test_what_solvers_do_for_a_job_counts_for_its_project(job_id: str) -> None:
    while work_all():
        coordinate(job_id)
    with database().read() as session:
        accepting = sum(step.seconds or 0.0 for step in steps.of_job(session, job_id))
        spent = (pairs.seconds(session, job_id), accepting, solver_time.used(session, DEFAULT_PROJECT))
    assert min(spent) > 0
    assert spent[2] == pytest.approx(spent[0] + spent[1])


def of_another_project(job_id: str) -> None:
    with database().write() as session:
        projects.add(session, "others")
        session.execute(update(JobRow).where(JobRow.id == job_id).values(project="others"))


def test_the_rest_of_a_batch_is_given_back_when_another_project_waits(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SAVE_SECONDS", "HELD_SECONDS"):
        monkeypatch.setattr(f"workers.pairs.{name}", 0.0)
    other = submit(slider(posts=3), box_around([0.0], 0.1))
    coordinate(other)
    of_another_project(other)
    before = job_of(job_id).served
    assert work() == Piece(job_id, False)
    assert [(row.state, row.attempts) for row in pairs_of(job_id)] == [("certified", 1), ("open", 0), ("open", 0)]
    job, done = job_of(job_id), pairs_of(job_id)[0].seconds
    assert (job.open_pairs, job.running_pairs) == (2, 0)
    assert job.served - before == pytest.approx(done), "it is charged for what it took, whatever was forecast"
    assert {piece.job_id for piece in work_all()} == {job_id, other}
    assert {row.state for job in (job_id, other) for row in pairs_of(job)} == {"certified"}


def test_the_rest_of_a_batch_is_given_back_at_once_for_a_job_that_nobody_has_begun(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("workers.pairs.SAVE_SECONDS", 0.0)
    other = submit(slider(posts=3), box_around([0.0], 0.2))
    coordinate(other)
    first, second = work(), work()
    assert first is not None
    assert second is not None
    assert (first.settles, {first.job_id, second.job_id}) == (False, {job_id, other}), "the other job has the next solver"
    begun = pairs_of(first.job_id)
    assert [(row.state, row.attempts) for row in begun] == [("certified", 1), ("open", 0), ("open", 0)]
    assert second.settles, "for a job that was begun nobody gives a batch back before its time"
    work_all()
    assert {row.state for job in (job_id, other) for row in pairs_of(job)} == {"certified"}


def test_a_batch_is_done_to_its_end_while_nobody_else_waits(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SAVE_SECONDS", "HELD_SECONDS"):
        monkeypatch.setattr(f"workers.pairs.{name}", 0.0)
    assert work() == Piece(job_id, True)


def test_a_long_step_is_given_up_for_a_job_of_another_project(job_id: str) -> None:
    """Two jobs seed, on the two processes that there are."""
    of_another_project(job_id)
    claims = []
    with database().write() as session:
        workers.tell(session, Made("host:1:1", WorkerKind.SOLVE, "1", 2, cores=2, memory_bytes=1), WorkerState.RUNNING)
        for _ in range(2):
            job = a_job(session)
            jobs.start(session, job)
            steps.add(session, job, "propose", {})
            claims.append(steps.claim(session, job, accepts=False, lease_seconds=60))
    sweeper.give_way()
    with database().read() as session:
        assert [row.state for row in session.scalars(select(StepRow).order_by(StepRow.id))] == ["running", "open"]
    assert claims[1] is not None
    lost = [event.data for event in events_of(claims[1].job_id) if event.kind == "lost"]
    assert [(one["step"], one["reason"]) for one in lost] == [("propose", "another project had no solver")]
    assert waiting(SOLVE) > 0
    with database().write() as session:  # what was given up begins again, and is not given up again
        again = steps.claim(session, jobs.lock(session, claims[1].job_id), accepts=False, lease_seconds=60)
        assert (again is not None, again and again.attempt) == (True, 2)
        session.execute(update(StepRow).where(StepRow.id == claims[0].step_id).values(attempts=2))  # type: ignore[union-attr]
    sweeper.give_way()
    with database().read() as session:
        assert [row.state for row in session.scalars(select(StepRow).order_by(StepRow.id))] == ["running", "running"]


def test_no_step_is_given_up_for_a_job_of_the_same_key(job_id: str) -> None:
    """It is new, and gets the process that a worker has for new jobs."""
    with database().write() as session:
        workers.tell(session, Made("host:1:1", WorkerKind.SOLVE, "1", 2, cores=2, memory_bytes=1), WorkerState.RUNNING)
        for _ in range(2):
            job = a_job(session)
            jobs.start(session, job)
            steps.add(session, job, "propose", {})
            steps.claim(session, job, accepts=False, lease_seconds=60)
    sweeper.give_way()
    with database().read() as session:
        assert [row.state for row in session.scalars(select(StepRow))] == ["running", "running"]


def test_a_pair_that_failed_is_expected_to_take_as_long_the_next_time() -> None:
    free = slider()
    cart, post = free.geometries
    job_id = submit(replace(free, geometries=(cart, replace(post, vertices=np.array([[0.6, 0.0, 0.0]])))), grow_box([0.0], 0.9, paper={}))
    for _ in range(2):
        coordinate(job_id)
        work_all()
    coordinate(job_id)
    first, second = pairs_of(job_id)
    assert (first.iteration, first.state, second.iteration) == (0, "refuted", 1)
    assert second.forecast_seconds == first.seconds


def test_a_cancelled_job_ends_with_its_open_pairs_skipped(job_id: str) -> None:
    with database().write() as session:
        jobs.cancel(session, job_id)
    assert not work()
    coordinate(job_id)
    assert [row.state for row in pairs_of(job_id)] == ["skipped"] * 3
    job = job_of(job_id)
    assert (job.state, job.outcome, job.region_id) == ("cancelled", None, None)
    assert events_of(job_id)[-1].data["state"] == "cancelled"


def test_a_poison_pair_ends_as_an_error_with_its_cause(job_id: str) -> None:
    with database().write() as session:
        session.execute(update(PairRow).where(PairRow.pair_index == 1).values(deaths=3))
    work_all()
    coordinate(job_id)
    assert [row.state for row in pairs_of(job_id)] == ["certified", "error", "certified"]
    job = job_of(job_id)
    assert (job.state, job.outcome) == ("failed", Outcome.ERROR)
    assert job.error is not None
    assert job.error["code"] == "worker_lost"


def died(job_id: str, parent: str, *, deaths: int, attempts: int) -> None:
    """Leaves a coordinator behind that died after others, and the process that had forked it."""
    gone = leases.this_worker() + "0"
    with database().write() as session:
        job = jobs.lock(session, job_id)
        job.coordinator, job.coordinator_parent, job.coordinator_until = gone, parent, utcnow() + timedelta(seconds=60)
        job.coordinator_deaths, job.coordinator_attempts = deaths, attempts


def test_workers_that_end_while_they_coordinate_do_not_end_the_job(job_id: str) -> None:
    work_all()
    died(job_id, leases.this_worker() + "0", deaths=2, attempts=20)
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.error, job.turn) == (None, 2)


def test_a_last_attempt_to_coordinate_that_is_under_way_is_waited_for(job_id: str) -> None:
    work_all()
    with database().write() as session:
        job = jobs.lock(session, job_id)
        job.coordinator, job.coordinator_until = ELSEWHERE, utcnow() + timedelta(seconds=60)
        job.coordinator_deaths, job.coordinator_attempts = 2, 3
    coordinate(job_id)
    assert job_of(job_id).state == "running"


@pytest.mark.parametrize(("deaths", "attempts"), [(2, 3), (0, 30)])
def test_a_coordination_that_always_dies_ends_the_job(job_id: str, deaths: int, attempts: int) -> None:
    work_all()
    died(job_id, leases.this_worker(), deaths=deaths, attempts=attempts)
    coordinate(job_id)
    error = job_of(job_id).error
    assert error is not None
    assert error["code"] == "coordination_failed"


def test_two_coordinators_do_not_work_at_once_and_a_dead_one_is_replaced(job_id: str) -> None:
    work_all()

    def held_by(worker: str, seconds: float) -> None:
        with database().write() as session:
            job = jobs.lock(session, job_id)
            job.coordinator, job.coordinator_until = worker, utcnow() + timedelta(seconds=seconds)

    held_by(ELSEWHERE, 60)
    coordinate(job_id)
    assert job_of(job_id).turn == 1
    held_by(ELSEWHERE, -1)
    coordinate(job_id)
    assert job_of(job_id).turn == 2


def test_a_polytope_that_is_none_ends_the_job_with_its_error() -> None:
    empty = box_around([0.0], -0.1)
    del empty["seed"]["center"]
    job_id = submit(slider(), empty)
    coordinate(job_id)
    work_all()
    coordinate(job_id)
    error = job_of(job_id).error
    assert error is not None
    assert error["code"] == "polytope_empty"


def test_options_that_cannot_be_used_end_the_job_with_their_error() -> None:
    job_id = submit(slider(), {"kind": "certify", "seed": {}})
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, (job.error or {})["code"]) == ("failed", "polytope_missing")


def test_a_step_whose_worker_dies_each_time_ends_the_job_with_its_cause() -> None:
    job_id = submit(slider(), grow_box([0.0], 0.1))
    coordinate(job_id)
    with database().write() as session:
        (step,) = steps.of_job(session, job_id)
        step.deaths = 3
    work_all()
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, (job.error or {})["code"]) == ("failed", "worker_lost")


def test_a_region_whose_proof_is_refused_is_never_stored(job_id: str) -> None:
    work_all()
    coordinate(job_id)
    with database().write() as session:
        session.execute(update(ProofRow).values(data=b"not the proof that was verified"))
    work_all()
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, job.region_id, job.reason) == ("failed", None, "the verifier refused the proof")
    assert (job.error or {})["code"] == "proof_malformed"
    with database().read() as session:
        assert not regions.page(session).rows


def test_a_certified_polytope_becomes_a_region_even_after_a_cancel(job_id: str) -> None:
    work_all()
    coordinate(job_id)
    with database().write() as session:
        jobs.cancel(session, job_id)
    coordinate(job_id)
    assert job_of(job_id).state == "cancelling"
    work_all()
    coordinate(job_id)
    job = job_of(job_id)
    assert job.state == "cancelled"
    with database().read() as session:
        assert regions.get(session, job.region_id or "").guarantee == "exact"


def test_a_solver_that_leaves_work_sends_for_another(job_id: str, own_queue: Queue) -> None:
    own_queue.flush()
    with environment(CIRIS_BATCH_SECONDS="1e-9"):
        for left in (1, 1, 0):
            own_queue.flush()
            assert work()
            assert waiting(SOLVE) == left


def delete(job_id: str) -> None:
    with database().write() as session:
        jobs.cancel(session, job_id)
        retention.delete_job(session, job_id, dependents=False)


@pytest.mark.parametrize("options", [box_around([0.0], 0.1), box_around([9.0], 0.1)], ids=["to be saved", "to be given up"])
def test_a_job_that_is_deleted_is_coordinated_no_more(options: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Its message may come after it, and it may go while a decision about it is made."""
    gone, going = (submit(slider(), options) for _ in range(2))
    delete(gone)
    coordinate(gone)
    decide = turns._Rows.decide

    def meanwhile(rows: Any, turn: Any) -> Any:
        delete(going)
        return decide(rows, turn)

    monkeypatch.setattr(turns._Rows, "decide", meanwhile)
    coordinate(going)
    with database().read() as session:
        assert session.scalars(select(JobRow)).all() == []


@pytest.mark.parametrize(
    ("limit", "value", "deadline", "message"),
    [
        ("CIRIS_PAIR_MEMORY_BYTES", "1000", None, "GiB of memory; a process may use"),
        ("CIRIS_TIME_LIMIT_SECONDS", "0.001", None, "the limit is 0 s"),
        ("CIRIS_TIME_LIMIT_SECONDS", "3600", 0.0, "the deadline is in"),
    ],
)
def test_a_job_that_cannot_fit_is_refused_before_anything_is_computed(
    database_url: str, own_queue: Queue, limit: str, value: str, deadline: float | None, message: str
) -> None:
    with environment(CIRIS_DATABASE_URL=database_url, CIRIS_REDIS_URL=own_queue.url, **{limit: value}):
        job_id = submit(slider(), box_around([0.0], 0.1))
        left = None if deadline is None else utcnow() + timedelta(seconds=deadline)
        with database().read() as session:
            scene_id = jobs.get(session, job_id).scene_id
        with pytest.raises(CirisError, match=message) as refused:
            admission.check(forecast(load_scene(scene_id)), settings(), left and (left - utcnow()).total_seconds())
        assert refused.value.code == "does_not_fit"
        if deadline is None:
            coordinate(job_id)
            job = job_of(job_id)
            assert (job.state, (job.error or {})["code"], pairs_of(job_id)) == ("failed", "does_not_fit", [])


def test_a_database_that_is_away_for_a_while_costs_no_result(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    failures = iter([True, True, False])
    save = pairs.save

    def fails_twice(*arguments: Any) -> pairs.Saved:
        if next(failures, False):
            raise OperationalError("SELECT 1", {}, Away())
        return save(*arguments)

    monkeypatch.setattr(pairs, "save", fails_twice)
    monkeypatch.setattr(transaction, "RETRY_SECONDS", 0.01)
    work_all()
    assert [(row.state, row.attempts) for row in pairs_of(job_id)] == [("certified", 1)] * 3


def test_a_region_is_had_from_an_earlier_polytope_when_the_proof_of_the_last_is_refused(job_id: str) -> None:
    work_all_pairs_and_forge_a_later_region(job_id)
    work_all()
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, job.reason) == ("failed", "the proof could not be stored")
    with database().read() as session:
        assert regions.get(session, job.region_id or "").iteration == 0


def work_all_pairs_and_forge_a_later_region(job_id: str) -> None:
    """Leaves two regions to be accepted: a good one, and a later one whose proofs do not exist."""
    while any(row.state == "open" for row in pairs_of(job_id)):
        work()
    coordinate(job_id)
    with database().write() as session:
        (good,) = steps.of_job(session, job_id)
        job, polytope = jobs.lock(session, job_id), {"C": [[1.0], [-1.0]], "d": [0.1, 0.1], "center": [0.0]}
        add_iteration(session, job, index=1, label="push", **polytope, pairs=[], reuse={}, hard=[], failures=1)
        session.add(StepRow(job_id=job_id, turn=good.turn + 1, kind="accept", input={**good.input, "iteration": 1, "proofs": {}}))
