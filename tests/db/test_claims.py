"""Claims and results of pairs: nobody works twice, nothing is lost, the first failure ends the iteration, on both databases."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import numpy as np
import pytest
from sqlalchemy import select, update

from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult, Weakness
from db import events, jobs, leases, pairs, steps, work
from db.models import IterationRow, PairRow, ProofRow, StepRow
from db.session import Database
from db.states import IterationState, JobState, PairState, StepState, transition_each
from db.types import utcnow
from tests.db.builders import a_running_job, all_pairs, certified

ELSEWHERE = "elsewhere:1:1"


def claim(db: Database, job_id: str, batch_seconds: float = 0.5) -> pairs.Claim | None:
    """Claims the next pairs of the job; the builders' pairs take 1 s each."""
    with db.write() as session:
        held = work.claim(session, job_id, lease_seconds=60, batch_seconds=batch_seconds)
        assert held is None or isinstance(held, pairs.Claim)
        return held


def save(db: Database, held: pairs.Claim, results: dict[tuple[int, int], PairResult]) -> pairs.Saved:
    with db.write() as session:
        return pairs.save(session, held, results)


def refuted(index: int) -> dict[tuple[int, int], PairResult]:
    return {(index, 0): PairResult(Outcome.REFUTED, Stage.SCREEN, seconds=0.1, witness_s=np.array([0.5]))}


def claim_and_certify(url: str, job_id: str, out: multiprocessing.Queue) -> None:  # type: ignore[type-arg]
    """Takes single pairs until none is left; runs in several processes at once."""
    db = Database(url)
    while (held := claim(db, job_id)) is not None:
        index = held.pairs[0].index
        out.put((index, save(db, held, certified(index)).finished))
    db.close()


def test_a_pair_is_expected_to_take_what_it_took_or_else_what_was_forecast(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 3).id
    held = claim(db, job_id)
    assert held is not None
    save(db, held, certified(0))
    with db.read() as session:
        assert pairs.expected_seconds(session, job_id, 0) == {0: 0.1, 1: 1.0, 2: 1.0}
        assert pairs.expected_seconds(session, job_id, 1) == {}


def test_processes_that_race_for_pairs_never_share_one(db: Database, database_url: str) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 40).id
    context = multiprocessing.get_context("spawn")
    out = context.Queue()
    workers = [context.Process(target=claim_and_certify, args=(database_url, job_id, out)) for _ in range(2)]
    for worker in workers:
        worker.start()
    done = [out.get(timeout=60) for _ in range(40)]
    for worker in workers:
        worker.join(60)
    assert Counter(index for index, _ in done) == Counter(range(40))
    assert sum(finished for _, finished in done) == 1
    with db.read() as session:
        assert session.get_one(IterationRow, (job_id, 0)).state == IterationState.CERTIFIED
        assert all(row.attempts == 1 for row in all_pairs(session, job_id))
        assert len(session.scalars(select(ProofRow)).all()) == 1


def test_threads_that_race_for_batches_never_share_a_pair(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 12).id
    with ThreadPoolExecutor(6) as pool:
        held = list(pool.map(lambda _: claim(db, job_id, batch_seconds=2.5), range(8)))
    taken = Counter(pair.index for one in held if one is not None for pair in one.pairs)
    assert taken == Counter(range(12))


def test_batches_are_longer_while_very_many_pairs_are_open(db: Database) -> None:
    """So a hundred workers do not queue for the job. Towards the end each takes a pair again, and none waits for another."""
    with db.write() as session:
        job_id = a_running_job(session, 2500).id
    many = claim(db, job_id)
    assert many is not None
    assert len(many.pairs) == 2
    most = claim(db, job_id, batch_seconds=1e9)
    assert most is not None
    assert len(most.pairs) == pairs.MOST_TOGETHER
    while (held := claim(db, job_id, batch_seconds=1e9)) is not None:
        with db.read() as session:
            if jobs.get(session, job_id).open_pairs < pairs.FEW:
                break
    few = claim(db, job_id)
    assert held is not None
    assert few is not None
    assert len(few.pairs) == 1


def test_a_claim_is_refused_when_the_job_is_not_running(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session).id
        jobs.cancel(session, job_id)
    assert claim(db, job_id) is None


def test_the_first_failure_in_the_order_of_the_pairs_counts_whenever_it_comes(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 5).id
    first, second, third = claim(db, job_id, batch_seconds=2.5), claim(db, job_id), claim(db, job_id)
    assert first is not None
    assert second is not None
    assert third is not None
    assert save(db, second, refuted(2)) == pairs.Saved(held=False, finished=False)
    with db.read() as session:
        assert [row.state for row in all_pairs(session, job_id)] == ["running", "running", "refuted", "skipped", "skipped"]
    assert save(db, third, certified(3)) == pairs.Saved(held=False, finished=False)
    assert save(db, first, certified(0)) == pairs.Saved(held=True, finished=False)
    assert save(db, first, refuted(1)) == pairs.Saved(held=False, finished=True)
    with db.read() as session:
        rows, iteration = all_pairs(session, job_id), session.get_one(IterationRow, (job_id, 0))
        assert [row.state for row in rows] == ["certified", "refuted", "refuted", "skipped", "skipped"]
        assert [row.pair_index for row in pairs.reached(session, iteration)] == [0, 1]
        assert rows[1].witness_s == [0.5]
        assert iteration.state == IterationState.FAILED
        assert [e.kind for e in events.since(session, job_id)][-2:] == ["pairs", "iteration"]
        assert len(session.scalars(select(ProofRow)).all()) == 1


def test_an_iteration_may_wait_for_several_failures(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 5, failures=2).id
    first, second, third = claim(db, job_id, batch_seconds=2.5), claim(db, job_id), claim(db, job_id)
    assert first is not None
    assert second is not None
    assert third is not None
    assert save(db, third, refuted(3)) == pairs.Saved(held=False, finished=False)
    assert save(db, second, refuted(2)) == pairs.Saved(held=False, finished=False)
    with db.read() as session:
        assert [row.state for row in all_pairs(session, job_id)] == ["running", "running", "refuted", "refuted", "skipped"]
    assert save(db, first, refuted(0)) == pairs.Saved(held=True, finished=False)
    assert save(db, first, certified(1)) == pairs.Saved(held=False, finished=True)
    with db.read() as session:
        iteration = session.get_one(IterationRow, (job_id, 0))
        assert [row.pair_index for row in pairs.reached(session, iteration)] == [0, 1, 2]
        assert iteration.state == IterationState.FAILED


def test_a_failure_ends_the_batch_that_it_is_in(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 3).id
    held = claim(db, job_id, batch_seconds=5)
    assert held is not None
    assert save(db, held, refuted(0)) == pairs.Saved(held=False, finished=True)


def test_without_early_end_every_pair_gets_its_verdict(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 2, failures=None).id
    held = claim(db, job_id, batch_seconds=3)
    assert held is not None
    failed = PairResult(Outcome.NOT_CERTIFIABLE, Stage.SOS, seconds=0.1, weakness=Weakness(np.array([[0.1]]), np.zeros(1)))
    assert not save(db, held, {(0, 0): failed}).finished
    assert save(db, held, certified(1)).finished
    with db.read() as session:
        assert [row.state for row in all_pairs(session, job_id)] == ["not_certifiable", "certified"]
        assert set(pairs.proving(session, job_id, {0: 0, 1: 0})) == {1}
        assert [row.pair_index for row in pairs.reached(session, session.get_one(IterationRow, (job_id, 0)))] == [0, 1]


def test_a_lease_that_ran_out_is_released_and_its_result_is_then_refused(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 1).id
    first = claim(db, job_id)
    assert first is not None
    assert claim(db, job_id) is None
    with db.write() as session:
        row = session.scalars(select(PairRow)).one()
        row.worker, row.lease_until = ELSEWHERE, utcnow() - timedelta(seconds=1)
    with db.write() as session:
        assert leases.lost(session, PairRow, by_time=False) == []
        (lease,) = leases.lost(session, PairRow, by_time=True)
        assert lease == leases.Lost(job_id, first.token, ELSEWHERE, "its lease ran out", alone=False)
        assert [row.pair_index for row in pairs.release(session, jobs.lock(session, job_id), lease)] == [0]
    second = claim(db, job_id)
    assert second is not None
    assert second.pairs == (pairs.Claimed(0, part=0, attempt=2, deaths=0),)
    assert not save(db, first, certified(0)).held
    assert save(db, second, certified(0)).finished


def test_a_lease_of_this_host_ends_with_its_process(db: Database) -> None:
    process = multiprocessing.get_context("spawn").Process(target=os.getpid)
    process.start()
    worker = f"{leases.this_worker().split(':')[0]}:{process.pid}:{leases._started(process.pid or 0)}"
    with db.write() as session:
        job_id = a_running_job(session, 1).id
    assert claim(db, job_id) is not None
    with db.write() as session:
        assert leases.lost(session, PairRow, by_time=True) == []
        session.scalars(select(PairRow)).one().worker = worker
    process.join()
    with db.read() as session:
        (lease,) = leases.lost(session, PairRow, by_time=False)
    assert (lease.job_id, lease.worker, lease.reason, lease.alone) == (job_id, worker, "its process died", True)
    with db.write() as session:
        session.scalars(select(PairRow)).one().parent = worker
    with db.write() as session:
        (lease,) = leases.lost(session, PairRow, by_time=False)
        assert (lease.reason, lease.alone) == ("its worker ended", False)
        pairs.release(session, jobs.lock(session, job_id), lease)
        assert session.scalars(select(PairRow)).one().deaths == 0
    assert leases.is_alive(leases.this_worker()) is True
    assert leases.is_alive(ELSEWHERE) is None


def test_another_process_space_of_the_same_name_is_another_host(monkeypatch: pytest.MonkeyPatch) -> None:
    here = leases.this_worker()
    leases._host.cache_clear()
    monkeypatch.setattr(os, "readlink", lambda path: "pid:[1]")
    try:
        assert leases.is_alive(here) is None
        assert leases.this_worker().split(".")[0] == here.split(".")[0]
    finally:
        leases._host.cache_clear()


def test_what_may_have_killed_its_process_is_claimed_alone(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 4).id
        session.execute(update(PairRow).where(PairRow.pair_index < 2).values(attempts=1, deaths=1))
    claimed = []
    while (held := claim(db, job_id, batch_seconds=5)) is not None:
        claimed.append([(pair.index, pair.attempt) for pair in held.pairs])
    assert claimed == [[(2, 1), (3, 1)], [(0, 2)], [(1, 2)]]


def test_a_renewed_lease_does_not_run_out(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 1).id
    held = claim(db, job_id)
    assert held is not None
    with db.read() as session:
        row = session.scalars(select(PairRow)).one()
        before, since = row.lease_until, row.lease_since
    with leases.kept(db, PairRow, held.token, seconds=0.2, job_states=[JobState.RUNNING]):
        until = utcnow() + timedelta(seconds=10)
        while utcnow() < until:
            with db.read() as session:
                row = session.scalars(select(PairRow)).one()
            assert before is not None
            assert row.lease_until is not None
            if row.lease_until != before:
                assert since == row.lease_since, "it began when it was claimed"
                return
            time.sleep(0.05)
    raise AssertionError("the lease was never renewed")


def hold(url: str, token: str, states: list[str]) -> None:
    """Works for ever."""
    db = Database(url)
    with leases.kept(db, PairRow, token, 60, states):
        while True:
            time.sleep(1)


@pytest.mark.parametrize("what", ["skipped", "cancelled"])
def test_a_holder_whose_work_is_not_wanted_any_more_dies(db: Database, database_url: str, what: str) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 1).id
    held = claim(db, job_id)
    assert held is not None
    process = multiprocessing.get_context("spawn").Process(target=hold, args=(database_url, held.token, [JobState.RUNNING]))
    process.start()
    process.join(3)
    assert process.exitcode is None
    with db.write() as session:
        if what == "skipped":
            pairs.skip(session, jobs.lock(session, job_id))
        else:
            jobs.cancel(session, job_id)
    process.join(30)
    assert process.exitcode == -signal.SIGKILL


def test_a_step_is_done_once_and_accepting_survives_a_cancel(db: Database) -> None:
    with db.write() as session:
        job = a_running_job(session, 0)
        steps.add(session, job, "propose", {})
        steps.add(session, job, "accept", {})
        job_id = job.id
    held = claim_step(db, job_id)
    assert held is not None
    assert held.kind == "propose"
    with db.write() as session:
        assert steps.save(session, held, StepState.DONE, {"x": 1}, 0.5)
        assert not steps.save(session, held, StepState.DONE, {"x": 2}, 0.5)
        jobs.cancel(session, job_id)
        steps.skip(session, job_id)
    with db.read() as session:
        assert {row.kind: (row.state, row.report) for row in steps.of_job(session, job_id)} == {
            "propose": ("done", {"x": 1}),
            "accept": ("open", None),
        }
    assert claim_step(db, job_id) is not None
    with db.write() as session:
        session.execute(update(StepRow).values(state=StepState.OPEN))
        jobs.finish(session, jobs.lock(session, job_id), JobState.CANCELLED, reason="asked")
    assert claim_step(db, job_id) is None


def claim_step(db: Database, job_id: str) -> steps.Claim | None:
    with db.write() as session:
        held = work.claim(session, job_id, lease_seconds=60, batch_seconds=0.5)
        assert held is None or isinstance(held, steps.Claim)
        return held


@pytest.mark.parametrize("outcome", [StepState.DONE, StepState.FAILED])
def test_the_latest_region_is_accepted_and_an_earlier_one_only_if_it_is_refused(db: Database, outcome: StepState) -> None:
    with db.write() as session:
        job = a_running_job(session, 0)
        for turn in (1, 2):
            job.turn = turn
            steps.add(session, job, "accept", {"turn": turn})
        job_id = job.id
    held = claim_step(db, job_id)
    assert held is not None
    assert held.input == {"turn": 2}
    assert claim_step(db, job_id) is None
    with db.write() as session:
        steps.save(session, held, outcome, {}, 0.1)
    earlier = claim_step(db, job_id)
    if outcome == StepState.DONE:
        assert earlier is None
    else:
        assert earlier is not None
        assert earlier.input == {"turn": 1}


@pytest.mark.parametrize(
    ("parts", "whole"),
    [
        ("certified", "certified"),
        ("open open", "open"),
        ("open certified", "running"),
        ("certified running", "running"),
        ("certified inconclusive", "inconclusive"),
        ("inconclusive refuted too_close", "refuted"),
        ("certified skipped", "skipped"),
        ("certified error", "error"),
    ],
)
def test_a_pair_is_in_the_worst_state_of_its_parts_once_all_are_settled(parts: str, whole: str) -> None:
    for states in itertools.permutations(map(PairState, parts.split())):
        assert pairs.state_of_parts(states) == whole


def test_a_lease_goes_by_the_databases_clock(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker whose clock is an hour ahead holds its pairs no longer than others, and one whose clock is slow does not lose them.

    On SQLite all are on one machine, so they have one clock.
    """
    for wrong in (timedelta(hours=1), timedelta(hours=-1)):
        with db.write() as session:
            job_id = a_running_job(session, 1).id
        monkeypatch.setattr("db.clock.utcnow", lambda wrong=wrong: utcnow() + wrong)
        held = claim(db, job_id)
        assert held is not None
        leases._renew(db, PairRow, held.token, 60)
        with db.write() as session:
            (row,) = leases.of_job(session, PairRow, job_id)
            row.worker = ELSEWHERE
            assert row.lease_until is not None
            ahead = wrong if db.sqlite else timedelta()
            assert abs((row.lease_until - utcnow() - ahead).total_seconds() - 60) < 5
        with db.read() as session:
            assert [lost for lost in leases.lost(session, PairRow, by_time=True) if lost.job_id == job_id] == []


def test_settled_pairs_move_together_and_only_where_they_may(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 3).id
        rows = {row.pair_index: row.id for row in all_pairs(session, job_id)}
        moves = {rows[0]: (PairState.CERTIFIED, {"margin": 0.5}), rows[1]: (PairState.REFUTED, {"margin": None})}
        with pytest.raises(ValueError, match="no row may go from open"):
            transition_each(session, PairRow, PairState.OPEN, moves)
        transition_each(session, PairRow, PairState.RUNNING, moves)  # they are open, so they stay
        session.expire_all()
        assert {row.state for row in all_pairs(session, job_id)} == {"open"}
        leases.take(session, PairRow, list(rows.values())[:2], seconds=60)
        transition_each(session, PairRow, PairState.RUNNING, moves)
        session.expire_all()
        assert [(row.state, row.margin) for row in all_pairs(session, job_id)] == [("certified", 0.5), ("refuted", None), ("open", None)]
