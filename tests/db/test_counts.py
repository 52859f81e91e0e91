"""Whatever befalls a job's pairs, the counts in its row are true, and claims and savings do what reading every row would tell."""

from __future__ import annotations

from collections import Counter

import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from sqlalchemy import delete

from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from db import jobs, leases, pairs, work
from db.models import IterationRow, JobRow
from db.pairs import FAILED, UNFINISHED
from db.session import Database
from db.states import IterationState, PairState
from tests.db.builders import a_running_job, all_pairs

RESULTS = {
    "certified": PairResult(Outcome.CERTIFIED, Stage.SOS, seconds=0.1, margin=0.01, proof=b"proof"),
    "refuted": PairResult(Outcome.REFUTED, Stage.SCREEN, seconds=0.1, witness_s=np.array([0.5])),
    "inconclusive": PairResult(Outcome.INCONCLUSIVE, Stage.SOS, seconds=0.1),
}


class Log:
    """One job and every claim on it; each call changes the database and checks what it did against all of the job's rows."""

    def __init__(self, db: Database, pair_count: int, failures: int | None) -> None:
        self.db, self.failures, self.finished = db, failures, 0
        self.claims: list[pairs.Claim] = []
        with db.write() as session:
            session.execute(delete(JobRow))  # those of earlier examples
            self.job_id = a_running_job(session, pair_count, failures=failures).id
        self.check()

    def rows(self) -> list[tuple[str, int, str | None]]:
        """State, deaths and token of each pair, in their order, which is also that of their indices."""
        with self.db.read() as session:
            return [(row.state, row.deaths, row.lease_token) for row in all_pairs(session, self.job_id)]

    def check(self) -> None:
        states = Counter(state for state, _, _ in self.rows())
        with self.db.read() as session:
            job, iteration = jobs.get(session, self.job_id), session.get_one(IterationRow, (self.job_id, 0))
            assert (job.open_pairs, job.running_pairs) == (states["open"], states["running"])
            assert (work.next_job(session) == self.job_id) == (states["open"] > 0)
            left = states["open"] + states["running"]
            assert self.finished == (left == 0)
            ended = IterationState.CERTIFIED if set(states) == {"certified"} else IterationState.FAILED
            assert iteration.state == (IterationState.RUNNING if left else ended)

    def claim(self, seconds: float) -> bool:
        rows = [(index, deaths) for index, (state, deaths, _) in enumerate(self.rows()) if state == "open"]
        fresh = [index for index, deaths in rows if deaths == 0]
        deadly = sorted((deaths, index) for index, deaths in rows if deaths)
        expected = fresh[: max(1, int(seconds))] or [index for _, index in deadly[:1]]
        with self.db.write() as session:
            claim = work.claim(session, self.job_id, lease_seconds=60, batch_seconds=seconds)
        assert claim is None or isinstance(claim, pairs.Claim)
        assert ([] if claim is None else [pair.index for pair in claim.pairs]) == expected
        if claim is not None:
            self.claims.append(claim)
        self.check()
        return claim is not None

    def save(self, claim: pairs.Claim, kinds: list[str]) -> None:
        before = self.rows()
        states = [state for state, _, _ in before]
        results = {(pair.index, pair.part): RESULTS[kind] for pair, kind in zip(claim.pairs, kinds, strict=False)}
        held = [index for index, (state, _, token) in enumerate(before) if state == "running" and token == claim.token]
        saved = [index for index, _ in results if index in held]
        for index in saved:
            states[index] = results[index, 0].outcome.value
        failed = [index for index, state in enumerate(states) if state in FAILED]
        if self.failures is not None and len(failed) >= self.failures:
            last = failed[self.failures - 1]
            states = [PairState.SKIPPED if i > last and state in UNFINISHED else state for i, state in enumerate(states)]
        finished = bool(saved) and not UNFINISHED.intersection(states)
        with self.db.write() as session:
            answer = pairs.save(session, claim, results)
        assert answer == pairs.Saved(bool(saved) and any(states[index] == "running" for index in held), finished)
        assert [state for state, _, _ in self.rows()] == states
        self.finished += answer.finished
        self.check()

    def lose(self, claim: pairs.Claim, alone: bool) -> None:
        held = sorted(index for index, (state, _, token) in enumerate(self.rows()) if state == "running" and token == claim.token)
        with self.db.write() as session:
            lost = leases.Lost(self.job_id, claim.token, "", "its process died", alone)
            assert sorted(row.pair_index for row in pairs.release(session, jobs.lock(session, self.job_id), lost)) == held
        self.check()


WITHOUT_SHRINKING = (Phase.reuse, Phase.generate)
"""Making a failing example as short as can be takes minutes here."""


@settings(max_examples=10, phases=WITHOUT_SHRINKING, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(data=st.data(), pair_count=st.integers(1, 12), failures=st.sampled_from([None, 1, 2]))
def test_counts_are_true_and_an_iteration_ends_once(db: Database, data: st.DataObject, pair_count: int, failures: int | None) -> None:
    log = Log(db, pair_count, failures)
    kinds = st.lists(st.sampled_from(sorted(RESULTS)), min_size=1, max_size=4)
    for seconds in data.draw(st.lists(st.sampled_from([0.5, 2.5, 4.0]), min_size=1, max_size=4)):
        log.claim(seconds)
    for what in data.draw(st.lists(st.sampled_from(["save", "save", "save", "claim", "lose"]), min_size=3, max_size=14)):
        if what == "claim":
            log.claim(data.draw(st.sampled_from([0.5, 2.5, 4.0])))
        else:
            claim = data.draw(st.sampled_from(log.claims))
            log.save(claim, data.draw(kinds)) if what == "save" else log.lose(claim, data.draw(st.booleans()))
    for claim in log.claims:
        log.lose(claim, alone=False)
    while log.claim(4.0):
        log.save(log.claims[-1], ["certified"] * len(log.claims[-1].pairs))
    assert log.finished == 1


def test_stopping_a_job_leaves_nothing_open(db: Database) -> None:
    log = Log(db, 5, 1)
    log.claim(2.5)
    with db.write() as session:
        job = jobs.lock(session, log.job_id)
        pairs.skip(session, job)
        assert (job.open_pairs, job.running_pairs) == (0, 0)
    assert {state for state, _, _ in log.rows()} == {"skipped"}


def test_very_short_pairs_are_not_all_claimed_together(db: Database) -> None:
    with db.write() as session:
        job_id = a_running_job(session, pairs.MOST_TOGETHER + 1).id
    with db.write() as session:
        claim = work.claim(session, job_id, lease_seconds=60, batch_seconds=1e9)
    assert isinstance(claim, pairs.Claim)
    assert [pair.index for pair in claim.pairs] == list(range(pairs.MOST_TOGETHER))
