"""What claiming and saving a pair costs, however many pairs the iteration has; and letting a caller in, however many keys and
sessions there are."""

from __future__ import annotations

import secrets
import sqlite3
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from sqlalchemy import insert, text
from sqlalchemy.orm import Session

from db import grants, jobs, keys, leases, pairs, projects, sessions, work
from db.grants import Kind, Person
from db.keys import Scope
from db.models import DEFAULT_PROJECT, ApiKeyRow, GrantRow, PairRow, SessionRow
from db.session import Database
from db.states import JobState
from db.types import utcnow
from tests.db.builders import a_running_job, certified


def effort(db: Database, call: Callable[[Session], Any], table: str = "pairs") -> tuple[Any, int]:
    """What the call returns, and its effort: hundreds of instructions of SQLite's machine, or rows of the table that PostgreSQL reads."""
    with db.write() as session:
        if not db.sqlite:
            before = _read(session, table)
            answer = call(session)
            session.flush()
            return answer, _read(session, table) - before
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


def _read(session: Session, table: str) -> int:
    """How many rows of the table PostgreSQL read for this connection; it now and then begins to count anew, but not in a transaction."""
    query = "SELECT seq_tup_read + idx_tup_fetch FROM pg_stat_xact_user_tables WHERE relname = :name"
    return int(session.scalar(text(query), {"name": table}) or 0)


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


def efforts_of_keys(db: Database, key: str) -> dict[str, int]:
    calls: dict[str, Callable[[Session], Any]] = {
        "let a caller in": lambda session: keys.check(session, key),
        "say that there are keys": keys.exist,
        "make a key": lambda session: keys.add(session, f"key{secrets.token_hex(4)}", Scope.READ),
        "list keys": lambda session: keys.page(session, limit=1),
        "forget keys": lambda session: keys.forgettable(session, utcnow()),
    }
    found = {}
    for name, call in calls.items():
        with db.of(DEFAULT_PROJECT).read() as session:
            call(session) if name != "make a key" else None  # SQLite reads the tables' definitions first
        found[name] = effort(db.of(DEFAULT_PROJECT), call, "api_keys")[1]
    return found


def test_the_effort_for_a_key_does_not_grow_with_the_number_of_keys_of_another_project(db: Database) -> None:
    with db.write() as session:
        projects.add(session, "others")
        key = keys.add(session, "planner", Scope.READ)
    few = efforts_of_keys(db, key)
    day = {"digest": "", "scope": "read", "created_at": utcnow()}
    with db.write() as session:
        for revoked_at in (None, utcnow()):
            rows = [
                {"id": secrets.token_hex(6), "project": "others", "name": f"k{i}", "revoked_at": revoked_at, **day} for i in range(5000)
            ]
            session.execute(insert(ApiKeyRow), rows)
    many = efforts_of_keys(db, key)
    assert {call: many[call] for call in many if many[call] > few[call] + 5} == {}, few


def efforts_of_sessions(db: Database, token: str, person: Person) -> dict[str, int]:
    calls: dict[str, Callable[[Session], Any]] = {
        "let a person in": lambda session: sessions.get(session, token),
        "begin a session": lambda session: sessions.begin(session, person),
        "forget sessions": lambda session: sessions.forgettable(session, utcnow()),
        "choose a project": lambda session: grants.of_person(session, person),
    }
    found = {}
    for name, call in calls.items():
        with db.write() as session:
            call(session)  # SQLite reads the tables' definitions first
        found[name] = sum(effort(db, call, table)[1] for table in ("sessions", "grants"))
    return found


def test_the_effort_for_a_session_does_not_grow_with_the_number_of_sessions_and_grants(db: Database) -> None:
    person = Person("alice-1", "alice@example.org", ("robotics", "welders"))
    with db.write() as session:
        grants.add(session, DEFAULT_PROJECT, Kind.GROUP, "robotics", Scope.READ)
        token = sessions.choose(session, sessions.begin(session, person), DEFAULT_PROJECT)
        assert token is not None
    few = efforts_of_sessions(db, token, person)
    now = utcnow()
    of_others = {"email": None, "groups": [], "created_at": now, "expires_at": now + timedelta(hours=1)}
    with db.write() as session:
        rows = [{"digest": f"{i:064d}", "subject": f"bob-{i}", **of_others} for i in range(5000)]
        session.execute(insert(SessionRow), rows)
        granted = [
            {"id": str(i), "project": DEFAULT_PROJECT, "kind": Kind.GROUP, "name": f"g{i}", "scope": "read", "created_at": now}
            for i in range(5000)
        ]
        session.execute(insert(GrantRow), granted)
    many = efforts_of_sessions(db, token, person)
    assert {call: many[call] for call in many if many[call] > few[call] + 10} == {}, few
