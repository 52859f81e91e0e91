"""Engines and transactions on SQLite and PostgreSQL.

SQLite runs in WAL mode, and a transaction that will write begins with ``BEGIN IMMEDIATE``: one that begins by reading and writes
later would fail, or lose an update, whenever another process wrote in between. A committed transaction outlives the process; with
``synchronous=NORMAL`` a power cut may take back the last ones, never leave half of one.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import make_url
from sqlalchemy.orm import DeclarativeBase, Session

from db.settings import settings

BUSY_SECONDS = 30.0
"""How long a writer waits for another one (SQLite)."""
SILENCE_SECONDS = 20
"""A PostgreSQL server or client that says nothing for so long is believed gone, and with the client its locks."""
_LINK = {
    "connect_timeout": 5,
    "keepalives_idle": SILENCE_SECONDS // 4,
    "keepalives_interval": SILENCE_SECONDS // 4,
    "keepalives_count": 3,
    "tcp_user_timeout": 1000 * SILENCE_SECONDS,
}


class Database:
    """One database: an engine and the two kinds of transaction."""

    def __init__(self, url: str) -> None:
        parsed = make_url(url)
        self.sqlite = parsed.get_backend_name() == "sqlite"
        options: dict[str, Any] = {"json_serializer": _strict_json, "pool_pre_ping": not self.sqlite, "hide_parameters": True}
        if self.sqlite:
            if parsed.database:
                Path(parsed.database).parent.mkdir(parents=True, exist_ok=True)
            options["connect_args"] = {"timeout": BUSY_SECONDS}
        else:
            options["connect_args"] = _LINK
        self.engine: Engine = create_engine(parsed, **options)
        if self.sqlite:
            event.listen(self.engine, "connect", _configure_sqlite)
            event.listen(self.engine, "begin", _begin_sqlite)
        else:
            event.listen(self.engine, "connect", _configure_postgresql)
        self.writer = self.engine.execution_options(sqlite_begin="BEGIN IMMEDIATE")

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A transaction that only reads; rows stay usable after it."""
        with Session(self.engine, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A transaction that may write: committed at the end, rolled back when an exception leaves the block."""
        with Session(self.writer, expire_on_commit=False) as session, session.begin():
            yield session

    def close(self) -> None:
        self.engine.dispose()


def insert_new(session: Session, model: type[DeclarativeBase], rows: list[dict[str, Any]]) -> int:
    """Inserts rows, except those that a unique constraint says are there already; tells how many it inserted."""
    if not rows:
        return 0
    dialect = {"sqlite": sqlite, "postgresql": postgresql}[session.get_bind().dialect.name]
    insert = dialect.insert(model).on_conflict_do_nothing().returning(*model.__table__.primary_key)
    return len(session.execute(insert, rows).all())


@cache
def database() -> Database:
    """The database of the settings, one for the process (a forked child must ``database.cache_clear()`` first)."""
    return Database(settings().database)


def _strict_json(value: Any) -> str:
    return json.dumps(value, allow_nan=False)


def _configure_sqlite(connection: Any, _record: Any) -> None:
    connection.isolation_level = None
    for pragma in ("journal_mode=WAL", "synchronous=NORMAL", "foreign_keys=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _configure_postgresql(connection: Any, _record: Any) -> None:
    """Has the server end a transaction whose client is gone or hangs, so that it locks nobody out."""
    with connection.cursor() as cursor:
        cursor.execute(f"SET idle_in_transaction_session_timeout = '{SILENCE_SECONDS}s'")
    connection.commit()


def _begin_sqlite(connection: Connection) -> None:
    connection.exec_driver_sql(connection.get_execution_options().get("sqlite_begin", "BEGIN"))
