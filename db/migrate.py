"""This module brings a database to a revision of its tables, up or down (``ciris db``, ``ciris up``).

A migration is one transaction: it happens as a whole or not at all. Nobody else writes meanwhile, and no worker may live that would go
on afterwards with a database that it does not know.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from sqlalchemy import Connection, event, inspect
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import version, workers
from db.models import Base
from db.session import Database

BASE = "base"
"""Alembic's name for a database from which everything is taken away."""


@contextmanager
def connection_for_migrations(url: str) -> Iterator[Connection]:
    """Opens a connection in a transaction that excludes other migrations, and processes that write.

    On SQLite foreign keys are off in it. There, a migration changes a table by making a new one and dropping the old one; with foreign
    keys on, that would delete the rows of other tables that refer to it.
    """
    database = Database(url)
    if database.sqlite:
        event.listen(database.writer, "connect", lambda connection, _record: connection.execute("PRAGMA foreign_keys=OFF"))
    try:
        with database.writer.begin() as connection:
            if not database.sqlite:
                connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({version.LOCK})")
            yield connection
    finally:
        database.close()


def upgrade(url: str, revision: str | None = None) -> tuple[str | None, str]:
    """Migrates up to ``revision``; default: the newest one. Nothing happens when the database is there already.

    Returns the revision of before, None for a database without tables, and the one of now.

    Raises:
        CirisError: database_version, unknown_revision, workers_live.
    """
    aim = version.revisions()[-1] if revision is None else revision
    with connection_for_migrations(url) as connection:
        before = known_revision(connection)
        _check_aim(aim, version.revisions()[version.revisions().index(before) if before else 0 :], before)
        if before != aim:
            _check_nobody_works(connection, before)
            raise_to(connection, aim)
    _let_it_shrink(url)
    return before, aim


def downgrade(url: str, revision: str) -> str:
    """Migrates down to ``revision``, and returns the one of before. What the older tables cannot hold is lost.

    Args:
        revision: ``base`` takes every table away.

    Raises:
        CirisError: database_version, unknown_revision, workers_live.
    """
    with connection_for_migrations(url) as connection:
        before = known_revision(connection)
        if before is None:
            raise version.refusal(None)
        _check_aim(revision, (BASE, *version.revisions()[: version.revisions().index(before) + 1]), before)
        _check_nobody_works(connection, before)
        command.downgrade(_config(connection), revision)
    return before


def raise_to(connection: Connection, revision: str) -> None:
    """Migrates up to ``revision`` in the transaction of the connection."""
    command.upgrade(_config(connection), revision)


def known_revision(connection: Connection) -> str | None:
    """Returns the revision of a database; None where it has no tables.

    Raises:
        CirisError: database_version, when this version of the program does not know it; not_empty, where the tables are another program's.
    """
    current = MigrationContext.configure(connection).get_current_revision()
    if current is not None and current not in version.revisions():
        raise version.refusal(current)
    if current is None and (others := sorted(set(inspect(connection).get_table_names()) - {version.TABLE})):
        problem = f"the database has tables of another program: {', '.join(others[:3])}{', ...' if len(others) > 3 else ''}"
        raise CirisError("not_empty", problem, field="CIRIS_DATABASE_URL", hint="name a database that ciris has for itself")
    return current


def drift(url: str) -> list[Any]:
    """Returns what differs between the database and the models; empty when nothing does."""
    with connection_for_migrations(url) as connection:
        return list(compare_metadata(MigrationContext.configure(connection), Base.metadata))


def _check_aim(aim: str, may: tuple[str, ...], now: str | None) -> None:
    if aim not in may:
        problem = f"no way leads from the revision {now or BASE} to {aim!r}"
        raise CirisError("unknown_revision", problem, field="revision", hint=f"name one of {', '.join(may)}")


def _check_nobody_works(connection: Connection, revision: str | None) -> None:
    """Refuses to migrate while workers live. Each of them holds work, and those of earlier versions would go on.

    Raises:
        CirisError: workers_live.
    """
    if revision is None:
        return
    with Session(bind=connection) as session:
        living = workers.living(session)
    if living:
        problem = f"these workers live, and would go on with it: {', '.join(living)}"
        hint = "stop them, or drain them (`ciris worker drain`); one that was killed counts for a minute"
        raise CirisError("workers_live", problem, field="CIRIS_DATABASE_URL", hint=hint)


def _let_it_shrink(url: str) -> None:
    """Rewrites an SQLite database of an earlier version once, so that deletions give room back. Meanwhile it needs as much room again."""
    database = Database(url)
    try:
        if database.sqlite:
            with closing(database.writer.raw_connection()) as connection:
                cursor = connection.cursor()
                cursor.execute("PRAGMA auto_vacuum")
                if cursor.fetchone() == (0,):
                    cursor.execute("VACUUM")
    finally:
        database.close()


def _config(connection: Connection) -> Config:
    config = Config(str(Path(__file__).parent / "alembic.ini"))
    config.attributes["connection"] = connection
    return config


if __name__ == "__main__":
    raise SystemExit("error: nothing was migrated; `ciris db upgrade` does that now")
