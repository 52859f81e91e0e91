"""A process works only with a database of its own version. This module compares the two.

The version of a database is the revision of its last migration. This one number stands for the schema and for the protocol: what
processes of the service leave for each other in rows and messages. So a change of either needs a migration, even where no table changes.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import version
from pathlib import Path

from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from certifier.errors import CirisError

LOCK = 0x43495249
""""CIRI" in ASCII: who migrates a PostgreSQL database holds this advisory lock alone, and who writes shares it with others."""
TABLE = "alembic_version"
"""The table that says at which revision the database is."""
_READ = f"SELECT version_num FROM {TABLE}"
_NO_TABLE = "42P01"
"""PostgreSQL's name for a table that is not there."""


@cache
def revisions() -> tuple[str, ...]:
    """Returns the revisions that this version of the program knows, the oldest first. It works with the last one."""
    files = (Path(__file__).parent / "migrations" / "versions").glob("[0-9]*.py")
    return tuple(sorted(file.name.partition("_")[0] for file in files))


def check(session: Session) -> None:
    """Refuses a database of another version.

    Raises:
        CirisError: database_version.
    """
    _compare(_read(session.connection(), _READ))


def hold(session: Session) -> None:
    """Refuses a database of another version, and lets nobody migrate it until the transaction has ended.

    On SQLite the transaction holds the writers' lock already. PostgreSQL takes both statements in one message, and the second one sees
    what a migration has done for which the first one has waited.

    Raises:
        CirisError: database_version.
    """
    connection = session.connection()
    share = "" if connection.dialect.name == "sqlite" else f"SELECT pg_advisory_xact_lock_shared({LOCK}); "
    _compare(_read(connection, share + _READ))


def refusal(found: str | None) -> CirisError:
    """Returns the error that says of a database of this revision, or of none, what to do."""
    known = revisions()
    problem = f"the database is at revision {found}, and this version of ciris ({version('ciris')}) works with {known[-1]}"
    if found is None:
        problem, hint = f"the database has no tables of ciris, and version {version('ciris')} needs them", "`ciris db upgrade` makes them"
    elif found in known:
        hint = "make a backup (`ciris db backup`), stop all processes of the older version, and call `ciris db upgrade`"
    elif not found.isdecimal():
        problem, hint = f"the database is at revision {found}, which is another program's", "name a database that ciris has for itself"
    elif found < known[0]:
        hint = "start version 0.1.0 of ciris on it once, then call `ciris db upgrade`"
    else:
        hint = "install the version that migrated it, or have that version go back: `ciris db downgrade`"
    return CirisError("database_version", problem, field="CIRIS_DATABASE_URL", hint=hint)


def _read(connection: Connection, statements: str) -> str | None:
    """Returns what the last statement reads: the revision; None in a database without migrations."""
    try:
        result = connection.exec_driver_sql(statements)
    except DBAPIError as error:
        if getattr(error.orig, "sqlstate", None) == _NO_TABLE or "no such table" in str(error.orig):
            return None
        raise
    cursor = result.cursor
    if ";" in statements:
        cursor.nextset()
    row = cursor.fetchone()
    result.close()
    return None if row is None else str(row[0])


def _compare(found: str | None) -> None:
    if found != revisions()[-1]:
        raise refusal(found)
