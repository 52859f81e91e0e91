"""This module opens connections and transactions on SQLite and PostgreSQL.

SQLite runs in WAL mode. A transaction that will write begins with ``BEGIN IMMEDIATE``. If it began by reading and wrote later, it
would fail, or lose an update, whenever another process wrote in between.

While another process writes on SQLite, a writer looks again and again, at longer and longer intervals. So the writers of one
process share one connection, and queue for it instead. A committed transaction survives the end of the process. With
``synchronous=NORMAL`` a power cut may take back the last transactions, but never leaves half of one.

What is written goes to SQLite's log first. Copying the log into the database waits for the disk, so a thread of the control worker does
it (``Database.checkpoint``), and writers do it only where the log has become very long. A copy never waits for a writer that waits too.

A session of a project finds the rows of this project only, whatever it looks for: its condition is added to every statement here.

PostgreSQL gives every statement its own view of the database unless told otherwise. So reading there needs no transaction, and no
messages that begin and end one.
"""

from __future__ import annotations

import copy
import json
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Dialect, Engine, QueuePool, create_engine, event, text
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import DatabaseError, DisconnectionError, InterfaceError, OperationalError, TimeoutError
from sqlalchemy.orm import DeclarativeBase, LoaderCriteriaOption, ORMExecuteState, Session, with_loader_criteria

from certifier.errors import CirisError, unreadable
from db import unusable, version
from db.disk import Disk
from db.models import Owned
from db.settings import settings

CONNECTIONS = 18
"""One process has at most this many connections. It opens them when needed and keeps them, because opening one costs more than
most of what it is used for.
"""
BUSY_SECONDS = 30.0
"""A caller waits at most this long for a connection, and a writer at most this long for another writer (SQLite)."""
INCREMENTAL = 2
"""SQLite's number for giving room back when it is asked to."""
SPARE_PAGES, PAGES_TOGETHER = 1000, 2000
"""SQLite may keep SPARE_PAGES, of 4 KiB, that it does not use; PAGES_TOGETHER are given back at a time."""
LOG_BYTES = 4 * 2**20
"""A longer log of SQLite is copied into the database. Its file is cut to this length when it begins again."""
LONG_LOG_BYTES, LONG_LOG_PAGES = 4 * LOG_BYTES, 16_000
"""Writers wait while a log longer than this is begun again, if that is quick. With LONG_LOG_PAGES a writer copies the log itself."""
QUICK_SECONDS = 0.5
IDLE_SECONDS = 1.0
"""A connection to PostgreSQL that was idle for this many seconds is tested before it is used: the server may have been restarted."""
SILENCE_SECONDS = 20
"""A PostgreSQL server or client that says nothing for this many seconds is believed gone. A client's locks end with it."""
UNAVAILABLE = (OperationalError, InterfaceError, TimeoutError)
"""These are raised when the database cannot be reached, or not in time."""
_LINK = {
    "connect_timeout": 5,
    "keepalives_idle": SILENCE_SECONDS // 4,
    "keepalives_interval": SILENCE_SECONDS // 4,
    "keepalives_count": 3,
    "tcp_user_timeout": 1000 * SILENCE_SECONDS,
}


_PROJECT = "project"


@event.listens_for(Session, "do_orm_execute")
def _only_own(state: ORMExecuteState) -> None:
    """Leaves the rows of other projects out of what a project's session finds or changes, also where they are joined or asked for by id."""
    project = project_of(state.session)
    if project is not None and (state.is_select or state.is_update or state.is_delete):
        state.statement = state.statement.options(_of_project(project))


@lru_cache
def _of_project(project: str) -> LoaderCriteriaOption:
    return with_loader_criteria(Owned, lambda row: row.project == project, include_aliases=True)


def project_of(session: Session) -> str | None:
    """Returns the project whose rows alone the session finds; None where it finds all rows."""
    project: str | None = session.info.get(_PROJECT)
    return project


@contextmanager
def all_projects(session: Session) -> Iterator[None]:
    """Lets a project's session find the rows of all projects while the block runs: to count them, and to show nothing else of them."""
    project = session.info.pop(_PROJECT, None)
    try:
        yield
    finally:
        if project is not None:
            session.info[_PROJECT] = project


class Database:
    """Holds one database: its engines for reading and for writing, and the two kinds of transaction.

    Attributes:
        disk: the disk of an SQLite database; that of a PostgreSQL server is not looked at.
        project: sessions find the rows of this project only; None for all rows.

    Raises:
        CirisError: data_directory, where the directory of an SQLite database is missing and cannot be made.
    """

    def __init__(self, url: str) -> None:
        parsed = make_url(url)
        self.sqlite = parsed.get_backend_name() == "sqlite"
        self.reader, self.writer = _sqlite(parsed) if self.sqlite else _postgresql(parsed)
        self.disk = Disk(Path(parsed.database).absolute().parent if self.sqlite and parsed.database else None)
        self.project: str | None = None
        self._log = Path(f"{parsed.database}-wal") if self.sqlite and parsed.database else None
        self._views: dict[str, Database] = {}

    def of(self, project: str) -> Database:
        """Returns this database as a project sees it, always the same object for the same project. The connections are shared."""
        view = self._views.get(project)
        if view is None:
            view = copy.copy(self)
            view.project = project
            view = self._views.setdefault(project, view)
        return view

    @contextmanager
    def read(self) -> Iterator[Session]:
        """Opens a session that only reads. Its rows stay usable after it."""
        with Session(self.reader, expire_on_commit=False, info=self._info()) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """Opens a transaction that may write. It commits at the end, and rolls back when an exception leaves the block.

        Raises:
            CirisError: database_version, when the database is of another version than this program.
        """
        with Session(self.writer, expire_on_commit=False, info=self._info()) as session, session.begin():
            version.hold(session)
            yield session

    def _info(self) -> dict[str, Any]:
        return {} if self.project is None else {_PROJECT: self.project}

    def shrink(self) -> None:
        """Gives some of the room that SQLite does not use back to the disk, where there is much of it. PostgreSQL sees to this itself."""
        if not self.sqlite:
            return
        with self.reader.connect() as connection:
            pages, free = (connection.exec_driver_sql(f"PRAGMA {name}").scalar_one() for name in ("page_count", "freelist_count"))
        if free > max(SPARE_PAGES, pages / 4):
            # One step of this statement gives back one page, and only a script is stepped to its end.
            script = f"BEGIN IMMEDIATE; PRAGMA incremental_vacuum({PAGES_TOGETHER}); COMMIT"
            with closing(self.writer.raw_connection()) as connection:
                connection.cursor().executescript(script)

    def checkpoint(self) -> None:
        """Copies SQLite's log into the database where it is long, so that the log begins again. This lasts as long as the disk needs.

        Nobody waits meanwhile. Writers that never rest would keep the log from beginning again; so they wait for a short copy once
        the log is very long, and no longer than QUICK_SECONDS for those who read.
        """
        if self._log_bytes() <= LOG_BYTES:
            return
        with closing(self.reader.raw_connection()) as connection:
            cursor, began = connection.cursor(), time.monotonic()
            cursor.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
            if self._log_bytes() <= LONG_LOG_BYTES or time.monotonic() - began > QUICK_SECONDS:
                return
            # It holds the writers' lock while it waits for those who still read the log.
            cursor.execute(f"PRAGMA busy_timeout={int(1000 * QUICK_SECONDS)}")
            try:
                cursor.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
            finally:
                cursor.execute(f"PRAGMA busy_timeout={int(1000 * BUSY_SECONDS)}")

    def _log_bytes(self) -> int:
        """Returns the length of SQLite's log; 0 where there is none."""
        try:
            return self._log.stat().st_size if self._log is not None else 0
        except FileNotFoundError:
            return 0

    def connections(self) -> dict[tuple[str, str], int]:
        """Returns how many connections of this process each pool has: (pool, ``used``, ``idle`` or ``most``) -> number.

        SQLite has a pool for reading and one for writing, PostgreSQL one for both.
        """
        pools = {"read": self.reader.pool, "write": self.writer.pool} if self.sqlite else {"both": self.writer.pool}
        counts: dict[tuple[str, str], int] = {}
        for name, pool in pools.items():
            assert isinstance(pool, QueuePool)
            counts |= {(name, "used"): pool.checkedout(), (name, "idle"): pool.checkedin(), (name, "most"): pool.size()}
        return counts

    def close(self) -> None:
        self.reader.dispose()
        self.writer.dispose()


def without_sorting(session: Session) -> None:
    """Makes PostgreSQL answer the queries of this transaction from an index that has their order, where there is one.

    PostgreSQL knows nothing yet about rows that are newer than its statistics. It expects few of them, and may read and sort them all.
    """
    if session.get_bind().dialect.name == "postgresql":
        session.execute(text("SET LOCAL enable_sort = off"))


def insert_new(session: Session, model: type[DeclarativeBase], rows: list[dict[str, Any]]) -> int:
    """Inserts rows, except those that exist already by a unique constraint. Returns how many it inserted."""
    if not rows:
        return 0
    insert = inserting(session, model).on_conflict_do_nothing().returning(*model.__table__.primary_key)
    return len(session.execute(insert, rows).all())


def inserting(session: Session, model: type[DeclarativeBase]) -> sqlite.Insert | postgresql.Insert:
    """Returns an insertion that may say what happens with rows that are there already."""
    dialect = {"sqlite": sqlite, "postgresql": postgresql}[session.get_bind().dialect.name]
    return dialect.insert(model)


@cache
def database() -> Database:
    """Returns the database of the settings, one for the process. A forked child must call ``database.cache_clear()`` first."""
    return Database(settings().database)


def check_version(url: str) -> None:
    """Refuses a database of another version. One that cannot be reached yet is refused later, by who writes to it.

    Raises:
        CirisError: database_version, data_directory; no_database, for a file that is none.
    """
    with closing(Database(url)) as tried:
        try:
            with tried.read() as session:
                version.check(session)
        except UNAVAILABLE:
            return
        except DatabaseError as error:
            raise unusable.refusal(error, url) from None


def make_directory(directory: Path) -> None:
    """Makes the directory of an SQLite database where there is none. It is for its user alone.

    Raises:
        CirisError: data_directory.
    """
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        hint = "name a directory that you may write to, on a disk with room"
        problem = f"{directory} cannot be made: {unreadable(error)}"
        raise CirisError("data_directory", problem, field="CIRIS_DATABASE_URL", hint=hint) from None


def _strict_json(value: Any) -> str:
    return json.dumps(value, allow_nan=False)


def _sqlite(url: URL) -> tuple[Engine, Engine]:
    if url.database:
        make_directory(Path(url.database).parent)
    engines = _engine(url, connect_args={"timeout": BUSY_SECONDS}), _engine(url, 1, connect_args={"timeout": BUSY_SECONDS})
    for engine, begin in zip(engines, ("BEGIN", "BEGIN IMMEDIATE"), strict=True):
        event.listen(engine, "connect", _configure_sqlite)
        event.listen(engine, "begin", partial(_begin_sqlite, begin))
    return engines


def _postgresql(url: URL) -> tuple[Engine, Engine]:
    engine = _engine(url, connect_args=_LINK)
    event.listen(engine, "connect", _configure_postgresql)
    event.listen(engine, "checkin", _note_use)
    event.listen(engine, "checkout", partial(_try_if_idle, engine.dialect))
    return engine.execution_options(isolation_level="AUTOCOMMIT"), engine


def _engine(url: URL, connections: int = CONNECTIONS, **options: Any) -> Engine:
    pool = {"poolclass": QueuePool, "pool_size": connections, "max_overflow": 0, "pool_timeout": BUSY_SECONDS}
    return create_engine(url, **pool, **options, json_serializer=_strict_json, hide_parameters=True)


def _configure_sqlite(connection: Any, _record: Any) -> None:
    connection.isolation_level = None
    # This has an effect on a database without tables only, but is always a write, for which a disk may lack room.
    if connection.execute("PRAGMA auto_vacuum").fetchone() != (INCREMENTAL,):
        connection.execute(f"PRAGMA auto_vacuum={INCREMENTAL}")
    for pragma in (
        "journal_mode=WAL",
        "synchronous=NORMAL",
        "foreign_keys=ON",
        f"wal_autocheckpoint={LONG_LOG_PAGES}",
        f"journal_size_limit={LOG_BYTES}",
    ):
        connection.execute(f"PRAGMA {pragma}")


def _begin_sqlite(begin: str, connection: Connection) -> None:
    connection.exec_driver_sql(begin)


def _configure_postgresql(connection: Any, record: Any) -> None:
    """Makes the server end a transaction whose client is gone or hangs, so that its locks do not last.

    It also makes the server plan every query for the tables as they are. A plan that it keeps may be from when a table was small, and
    read all of it.
    """
    with connection.cursor() as cursor:
        cursor.execute(f"SET idle_in_transaction_session_timeout = '{SILENCE_SECONDS}s'")
        cursor.execute("SET plan_cache_mode = force_custom_plan")
    connection.commit()
    _note_use(connection, record)


def _note_use(_connection: Any, record: Any) -> None:
    record.info["used"] = time.monotonic()


def _try_if_idle(dialect: Dialect, connection: Any, record: Any, _proxy: Any) -> None:
    """Makes the pool replace a connection that was idle and is dead.

    Raises:
        DisconnectionError: to tell the pool so.
    """
    if time.monotonic() - record.info["used"] < IDLE_SECONDS:
        return
    try:
        dialect.do_ping(connection)
    except dialect.loaded_dbapi.Error as error:
        raise DisconnectionError from error
