"""Coordination and sweeping, called directly, on a real queue without workers and on both databases."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace
from datetime import timedelta
from functools import partial
from operator import add
from typing import Any

import numpy as np
import pytest
from kombu.exceptions import OperationalError as QueueError
from sqlalchemy import func, select, update
from sqlalchemy.exc import OperationalError

from certifier.errors import CirisError
from certifier.map.options import MapOptions
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.pair.forecast import forecast
from certifier.seeding.proposal import NO_ROOM
from db import activity, jobs, leases, pairs, projects, regions, retention, steps, transaction, workers
from db.models import IterationRow, JobRow, PairRow, ProofRow, StepRow, SubtreesRow
from db.session import database
from db.settings import settings
from db.states import WorkerState
from db.types import utcnow
from db.workers import Made, WorkerKind
from jobs import admission, growing
from jobs.scenes import load_scene
from tests.db.builders import a_job, add_iteration
from tests.scenes import slider
from tests.services import Queue
from tests.workers.options import box_around, grow_box
from tests.workers.record import check_record
from tests.workers.service import environment, events_of, job_of, pairs_of, submit
from workers import sweeper, turns
from workers.app import CONTROL, SOLVE, send_coordinate, waiting
from workers.solver import Piece, claim_piece, work
from workers.steps import carry_out
from workers.troubles import Troubles
from workers.turns import coordinate

ELSEWHERE = "elsewhere:1:1"
WHOLE = grow_box([0.0], 0.9, cells=600)


@pytest.fixture(autouse=True)
def _here(database_url: str, own_queue: Queue) -> Iterator[None]:
    """This process is the service."""
    own_queue.flush()
    with environment(CIRIS_DATABASE_URL=database_url, CIRIS_REDIS_URL=own_queue.url):
        yield


@pytest.fixture
def job_id() -> str:
    """A running job with three open pairs."""
    made = submit(slider(posts=3), box_around([0.0], 0.1))
    coordinate(made)
    return made


def test_a_job_begins_once_however_often_it_is_coordinated(job_id: str) -> None:
    before = [(event.seq, event.kind) for event in events_of(job_id)]
    for _ in range(3):
        coordinate(job_id)
    assert [(event.seq, event.kind) for event in events_of(job_id)] == before
    assert [row.state for row in pairs_of(job_id)] == ["open"] * 3
    assert (waiting(SOLVE), job_of(job_id).turn) == (1, 1)


def work_all() -> list[Piece]:
    """Does what is to be done until nothing is, and coordinates nothing."""
    return list(iter(work, None))


def test_work_is_done_once(job_id: str) -> None:
    with environment(CIRIS_BATCH_SECONDS="1e-9"):
        assert work_all() == [Piece(job_id, False), Piece(job_id, False), Piece(job_id, True)]
    assert [(row.state, row.attempts) for row in pairs_of(job_id)] == [("certified", 1)] * 3


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


def test_a_batch_is_done_to_its_end_while_nobody_else_waits(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SAVE_SECONDS", "HELD_SECONDS"):
        monkeypatch.setattr(f"workers.pairs.{name}", 0.0)
    assert work() == Piece(job_id, True)


def test_a_long_step_is_given_up_for_another_project(job_id: str) -> None:
    """The job of the other project has pairs. Two others seed, on the two processes that there are."""
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


def late(job_id: str) -> None:
    with database().write() as session:
        jobs.lock(session, job_id).deadline_at = utcnow() - timedelta(seconds=1)


def check_not_begun(job_id: str) -> None:
    job = job_of(job_id)
    assert (job.state, job.outcome, (job.error or {}).get("code")) == ("failed", Outcome.ERROR, "not_begun")
    assert job.reason == "the deadline was reached before a worker had done anything"


@pytest.mark.parametrize("begun", [False, True], ids=["nobody decided", "nobody worked"])
@pytest.mark.parametrize("asked", ["certify", "grow", "map"])
def test_a_job_that_nobody_began_by_its_deadline_has_failed(asked: str, begun: bool) -> None:
    options = {"certify": box_around([0.0], 0.1), "grow": WHOLE, "map": asdict(MapOptions()) | {"former": None}}[asked]
    job_id = submit(slider(posts=3), options, kind=asked)
    if begun:
        coordinate(job_id)
    late(job_id)
    coordinate(job_id)
    check_not_begun(job_id)


def test_a_map_whose_first_process_comes_after_the_deadline_has_failed() -> None:
    job_id = submit(slider(), asdict(MapOptions()) | {"former": None}, kind="map")
    coordinate(job_id)
    with database().write() as session:
        claim = steps.claim(session, jobs.lock(session, job_id), accepts=False, lease_seconds=60)
    assert claim is not None
    late(job_id)
    carry_out(claim)
    coordinate(job_id)
    check_not_begun(job_id)


def test_without_a_queue_deadlines_hold_and_it_is_said_that_it_is_away(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    cancelled, goes_on, troubles = submit(slider(), WHOLE), submit(slider(), WHOLE), Troubles()
    coordinate(cancelled)
    late(job_id)
    made = Made(leases.this_worker(), WorkerKind.CONTROL, "1", 1, cores=1, memory_bytes=1)
    with database().write() as session:
        jobs.cancel(session, cancelled)
        workers.tell(session, replace(made, process="host:1:1", kind=WorkerKind.SOLVE), WorkerState.RUNNING)

    def said() -> str:
        with database().write() as session:
            workers.tell(session, made, WorkerState.RUNNING, troubles.said())
            return activity.of_jobs(session, [jobs.get(session, goes_on)])[goes_on]

    with monkeypatch.context() as away:
        away.setattr(sweeper, "waiting", partial(raise_, QueueError("Timeout reading from socket")))
        sweeper.do_round(sweeper.Holders(), troubles)
    check_not_begun(job_id)
    assert (job_of(cancelled).state, job_of(goes_on).state) == ("cancelled", "queued")
    assert (troubles.said(), said()) == ("reaching the queue failed: it does not answer", "queued: the queue does not answer")
    sweeper.do_round(sweeper.Holders(), troubles)
    assert (troubles.said(), said()) == (None, "queued: next")


def test_a_deadline_ends_the_job_with_what_it_has(job_id: str) -> None:
    with environment(CIRIS_BATCH_SECONDS="1e-9"):
        assert work() == Piece(job_id, False)
    late(job_id)
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, job.outcome, job.reason) == ("succeeded", Outcome.INCONCLUSIVE, "the deadline was reached")


def test_what_hinders_a_proposal_is_told_and_explains_a_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "NOTE_S", 0.0)
    hindrance = f"the seed is 0.03 mm from contact of a and b{NO_ROOM}"
    job_id = submit(slider(), {"kind": "grow", "seed": {"q": [0.0]}})
    tell = growing._noting(job_id)
    tell({})
    assert "note" not in [event.kind for event in events_of(job_id)], "it waits for a worker"
    coordinate(job_id)
    tell({"faces": 31})
    assert events_of(job_id)[-1].data == {"text": "proposing, 0 s, 31 faces", "part": None, "faces": 31}
    tell({"faces": 31, "hindrance": hindrance})
    assert claim_piece()[0] is not None
    late(job_id)
    coordinate(job_id)
    assert (job_of(job_id).error or {})["message"] == f"the deadline was reached; {hindrance}"
    count = len(events_of(job_id))
    tell({})
    assert len(events_of(job_id)) == count, "the job has ended"


def test_a_cover_hears_of_the_proposals_of_its_regions(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "NOTE_S", 0.0)
    child = submit(slider(), {"kind": "grow", "seed": {"q": [0.0]}}, parent_id=job_id, number=2)
    coordinate(child)
    growing._noting(child)({"faces": 1})
    assert events_of(job_id)[-1].data == {"text": "region 2: proposing, 0 s, 1 face", "part": None}


def in_the_way() -> Scene:
    """A slider whose first post stands in its way, 0.4 m from where they touch at s = 0; the other is far off."""
    free = slider(posts=2)
    cart, post, other = free.geometries
    return replace(free, geometries=(cart, replace(post, vertices=np.array([[0.6, 0.0, 0.0]])), other))


def left_of(job_id: str, *, outlines: bool = False) -> dict[int, int]:
    """Pair index -> the last iteration whose subtrees, or outlines, are kept."""
    with database().read() as session:
        columns = (SubtreesRow.pair_index, SubtreesRow.iteration)
        kept = SubtreesRow.outline.is_not(None) if outlines else func.length(SubtreesRow.data) > 0
        rows = session.execute(select(*columns).where(SubtreesRow.job_id == job_id, kept).order_by(SubtreesRow.iteration))
        return {row.pair_index: row.iteration for row in rows}


@pytest.mark.lengthy
def test_a_whole_job_keeps_what_its_last_round_left_and_nothing_in_the_end() -> None:
    job_id = submit(in_the_way(), WHOLE)
    coordinate(job_id)
    work_all()
    coordinate(job_id)
    rounds = 0
    while any(row.state == "open" for row in pairs_of(job_id)):
        work_all()
        last = pairs_of(job_id)[-1].iteration
        failed = {row.pair_index for row in pairs_of(job_id) if row.iteration == last and row.state != "certified"}
        assert {pair: iteration for pair, iteration in left_of(job_id).items() if iteration == last} == dict.fromkeys(failed, last)
        assert {row.pair_index for row in pairs_of(job_id) if row.weakness} == failed
        rounds += bool(failed)
        coordinate(job_id)
        assert not any(row.weakness for row in pairs_of(job_id))
        following = {row.pair_index for row in pairs_of(job_id) if row.state == "open"}
        assert not following or set(left_of(job_id)) <= following, "what is certified is not gone on with"
    assert rounds >= 1
    rows = pairs_of(job_id)
    assert {row.state for row in rows} >= {"certified", "refuted"}
    proving = [row for row in rows if row.state == "refuted" or (row.state == "certified" and row.part == 0)]
    assert all((row.proof_digest is not None) == (row in proving) for row in rows)
    assert all((row.open_cells is None) == (row.state == "certified") for row in rows)
    work_all()
    coordinate(job_id)
    assert (job_of(job_id).state, left_of(job_id), left_of(job_id, outlines=True)) == ("succeeded", {}, {})
    check_record(job_id)


@pytest.mark.lengthy
def test_a_whole_job_that_is_cancelled_leaves_outlines_alone() -> None:
    job_id = begun_whole_job()
    before = left_of(job_id, outlines=True)
    assert before
    with database().write() as session:
        jobs.cancel(session, job_id)
    coordinate(job_id)
    assert (job_of(job_id).state, left_of(job_id), left_of(job_id, outlines=True)) == ("cancelled", {}, before)


@pytest.mark.lengthy
def test_a_whole_job_ends_at_its_deadline_with_its_best_region() -> None:
    job_id = submit(in_the_way(), WHOLE)
    while not any(row.label == "cells" and row.state == "certified" for row in iterations_of(job_id)):
        coordinate(job_id)
        work_all()
    coordinate(job_id)
    assert job_of(job_id).state == "running"
    with database().write() as session:
        jobs.lock(session, job_id).deadline_at = utcnow() - timedelta(seconds=1)
    coordinate(job_id)
    work_all()
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, job.outcome, job.reason) == ("succeeded", Outcome.CERTIFIED, "the deadline was reached")
    assert job.region_id is not None


@pytest.mark.lengthy
def test_a_whole_job_ends_when_nothing_is_known_of_a_failure() -> None:
    """There is nothing to cut off for a pair that kills its process, so another round would end as this one."""
    job_id = begun_whole_job()
    with database().write() as session:
        session.execute(update(PairRow).where(PairRow.state == "open").values(deaths=3))
    work_all()
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, (job.error or {})["code"]) == ("failed", "worker_lost")


def test_pairs_that_are_certified_cell_by_cell_need_not_fit_the_forecast() -> None:
    with environment(CIRIS_PAIR_MEMORY_BYTES="1000", CIRIS_DATABASE_URL=settings().database, CIRIS_REDIS_URL=settings().redis_url):
        job_ids = [submit(slider(), options) for options in (box_around([0.0], 0.1), {**box_around([0.0], 0.1), "cells": 20})]
        for job_id in job_ids:
            coordinate(job_id)
        assert [job_of(job_id).state for job_id in job_ids] == ["failed", "running"]


@pytest.mark.lengthy
@pytest.mark.parametrize(("upper", "outcome"), [(0.3, "certified"), (0.3999, "too_close"), (0.45, "refuted")])
def test_a_polytope_is_decided_cell_by_cell(upper: float, outcome: str) -> None:
    """The slider touches the post at s = 0.4."""
    job_id = submit(in_the_way(), {"kind": "certify", "seed": {"C": [[1.0], [-1.0]], "d": [upper, 0.9]}, "cells": 300})
    coordinate(job_id)
    work_all()
    coordinate(job_id)
    work_all()
    coordinate(job_id)
    first, second = pairs_of(job_id)
    assert (first.state, first.stage, second.state) == (outcome, "cells", "certified")
    job = job_of(job_id)
    assert (job.state, job.outcome, job.region_id is not None) == ("succeeded", outcome, outcome == "certified")
    assert left_of(job_id) == {}
    if outcome == "certified":
        assert first.witness_s is None
    else:
        (s,) = first.witness_s or []
        assert (s >= 0.4 - 1e-6) == (outcome == "refuted")
        assert s <= upper
    if outcome == "too_close":
        assert f"{0.4 - s:.3g} m apart" in (first.detail or "")


def begun_whole_job() -> str:
    """A job whose first round has left a partition; its second round is open."""
    job_id = submit(in_the_way(), WHOLE)
    for _ in range(2):
        coordinate(job_id)
        work_all()
    coordinate(job_id)
    assert left_of(job_id) == {0: 0}
    assert any(row.state == "open" for row in pairs_of(job_id))
    return job_id


def iterations_of(job_id: str) -> list[IterationRow]:
    with database().read() as session:
        return list(pairs.iterations(session, job_id))


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


def test_the_sweeper_sends_lost_messages_again(job_id: str, own_queue: Queue) -> None:
    own_queue.flush()
    sweeper.sweep()
    assert waiting(SOLVE) == 1
    sweeper.sweep()
    assert waiting(SOLVE) == 1
    work_all()
    own_queue.flush()
    sweeper.sweep()
    assert (waiting(SOLVE), waiting(CONTROL)) == (0, 1)


def test_a_paused_control_worker_is_asked_so_often_and_no_more(own_queue: Queue, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweeper, "ASKED", 3)
    for _ in range(5):
        submit(slider(), box_around([0.0], 0.1))
    own_queue.flush()
    for _ in range(4):
        sweeper.sweep()
        assert waiting(CONTROL) == 3


def test_the_sweeper_frees_what_a_lost_worker_held_and_says_why(job_id: str) -> None:
    with database().write() as session:
        pairs.claim(session, jobs.lock(session, job_id), lease_seconds=60, batch_seconds=60)
        gone = {"worker": ELSEWHERE, "lease_until": utcnow() - timedelta(seconds=1), "lease_token": "gone"}
        session.execute(update(PairRow).where(PairRow.pair_index == 0).values(gone))
    sweeper.sweep(by_time=False)
    assert [row.state for row in pairs_of(job_id)] == ["running"] * 3
    sweeper.sweep()
    assert [row.state for row in pairs_of(job_id)] == ["open", "running", "running"]
    assert waiting(SOLVE) == 2
    lost = events_of(job_id)[-1]
    assert (lost.kind, lost.data) == ("lost", {"worker": ELSEWHERE, "reason": "its lease ran out", "iteration": 0, "pairs": [0]})


def test_leases_are_not_ended_by_time_right_after_nobody_could_renew_them() -> None:
    holders, now = sweeper.Holders(), utcnow()

    def could_renew(*after: float) -> list[bool]:
        return [holders.could_renew(now + timedelta(seconds=seconds)) for seconds in after]

    assert could_renew(20, 40, 61) == [False, False, True]
    assert could_renew(200, 220, 240, 261) == [False, False, False, True]
    holders.could_not_write()
    assert could_renew(262) == [False]


def lose_a_lease(job_id: str) -> None:
    """A worker of another machine holds all pairs, and its leases have run out."""
    with database().write() as session:
        pairs.claim(session, jobs.lock(session, job_id), lease_seconds=60, batch_seconds=60)
        session.execute(update(PairRow).values(worker=ELSEWHERE, lease_until=utcnow() - timedelta(seconds=1)))


@pytest.mark.parametrize("chore", ["forget_gone", "forget_keys", "forget_audit", "expire", "shrink"])
def test_tidying_up_that_fails_keeps_nothing_from_being_taken_back(job_id: str, monkeypatch: pytest.MonkeyPatch, chore: str) -> None:
    done = []

    def fails() -> None:
        done.append(chore)
        raise OverflowError

    for name in ("forget_gone", "forget_keys", "forget_audit", "expire", "shrink"):
        monkeypatch.setattr(sweeper, name, fails if name == chore else partial(done.append, name))
    holders, troubles, now = sweeper.Holders(), Troubles(), utcnow()
    lose_a_lease(job_id)
    for seconds in range(0, 61, 20):
        assert {row.state for row in pairs_of(job_id)} == {"running"}, "their holders may renew them"
        monkeypatch.setattr(sweeper, "utcnow", partial(add, now, timedelta(seconds=seconds)))
        sweeper.do_round(holders, troubles)
    assert {row.state for row in pairs_of(job_id)} == {"open"}
    assert sorted(done) == sorted(["forget_gone", "forget_keys", "forget_audit", "expire", "shrink"] * 4)
    assert (troubles.said() or "").endswith("failed: OverflowError")
    monkeypatch.setattr(sweeper, chore, list)
    sweeper.do_round(holders, troubles)
    assert troubles.said() is None


def test_a_database_that_is_away_for_the_sweep_takes_no_lease_back(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    holders, troubles, now = sweeper.Holders(), Troubles(), utcnow()
    lose_a_lease(job_id)
    for seconds in range(0, 61, 20):
        with monkeypatch.context() as away:
            away.setattr(sweeper, "utcnow", partial(add, now, timedelta(seconds=seconds)))
            if seconds == 40:
                away.setattr(sweeper, "release_lost", partial(raise_, OperationalError("SELECT 1", {}, Away())))
            sweeper.do_round(holders, troubles)
        assert (troubles.said() is not None) == (seconds == 40)
    assert {row.state for row in pairs_of(job_id)} == {"running"}


def raise_(error: Exception, *_given: object, **_: object) -> None:
    raise error


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


class Away(Exception):
    """What SQLAlchemy's error wraps."""


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


def test_without_redis_a_job_is_kept_and_sent_by_the_sweeper(own_queue: Queue) -> None:
    own_queue.stop()
    try:
        job_id = submit(slider(), box_around([0.0], 0.1))
        assert not send_coordinate(job_id)
        assert job_of(job_id).state == "queued"
    finally:
        own_queue.start()
    own_queue.flush()
    sweeper.sweep()
    assert waiting(CONTROL) == 1
    with database().read() as session:
        assert session.get(JobRow, job_id) is not None
