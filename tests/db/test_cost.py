"""Claiming and saving a pair costs the same however many pairs the iteration has."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import text
from sqlalchemy.orm import Session

from db import jobs, leases, pairs, work
from db.models import PairRow
from db.session import Database
from db.states import JobState
from tests.db.builders import a_running_job, certified


def effort(db: Database, call: Callable[[Session], Any]) -> tuple[Any, int]:
    """What the call returns, and its effort: hundreds of instructions of SQLite's machine, or pairs that PostgreSQL reads."""
    with db.write() as session:
        if not db.sqlite:
            before = _read(session)
            answer = call(session)
            session.flush()
            return answer, _read(session) - before
        raw = session.connection().connection.driver_connection
        assert isinstance(raw, sqlite3.Connection)
        ticks: list[None] = []
        raw.set_progress_handler(lambda: ticks.append(None), 100)
        try:
            answer = call(session)
            session.flush()
        finally:
            raw.set_progress_handler(None, 100)
        return answer, len(ticks)


def _read(session: Session) -> int:
    """How many rows of pairs PostgreSQL read for this connection; it now and then begins to count anew, but not in a transaction."""
    query = "SELECT seq_tup_read + idx_tup_fetch FROM pg_stat_xact_user_tables WHERE relname = 'pairs'"
    return int(session.scalar(text(query)) or 0)


def efforts(db: Database, pair_count: int, settled: int, counted: bool = False) -> dict[str, int]:
    """The efforts for one pair of a job that has ``pair_count`` pairs, of which ``settled`` are settled already.

    ``counted`` says whether PostgreSQL has statistics of the table with all of the job's pairs open.
    """
    with db.write() as session:
        job_id = a_running_job(session, pair_count).id
    if counted:
        with db.write() as session:
            session.execute(text("ANALYZE"))
    while settled:
        with db.write() as session:
            done = work.claim(session, job_id, lease_seconds=60, batch_seconds=settled)
            assert isinstance(done, pairs.Claim)
            pairs.save(session, done, {(pair.index, 0): certified(pair.index)[pair.index, 0] for pair in done.pairs})
        settled -= len(done.pairs)
    asked = {"job_states": [JobState.RUNNING]}
    claim, claiming = effort(db, lambda session: work.claim(session, job_id, lease_seconds=60, batch_seconds=0.05))  # one pair
    wanted, looking = effort(db, lambda session: session.scalar(leases._wanted(PairRow), {"token": claim.token, **asked}))
    saved, saving = effort(db, lambda session: pairs.save(session, claim, certified(claim.pairs[0].index)))
    next_job, finding = effort(db, work.next_job)
    assert (wanted is not None, saved, next_job) == (True, pairs.Saved(held=False, finished=False), job_id)
    with db.write() as session:
        pairs.skip(session, jobs.lock(session, job_id))
    return {"claim": claiming, "look": looking, "save": saving, "find the next job": finding}


@pytest.mark.parametrize("counted", [[], [0], [1], [0, 1]], ids=["never", "before the job", "as the job began", "twice"])
def test_the_effort_for_a_pair_does_not_grow_with_the_number_of_pairs(db: Database, counted: list[int]) -> None:
    """Whatever PostgreSQL's statistics are from: it makes them now and then, and knows nothing of what was added since."""
    few = efforts(db, pair_count=400, settled=200, counted=0 in counted)
    many = efforts(db, pair_count=8000, settled=4000, counted=1 in counted)
    assert {call: many[call] for call in many if many[call] > few[call] + 5} == {}, few
