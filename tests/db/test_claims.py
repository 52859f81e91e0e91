"""Claims and results of pairs: nobody works twice, nothing is lost, the first failure ends the iteration, on both databases."""

from __future__ import annotations

import multiprocessing
import os
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

from sqlalchemy import select

from db import events, jobs, leases, pairs, steps
from db.models import IterationRow, PairRow, ProofRow, StepRow
from db.session import Database
from db.states import IterationState, JobState, PairState, StepKind, StepState, transition
from db.types import utcnow
from tests.db.builders import a_running_job, certified

ELSEWHERE = "elsewhere:1:1"


def claim(db: Database, job_id: str, indices: list[int], task_id: str = "t") -> pairs.Claim | None:
    with db.write() as session:
        return pairs.claim(session, job_id, 0, indices, task_id=task_id, lease_seconds=60)


def save(db: Database, held: pairs.Claim, results: list[pairs.Result]) -> pairs.Saved:
    with db.write() as session:
        return pairs.save(session, held, results, worth_stopping=0.5)


def claim_and_certify(url: str, job_id: str, out: multiprocessing.Queue) -> None:  # type: ignore[type-arg]
    """Takes single pairs until none is left; runs in several processes and threads at once."""
    db = Database(url)
    for index in range(40):
        if (held := claim(db, job_id, [index])) is not None:
            saved = save(db, held, [certified(index)])
            out.put((index, saved.finished))
    db.close()


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
        assert all(row.attempts == 1 for row in pairs.of_job(session, job_id))
        assert len(session.scalars(select(ProofRow)).all()) == 1


def test_threads_that_race_for_overlapping_batches_never_share_a_pair(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 12).id
    with ThreadPoolExecutor(6) as pool:
        held = list(pool.map(lambda i: claim(db, job_id, list(range(i, i + 7))), range(6)))
    taken = Counter(pair.index for one in held if one is not None for pair in one.pairs)
    assert taken == Counter(range(12))


def test_a_claim_is_refused_when_the_job_is_not_running(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session).id
        jobs.cancel(session, job_id)
    assert claim(db, job_id, [0]) is None


def test_the_first_failure_skips_the_rest_and_names_the_messages_to_stop(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 4).id
    first, second = claim(db, job_id, [0, 1], "mine"), claim(db, job_id, [2], "other")
    assert first is not None
    assert second is not None
    witness = pairs.Result(0, PairState.REFUTED, seconds=0.1, stage="screen", witness_s=[0.5])
    assert save(db, first, [witness]) == pairs.Saved(held=True, finished=True, stopped=("other",))
    with db.read() as session:
        rows = pairs.of_job(session, job_id)
        assert [row.state for row in rows] == ["refuted", "skipped", "skipped", "skipped"]
        assert rows[0].witness_s == [0.5]
        assert session.get_one(IterationRow, (job_id, 0)).state == IterationState.FAILED
        assert [e.kind for e in events.since(session, job_id)][-2:] == ["pairs", "iteration"]
    assert save(db, second, [certified(2)]) == pairs.Saved(held=False, finished=False)
    with db.read() as session:
        assert session.scalars(select(ProofRow)).all() == []


def test_without_early_end_every_pair_gets_its_verdict(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 2, stop_at_first_failure=False).id
    held = claim(db, job_id, [0, 1])
    assert held is not None
    assert not save(db, held, [pairs.Result(0, PairState.NOT_CERTIFIABLE, seconds=0.1, weak_points=[[0.1]])]).finished
    assert save(db, held, [certified(1)]).finished
    with db.read() as session:
        assert [row.state for row in pairs.of_job(session, job_id)] == ["not_certifiable", "certified"]
        assert set(pairs.proving(session, job_id, {0: 0, 1: 0})) == {1}


def test_a_lease_of_another_host_ends_by_time_and_its_result_is_then_refused(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 1).id
    first = claim(db, job_id, [0])
    assert first is not None
    assert claim(db, job_id, [0]) is None
    with db.write() as session:
        row = session.scalars(select(PairRow)).one()
        row.worker, row.lease_until = ELSEWHERE, utcnow() - timedelta(seconds=1)
    second = claim(db, job_id, [0])
    assert second is not None
    assert second.pairs == (pairs.Claimed(0, attempt=2),)
    assert not save(db, first, [certified(0)]).held
    assert save(db, second, [certified(0)]).finished


def test_a_lease_of_this_host_ends_with_its_process_and_not_before(db: Database) -> None:
    process = multiprocessing.get_context("spawn").Process(target=os.getpid)
    process.start()
    worker = f"{leases.this_worker().split(':')[0]}:{process.pid}:{leases._started(process.pid or 0)}"
    with db.write() as session:
        job_id = a_running_job(session, 1).id
    assert claim(db, job_id, [0]) is not None
    with db.write() as session:
        row = session.scalars(select(PairRow)).one()
        row.lease_until = utcnow() - timedelta(seconds=1)
        assert not leases.is_free(row, utcnow())
        row.worker = worker
    process.join()
    with db.write() as session:
        ((lost_job, token),) = leases.lost(session, PairRow)
        assert lost_job == job_id
        assert [row.pair_index for row in leases.release(session, PairRow, token)] == [0]
    assert leases.is_alive(leases.this_worker()) is True
    assert leases.is_alive(ELSEWHERE) is None


def test_what_was_begun_before_is_claimed_alone(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 3).id
        transition(session, PairRow, PairState.RUNNING, PairRow.pair_index < 2, attempts=1, worker=ELSEWHERE, lease_until=utcnow())
    claimed = []
    while (held := claim(db, job_id, [0, 1, 2])) is not None:
        claimed.append([(pair.index, pair.attempt) for pair in held.pairs])
    assert claimed == [[(2, 1)], [(0, 2)], [(1, 2)]]


def test_a_renewed_lease_does_not_run_out(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 1).id
    with db.write() as session:
        held = pairs.claim(session, job_id, 0, [0], task_id=None, lease_seconds=0.2)
    assert held is not None
    with db.read() as session:
        before = session.scalars(select(PairRow)).one().lease_until
    with leases.renewed(db, PairRow, held.token, seconds=0.2):
        until = utcnow() + timedelta(seconds=5)
        while utcnow() < until:
            with db.read() as session:
                after = session.scalars(select(PairRow)).one().lease_until
            assert before is not None
            assert after is not None
            if after > before:
                return
    raise AssertionError("the lease was never renewed")


def test_a_step_is_done_once_and_accepting_survives_a_cancel(db: Database) -> None:
    with db.write() as session:
        job = a_running_job(session)
        seeding, accepting = steps.add(session, job, StepKind.PROPOSE, {}).id, steps.add(session, job, StepKind.ACCEPT, {}).id
        job_id = job.id
    with db.write() as session:
        held = steps.claim(session, seeding, task_id="t", lease_seconds=60)
    with db.write() as session:
        assert held is not None
        assert steps.claim(session, seeding, task_id="u", lease_seconds=60) is None
        assert steps.claim(session, 999, task_id="u", lease_seconds=60) is None
        assert steps.save(session, held, StepState.DONE, {"x": 1}, 0.5)
        assert not steps.save(session, held, StepState.DONE, {"x": 2}, 0.5)
        jobs.cancel(session, job_id)
        assert steps.skip(session, job_id) == ()
    with db.read() as session:
        assert {row.kind: (row.state, row.report) for row in steps.of_job(session, job_id)} == {
            "propose": ("done", {"x": 1}),
            "accept": ("open", None),
        }
    with db.write() as session:
        assert steps.claim(session, accepting, task_id="t", lease_seconds=60) is not None
        job = jobs.lock(session, job_id)
        jobs.finish(session, job, JobState.CANCELLED, reason="asked")
    with db.write() as session:
        assert steps.claim(session, accepting, task_id="t", lease_seconds=60) is None


def test_open_rows_are_resent_only_once_in_a_while(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, 2).id
    later = utcnow() + timedelta(seconds=1)
    with db.write() as session:
        assert leases.unclaimed(session, PairRow, later) == [job_id]
        assert [row.pair_index for row in leases.resend(session, PairRow, job_id, later)] == [0, 1]
    with db.write() as session:
        assert leases.unclaimed(session, StepRow, later) == []
        assert leases.resend(session, PairRow, job_id, utcnow() - timedelta(seconds=1)) == []
