"""The order of work: batches, and shares of projects, keys and jobs, on both databases."""

from __future__ import annotations

import heapq
from collections import Counter, defaultdict
from datetime import timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.errors import CirisError
from db import jobs, leases, pairs, projects, solver_time, steps, work, workers
from db.models import DEFAULT_PROJECT, ApiKeyRow, JobRow, ProjectRow, StepRow
from db.pairs import batch
from db.session import Database
from db.settings import settings
from db.states import JobState, StepState, WorkerState
from db.types import utcnow
from db.workers import Made, WorkerKind
from tests.db.builders import a_job, add_pairs, certified

forecasts = st.lists(st.floats(0, 2), max_size=60)


@given(forecasts)
def test_a_batch_is_full_and_not_overfull(seconds: list[float]) -> None:
    chosen = batch(enumerate(seconds), 0.5)
    assert chosen == list(range(len(chosen)))
    assert len(chosen) <= 1 or sum(seconds[i] for i in chosen) <= 0.5
    assert len(chosen) == len(seconds) or sum(seconds[: len(chosen) + 1]) > 0.5


def test_small_pairs_fill_a_batch() -> None:
    assert batch(enumerate([0.1] * 7), 0.5) == [0, 1, 2, 3, 4]


def run(db: Database, pieces: int) -> list[str]:
    """The jobs for which this many pieces of 1 s are claimed, in order."""
    order = []
    for _ in range(pieces):
        with db.read() as session:
            job_id = work.next_job(session)
        assert job_id is not None
        with db.write() as session:
            assert work.claim(session, job_id, lease_seconds=60, batch_seconds=0.5) is not None
        order.append(job_id)
    return order


def a_job_of(db: Database, key: str | None = None, priority: int = 0, pair_count: int = 60, project: str = DEFAULT_PROJECT) -> str:
    with db.write() as session:
        if session.get(ProjectRow, project) is None:
            projects.add(session, project)
        if key is not None and session.get(ApiKeyRow, key) is None:
            session.add(ApiKeyRow(id=key, name=key, project=project, digest="", scope="submit"))
            session.flush()
    with db.of(project).write() as session:
        job = a_job(session, key_id=key, priority=priority)
    with db.write() as session:
        job = jobs.lock(session, job.id)
        jobs.start(session, job, work.served_by_now(session))
        if pair_count:
            add_pairs(session, job, pair_count)
        return job.id


def a_step(db: Database, job_id: str) -> None:
    """Gives the job a long piece of work that it waits for."""
    with db.write() as session:
        job = jobs.lock(session, job_id)
        job.turn += 1
        steps.add(session, job, "propose", {})


class Solvers:
    """A number of solvers in a time of their own: pieces of pairs take what was forecast, 1 s, and steps take ``step_seconds``.

    A job whose step is done waits for the next one at once.

    Attributes:
        seconds: job -> the seconds of solvers that it was given.
        began: job -> when its first piece began.
    """

    def __init__(self, db: Database, solvers: int, step_seconds: float) -> None:
        self._db, self._step_seconds = db, step_seconds
        self._free: list[tuple[float, int, pairs.Claim | steps.Claim | None]] = [(0.0, i, None) for i in range(solvers)]
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self.began: dict[str, float] = {}

    def run_until(self, end: float) -> None:
        while self._free[0][0] < end:
            now, solver, done = heapq.heappop(self._free)
            if isinstance(done, pairs.Claim):
                with self._db.write() as session:
                    pairs.save(session, done, {(pair.index, 0): certified(pair.index)[pair.index, 0] for pair in done.pairs})
            elif done is not None:
                with self._db.write() as session:
                    assert steps.save(session, done, StepState.DONE, {}, self._step_seconds)
                a_step(self._db, done.job_id)
            with self._db.read() as session:
                job_id = work.next_job(session)
            assert job_id is not None
            with self._db.write() as session:
                claim = work.claim(session, job_id, lease_seconds=60, batch_seconds=0.5)
            assert claim is not None
            seconds = self._step_seconds if isinstance(claim, steps.Claim) else float(len(claim.pairs))
            self.began.setdefault(job_id, now)
            self.seconds[job_id] += seconds
            heapq.heappush(self._free, (now + seconds, solver, claim))


def test_jobs_take_turns_whatever_their_length(db: Database) -> None:
    long, short = a_job_of(db, pair_count=60), a_job_of(db, pair_count=5)
    order = run(db, 12)
    assert Counter(order[:10]) == {long: 5, short: 5}
    assert order[10:] == [long, long]


def test_a_step_of_priority_doubles_the_share_and_nobody_starves(db: Database) -> None:
    jobs_by_priority = {priority: a_job_of(db, priority=priority) for priority in (1, 0, -1)}
    shares = Counter(run(db, 28))
    assert [shares[jobs_by_priority[priority]] for priority in (1, 0, -1)] == pytest.approx([16, 8, 4], abs=1)


def test_keys_of_a_project_have_equal_shares_however_many_jobs_they_have(db: Database) -> None:
    many = {a_job_of(db, "many", priority=3) for _ in range(5)}
    one = a_job_of(db, "one")
    shares = Counter(run(db, 30))
    assert shares[one] == pytest.approx(15, abs=1)
    assert all(shares[job_id] == pytest.approx(3, abs=1) for job_id in many)


@pytest.mark.parametrize("solvers", [1, 3, 4])
def test_projects_have_equal_shares_however_many_keys_they_have(db: Database, solvers: int) -> None:
    """Keys cost nothing, and an admin makes as many as wanted."""
    nine = [a_job_of(db, f"key{i}") for i in range(9)]
    one = a_job_of(db, "one", project="others", pair_count=200)
    work_done = Solvers(db, solvers, 0.0)
    work_done.run_until(180.0 / solvers)
    total = sum(work_done.seconds.values())
    assert work_done.seconds[one] == pytest.approx(total / 2, rel=0.1)
    assert [work_done.seconds[job_id] for job_id in nine] == pytest.approx([total / 18] * 9, rel=0.1)


def test_long_work_of_others_takes_no_share(db: Database) -> None:
    """Nobody knows how long a step takes. The other project has a solver as soon as one is free, and its part of them from then on."""
    long = {a_job_of(db, f"key{i}", pair_count=0) for i in range(9)}
    for job_id in long:
        a_step(db, job_id)
    solvers = Solvers(db, 4, step_seconds=60.0)
    solvers.run_until(30.0)
    late = a_job_of(db, "one", project="others", pair_count=600)
    solvers.run_until(61.0)
    assert solvers.began[late] == 60.0, "no solver was free before"
    before = solvers.seconds[late]
    solvers.run_until(240.0)
    assert solvers.seconds[late] - before == pytest.approx(2 * 180, rel=0.1), "two of the four"


def test_of_projects_with_as_many_solvers_the_one_goes_first_that_had_less_time_lately(db: Database) -> None:
    """It counts what the project had, not what its least served job did: with many keys there is always one that was hardly served."""
    many = {a_job_of(db, f"key{i}", project="a") for i in range(9)}
    one = a_job_of(db, "one", project="b")
    for project, seconds, first in (("a", 1.0, {one}), ("b", 2.0, many), ("a", 2.0, {one})):
        with db.write() as session:
            solver_time.add(session, project, seconds)
        with db.read() as session:
            assert work.next_job(session) in first
        assert newcomer(db) in first


def test_who_always_has_a_new_small_job_has_no_larger_share(db: Database) -> None:
    """Three solvers for two projects: the third one takes turns."""
    long = a_job_of(db, "long", project="a", pair_count=200)
    solvers, small = Solvers(db, 3, 0.0), list[str]()
    for end in range(1, 61):
        small += [a_job_of(db, "small", project="b", pair_count=1) for _ in range(2)]
        solvers.run_until(float(end))
    assert sum(solvers.seconds[job_id] for job_id in small) == pytest.approx(90, rel=0.1)
    assert solvers.seconds[long] == pytest.approx(90, rel=0.1)


@pytest.mark.parametrize("solvers", [1, 3])
def test_a_key_that_always_has_a_new_small_job_has_no_larger_share_within_its_project(db: Database, solvers: int) -> None:
    """A new job has as little as the job that was served least. So the order is not by jobs."""
    long = a_job_of(db, "long", pair_count=200)
    running, small = Solvers(db, solvers, 0.0), list[str]()
    for end in range(1, 61):
        small += [a_job_of(db, "also", pair_count=1) for _ in range(solvers)]
        running.run_until(float(end))
    assert sum(running.seconds[job_id] for job_id in small) == pytest.approx(30 * solvers, rel=0.1)
    assert running.seconds[long] == pytest.approx(30 * solvers, rel=0.1)


def told(db: Database, processes: int) -> None:
    """A worker reports how many pieces it does at the same time."""
    made = Made("host:1:1", WorkerKind.SOLVE, "1", processes, cores=processes, memory_bytes=1)
    with db.write() as session:
        workers.tell(session, made, WorkerState.RUNNING)


def claimed_step(db: Database, job_id: str) -> steps.Claim:
    with db.write() as session:
        claim = work.claim(session, job_id, lease_seconds=60, batch_seconds=0.5)
    assert isinstance(claim, steps.Claim)
    return claim


def a_seeding(db: Database, key: str, project: str = DEFAULT_PROJECT) -> steps.Claim:
    """A job whose seeding a solver does."""
    job_id = a_job_of(db, key, pair_count=0, project=project)
    a_step(db, job_id)
    return claimed_step(db, job_id)


def a_region(db: Database, job_id: str) -> None:
    """Gives the job a region to accept."""
    with db.write() as session:
        job = jobs.lock(session, job_id)
        job.turn += 1
        steps.add(session, job, "accept", {})


def claimed_region(db: Database, job_id: str) -> steps.Claim | None:
    with db.write() as session:
        return work.claim_region(session, job_id, lease_seconds=60)


def given_up(db: Database) -> leases.Lost | None:
    with db.read() as session:
        return work.to_give_up(session)


def test_a_project_without_a_solver_gets_that_of_a_long_step(db: Database) -> None:
    told(db, processes=2)
    long = [a_job_of(db, f"key{i}", pair_count=0) for i in range(3)]
    for job_id in long:
        a_step(db, job_id)
    first, last = claimed_step(db, long[0]), claimed_step(db, long[1])
    assert given_up(db) is None, "nobody of another project waits"
    other = a_job_of(db, "one", project="others", pair_count=4)
    lost = given_up(db)
    assert lost is not None
    assert (lost.job_id, lost.token) == (long[1], last.token), "the one that was asked for last"
    with db.write() as session:
        leases.release(session, StepRow, lost)
    assert run(db, 1) == [other]
    assert given_up(db) is None, "a solver does pairs, which take seconds"
    with db.write() as session:
        assert not steps.save(session, last, StepState.DONE, {}, 1.0), "its holder can save nothing any more"
        assert steps.save(session, first, StepState.DONE, {}, 1.0)


def test_no_step_is_given_up_twice(db: Database) -> None:
    told(db, processes=2)
    long = [a_job_of(db, f"key{i}", pair_count=0) for i in range(2)]
    for job_id in long:
        a_step(db, job_id)
        claimed_step(db, job_id)
    a_job_of(db, "one", project="others", pair_count=4)
    for _ in long:
        lost = given_up(db)
        assert lost is not None
        with db.write() as session:
            leases.release(session, StepRow, lost)
        claimed_step(db, lost.job_id)
    assert given_up(db) is None


def test_accepting_is_not_given_up(db: Database) -> None:
    """It ends within seconds, and may have the process beside the solvers, so that nobody would get a solver by it."""
    told(db, processes=2)
    seeds = [a_seeding(db, f"key{i}") for i in range(2)]
    a_region(db, seeds[1].job_id)
    accepting = claimed_region(db, seeds[1].job_id)
    assert accepting is not None
    a_job_of(db, "one", project="others", pair_count=4)
    assert given_up(db) is None, "a solver accepts a region, or will do something else at once"
    with db.write() as session:
        assert steps.save(session, accepting, StepState.DONE, {}, 1.0)
    lost = given_up(db)
    assert lost is not None
    assert lost.token == seeds[1].token


def test_a_project_keeps_the_only_solver_that_it_has(db: Database) -> None:
    told(db, processes=2)
    for name in ("a", "b"):
        job_id = a_job_of(db, name, project=name, pair_count=0)
        a_step(db, job_id)
        claimed_step(db, job_id)
    a_job_of(db, "one", project="others", pair_count=4)
    assert given_up(db) is None


def test_what_may_go_beside_the_solvers_may_be_taken_meanwhile(db: Database) -> None:
    """On PostgreSQL each question has its own view: a job that waited is claimed, and nobody holds anything else."""
    with db.read() as session:
        assert work._beside(session, [], defaultdict(float), Counter()) == []


def newcomer(db: Database) -> str | None:
    with db.read() as session:
        return work.newcomer(session)


def test_a_new_job_is_one_that_nobody_works_for_and_that_was_begun_a_moment_ago(db: Database) -> None:
    job_id = a_job_of(db, pair_count=4)
    assert newcomer(db) == job_id
    with db.write() as session:
        claim = work.claim(session, job_id, lease_seconds=60, batch_seconds=0.5)
        assert isinstance(claim, pairs.Claim)
    assert newcomer(db) is None, "a solver does a piece of it"
    with db.write() as session:
        pairs.give_back(session, claim)
    assert newcomer(db) == job_id
    with db.write() as session:
        jobs.lock(session, job_id).claimed_at = utcnow() - timedelta(seconds=work.NEW_SECONDS)
    assert newcomer(db) is None


def test_a_new_job_that_is_cancelled_need_not_wait_for_its_region_to_be_accepted(db: Database) -> None:
    job_id = a_job_of(db, pair_count=0)
    with db.write() as session:
        job = jobs.lock(session, job_id)
        steps.add(session, job, "accept", {})
        jobs.claimed(job)
        jobs.cancel(session, job_id)
    assert newcomer(db) == job_id


def test_a_step_that_was_begun_before_is_left_to_the_solvers(db: Database) -> None:
    job_id = a_job_of(db, pair_count=0)
    a_step(db, job_id)
    assert newcomer(db) == job_id
    claim = claimed_step(db, job_id)
    with db.write() as session:
        leases.release(session, StepRow, leases.Lost(job_id, claim.token, "", "", alone=False))
    assert newcomer(db) is None
    with db.read() as session:
        assert work.next_job(session) == job_id


def test_a_small_job_goes_on_to_its_end_before_new_jobs_that_nobody_has_begun(db: Database) -> None:
    waiting = [a_job_of(db) for _ in range(2)]
    small = a_job_of(db, pair_count=4)
    with db.write() as session:
        claim = work.claim(session, small, lease_seconds=60, batch_seconds=0.01)
        assert isinstance(claim, pairs.Claim)
    with db.write() as session:
        pairs.save(session, claim, {(pair.index, 0): certified(pair.index)[pair.index, 0] for pair in claim.pairs})
        assert jobs.lock(session, small).served > jobs.lock(session, waiting[1]).served
    assert newcomer(db) == small
    newest = a_job_of(db)
    assert newcomer(db) == newest


def test_who_has_the_process_for_new_jobs_leaves_it_to_newer_ones_and_to_those_who_have_fewer(db: Database) -> None:
    def instead(of: str) -> str | None:
        with db.read() as session:
            return work.newcomer(session, instead_of=of)

    for key in ("a", "b", "b"):
        job_id = a_job_of(db, key, pair_count=0)
        a_step(db, job_id)
        claimed_step(db, job_id)
    older = a_job_of(db, "b")
    mine = a_job_of(db, "a", pair_count=0)
    a_step(db, mine)
    claimed_step(db, mine)
    assert newcomer(db) == older
    assert instead(mine) is None, "it had waited when mine came, and both keys have two"
    newer = a_job_of(db, "b")
    assert instead(mine) == newer
    with db.write() as session:
        assert work.claim(session, newer, lease_seconds=60, batch_seconds=0.5) is not None
    assert instead(mine) is None
    third = a_job_of(db, "c")
    with db.write() as session:
        jobs.lock(session, third).created_at = utcnow() - timedelta(seconds=30)
    assert instead(mine) == third, "nobody works for this key"


def test_new_jobs_of_a_project_that_has_more_solvers_than_another_wait(db: Database) -> None:
    """However many small jobs it asks for, it does not take the part of others."""
    for project, held in (("a", 2), ("b", 1)):
        for i in range(held):
            job_id = a_job_of(db, f"{project}{i}", project=project, pair_count=0)
            a_step(db, job_id)
            claimed_step(db, job_id)
    small = a_job_of(db, "a9", project="a")
    assert newcomer(db) is None
    other = a_job_of(db, "b9", project="b")
    assert newcomer(db) == other
    with db.write() as session:
        work.claim(session, other, lease_seconds=60, batch_seconds=0.5)
    assert newcomer(db) == small, "both have as many"


def test_new_jobs_do_not_go_before_the_work_of_a_project_that_has_no_solver(db: Database) -> None:
    job_id = a_job_of(db, "a0", project="a", pair_count=0)
    a_step(db, job_id)
    claimed_step(db, job_id)
    small = a_job_of(db, "a9", project="a")
    assert newcomer(db) == small
    waits = a_job_of(db, "b0", project="b")
    with db.write() as session:
        jobs.lock(session, waits).claimed_at = utcnow() - timedelta(seconds=work.NEW_SECONDS)
    assert newcomer(db) is None


def to_accept(db: Database) -> str | None:
    with db.read() as session:
        return work.to_accept(session)


def test_a_region_is_accepted_beside_the_solvers_while_its_job_seeds(db: Database) -> None:
    job_id = a_seeding(db, "a").job_id
    assert to_accept(db) is None
    a_region(db, job_id)
    assert (newcomer(db), to_accept(db)) == (None, job_id)
    first = claimed_region(db, job_id)
    assert first is not None
    assert first.kind == "accept"
    a_region(db, job_id)
    assert (to_accept(db), claimed_region(db, job_id)) == (None, None), "one region at a time"
    with db.write() as session:
        assert steps.save(session, first, StepState.DONE, {}, 1.0)
        jobs.lock(session, job_id).accept_after = utcnow() + timedelta(seconds=60)
    assert (to_accept(db), claimed_region(db, job_id)) == (None, None), "the job rests"
    with db.write() as session:
        jobs.lock(session, job_id).accept_after = utcnow()
    assert to_accept(db) == job_id


def test_nothing_but_a_region_is_done_beside_the_solvers_for_a_job_that_is_not_new(db: Database) -> None:
    job_id = a_job_of(db, pair_count=4)
    with db.write() as session:
        jobs.lock(session, job_id).claimed_at = utcnow() - timedelta(seconds=work.NEW_SECONDS)
    assert (to_accept(db), claimed_region(db, job_id)) == (None, None)
    a_step(db, job_id)
    a_region(db, job_id)
    assert to_accept(db) == job_id
    claim = claimed_region(db, job_id)
    assert claim is not None
    assert claim.kind == "accept"


def test_a_region_that_was_begun_before_is_left_to_the_solvers(db: Database) -> None:
    job_id = a_seeding(db, "a").job_id
    a_region(db, job_id)
    claim = claimed_region(db, job_id)
    assert claim is not None
    with db.write() as session:
        leases.release(session, StepRow, leases.Lost(job_id, claim.token, "", "", alone=False))
    a_region(db, job_id)
    assert (to_accept(db), claimed_region(db, job_id)) == (None, None), "nor is another one begun, after which the job would rest"
    with db.read() as session:
        assert work.next_job(session) == job_id
    assert claimed_step(db, job_id).kind == "accept"


def test_regions_of_a_project_that_has_more_solvers_than_another_wait(db: Database) -> None:
    first, second = a_seeding(db, "a0", "a"), a_seeding(db, "a1", "a")
    other = a_seeding(db, "b0", "b")
    a_region(db, first.job_id)
    assert to_accept(db) is None
    a_region(db, other.job_id)
    assert to_accept(db) == other.job_id
    with db.write() as session:
        assert steps.save(session, second, StepState.DONE, {}, 1.0)
        jobs.finish(session, jobs.lock(session, second.job_id), JobState.FAILED, reason="")
    assert to_accept(db) == first.job_id, "both have as many"


def test_a_region_that_is_accepted_beside_the_solvers_keeps_no_new_job_waiting(db: Database) -> None:
    """Its project has a process more than the other one then. A step of a new job would keep newer ones of the same project waiting."""

    def instead(of: str, accepts: bool) -> str | None:
        with db.read() as session:
            return work.newcomer(session, instead_of=of, accepts=accepts)

    mine = a_seeding(db, "a0", "a").job_id
    a_seeding(db, "b0", "b")
    a_region(db, mine)
    older = a_job_of(db, "a1", project="a")
    with db.write() as session:
        jobs.lock(session, older).created_at = utcnow() - timedelta(seconds=30)
    assert claimed_region(db, mine) is not None
    assert instead(mine, accepts=True) == older
    assert instead(mine, accepts=False) is None


def test_a_project_for_which_only_a_region_is_accepted_keeps_no_new_job_of_others_waiting(db: Database) -> None:
    mine = a_job_of(db, "a0", pair_count=0, project="a")
    a_region(db, mine)
    a_seeding(db, "b0", "b")
    new = a_job_of(db, "b1", project="b")
    assert claimed_region(db, mine) is not None
    with db.read() as session:
        assert work.newcomer(session, instead_of=mine, accepts=True) == new


def test_a_job_gets_its_first_piece_at_once_beside_a_hundred_of_its_key(db: Database) -> None:
    for _ in range(100):
        a_job_of(db, "key", pair_count=20)
    solvers = Solvers(db, 2, 0.0)
    solvers.run_until(70.0)
    small = a_job_of(db, "key", pair_count=1)
    solvers.run_until(72.0)
    assert solvers.began[small] <= 71.0


def test_a_job_that_comes_late_neither_waits_nor_overtakes(db: Database) -> None:
    early = a_job_of(db)
    run(db, 20)
    late = a_job_of(db)
    assert Counter(run(db, 10)) == {early: 5, late: 5}


def test_a_region_is_accepted_before_more_pairs_and_then_the_job_rests(db: Database) -> None:
    """Planners wait for regions, and the growth for pairs: accepting takes one worker at a time, and rests in between."""
    job_id = a_job_of(db)

    def add_region() -> None:
        with db.write() as session:
            job = jobs.lock(session, job_id)
            job.turn += 1
            steps.add(session, job, "accept", {})

    def claimed() -> steps.Claim | pairs.Claim | None:
        with db.write() as session:
            return work.claim(session, job_id, lease_seconds=60, batch_seconds=0.5)

    add_region()
    first = claimed()
    assert isinstance(first, steps.Claim)
    add_region()
    assert isinstance(claimed(), pairs.Claim), "one region at a time"
    with db.write() as session:
        job = jobs.lock(session, job_id)
        assert steps.save(session, first, StepState.DONE, {}, 1.0)
        job.accept_after = utcnow() + timedelta(seconds=60)
    assert isinstance(claimed(), pairs.Claim), "the job rests"
    with db.write() as session:
        jobs.lock(session, job_id).accept_after = utcnow()
    assert isinstance(claimed(), steps.Claim)


def test_there_is_nothing_to_do_for_jobs_that_do_not_run(db: Database) -> None:
    job_id = a_job_of(db)
    with db.read() as session:
        assert work.next_job(session) == job_id
    with db.write() as session:
        jobs.cancel(session, job_id)
    with db.read() as session:
        assert work.next_job(session) is None
    with db.write() as session:
        assert work.claim(session, job_id, lease_seconds=60, batch_seconds=0.5) is None


def test_a_key_has_a_quota_of_unfinished_jobs(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings(), "max_jobs_per_key", 2)
    job_id, _ = a_job_of(db, "a"), a_job_of(db, "a")
    with pytest.raises(CirisError, match="as many unfinished jobs as it may have at a time: 2"):
        a_job_of(db, "a")
    a_job_of(db, "b")
    with db.write() as session:
        jobs.finish(session, jobs.lock(session, job_id), JobState.FAILED, reason="")
    a_job_of(db, "a")
    with db.read() as session:
        assert session.query(JobRow).count() == 4


def test_a_project_has_a_quota_of_unfinished_jobs_whatever_its_keys(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings(), "max_jobs_per_project", 2)
    for key in ("a", "b"):
        a_job_of(db, key)
    with pytest.raises(CirisError, match="CIRIS_MAX_JOBS_PER_PROJECT"):
        a_job_of(db, "c")
    a_job_of(db, "d", project="others")
