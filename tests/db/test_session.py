"""Connections: kept, replaced when they are dead, shared by writers where that is faster, without transactions where none is needed."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from sqlalchemy import func, select, text
from sqlalchemy.exc import OperationalError

from db import jobs, proofs, session
from db.models import EventRow, ProofRow
from db.session import BUSY_SECONDS, CONNECTIONS, LONG_LOG_BYTES, Database
from tests.db.builders import a_running_job
from tests.services import Postgres


@pytest.fixture
def postgres_db(postgres: Postgres, migrated_postgres: str) -> Database:
    return Database(postgres.new_database(migrated_postgres))


def end_every_connection(postgres: Postgres, db: Database) -> None:
    with postgres.connect() as connection:
        name = db.reader.url.database
        connection.execute("SELECT pg_terminate_backend(pid, 10000) FROM pg_stat_activity WHERE datname = %s", [name])


def ask(db: Database) -> int:
    with db.read() as opened:
        return int(opened.scalar(text("SELECT 1")))


def test_a_connection_that_died_while_idle_is_replaced(postgres: Postgres, postgres_db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    assert ask(postgres_db) == 1
    monkeypatch.setattr(session, "IDLE_SECONDS", 0.0)
    end_every_connection(postgres, postgres_db)
    assert ask(postgres_db) == 1
    postgres_db.close()


def test_a_connection_that_dies_between_two_uses_fails_once(
    postgres: Postgres, postgres_db: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert ask(postgres_db) == 1
    monkeypatch.setattr(session, "IDLE_SECONDS", 3600.0)
    end_every_connection(postgres, postgres_db)
    with pytest.raises(OperationalError):
        ask(postgres_db)
    assert ask(postgres_db) == 1
    postgres_db.close()


def test_reading_from_postgresql_leaves_no_transaction_open(postgres_db: Database) -> None:
    with postgres_db.read() as opened:
        opened.scalar(text("SELECT 1"))
        connection = opened.connection().connection.dbapi_connection
        assert connection is not None
        assert connection.info.transaction_status.name == "IDLE"
    with postgres_db.write() as opened:
        opened.scalar(text("SELECT 1"))
        connection = opened.connection().connection.dbapi_connection
        assert connection is not None
        assert connection.info.transaction_status.name == "INTRANS", "what is written is still one transaction"
    postgres_db.close()


def test_more_threads_than_connections_all_write_and_none_sees_half_of_it(db: Database) -> None:
    with db.write() as opened:
        job_id = a_running_job(opened, pair_count=0).id
    begun = threading.Barrier(2 * CONNECTIONS)

    def write(_: int) -> None:
        begun.wait()
        with db.write() as opened:
            job = jobs.lock(opened, job_id)
            for _ in range(2):
                job.event_seq += 1
                opened.add(EventRow(job_id=job_id, seq=job.event_seq, kind="pairs", data={}))
                opened.flush()
                time.sleep(0.001)

    def even() -> bool:
        with db.read() as opened:
            return opened.scalar(select(func.count()).where(EventRow.kind == "pairs")) % 2 == 0  # type: ignore[operator]

    with ThreadPoolExecutor(2 * CONNECTIONS + 1) as pool:
        writers = [pool.submit(write, i) for i in range(2 * CONNECTIONS)]
        while not all(writer.done() for writer in writers):
            assert even()
        for writer in writers:
            writer.result()
    with db.read() as opened:
        assert opened.scalar(select(func.count()).where(EventRow.kind == "pairs")) == 4 * CONNECTIONS


@pytest.fixture
def long_log(tmp_path: Path, migrated_sqlite: Path) -> Iterator[tuple[Database, Path]]:
    """A database whose log is so long that writers wait while it is begun again, and the log."""
    path = tmp_path / "logged.sqlite3"
    path.write_bytes(migrated_sqlite.read_bytes())
    db, log = Database(f"sqlite:///{path}"), path.with_name(f"{path.name}-wal")
    written = store(db, 0, LONG_LOG_BYTES // 2**20 + 1)
    assert log.stat().st_size > LONG_LOG_BYTES, "no writer has copied it"
    yield db, log
    with db.read() as opened:
        assert set(opened.scalars(select(ProofRow.digest))) >= written
    db.close()


def store(db: Database, first: int, count: int) -> set[str]:
    written: set[str] = set()
    for i in range(first, first + count):
        with db.write() as opened:
            written |= set(proofs.put(opened, [bytes([i]) * 2**20]).values())
    return written


def test_a_long_log_is_copied_and_begins_again(long_log: tuple[Database, Path]) -> None:
    db, log = long_log
    db.checkpoint()
    assert log.stat().st_size == 0
    store(db, 100, 1)
    before = log.stat().st_size
    db.checkpoint()
    assert log.stat().st_size == before, "a short log is left alone"


def test_writers_wait_for_no_reader_of_a_long_log(long_log: tuple[Database, Path]) -> None:
    db, log = long_log
    with db.read() as opened:
        opened.execute(select(ProofRow.digest)).first()
        began = time.monotonic()
        with ThreadPoolExecutor(1) as pool:
            copying = pool.submit(db.checkpoint)
            store(db, 100, 2)
            copying.result()
        assert time.monotonic() - began < BUSY_SECONDS / 3
        assert log.stat().st_size > LONG_LOG_BYTES, "what the reader sees is still there"
    db.checkpoint()
    assert log.stat().st_size == 0
