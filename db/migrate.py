"""This module brings a database to a version of the schema.

``python -m db.migrate`` brings the database of the settings to the newest version.
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
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, event

from certifier.errors import CirisError
from db.models import Base
from db.session import Database
from db.settings import settings

_ADVISORY_LOCK = 0x43495249  # "CIRI" in ASCII; who migrates a PostgreSQL database holds this lock


@contextmanager
def connection_for_migrations(url: str) -> Iterator[Connection]:
    """Opens a connection in a transaction that excludes other migrations.

    On SQLite foreign keys are off in it. There, a migration changes a table by making a new one and dropping the old one; with foreign
    keys on, that would delete the rows of other tables that refer to it.
    """
    database = Database(url)
    if database.sqlite:
        event.listen(database.writer, "connect", lambda connection, _record: connection.execute("PRAGMA foreign_keys=OFF"))
    try:
        with database.writer.begin() as connection:
            if not database.sqlite:
                connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_ADVISORY_LOCK})")
            yield connection
    finally:
        database.close()


def upgrade(url: str, revision: str = "head") -> None:
    """Migrates up to ``revision``. Nothing happens when the database is there already.

    Raises:
        CirisError: database_version.
    """
    with connection_for_migrations(url) as connection:
        _check(connection)
        command.upgrade(_config(connection), revision)
    _let_it_shrink(url)


def downgrade(url: str, revision: str) -> None:
    """Migrates down to ``revision``. ``base`` is the empty database."""
    with connection_for_migrations(url) as connection:
        command.downgrade(_config(connection), revision)


def drift(url: str) -> list[Any]:
    """Returns what differs between the database and the models; empty when nothing does."""
    with connection_for_migrations(url) as connection:
        return list(compare_metadata(MigrationContext.configure(connection), Base.metadata))


def _check(connection: Connection) -> None:
    """Refuses a database of a version that this one does not know."""
    current = MigrationContext.configure(connection).get_current_revision()
    known = [script.revision for script in ScriptDirectory.from_config(_config(connection)).walk_revisions()]
    if current is not None and current not in known:
        problem = f"the database is at revision {current}, and this version knows {min(known)} to {max(known)}"
        hint = "for a smaller revision, start version 0.1.0 on the database once; for a larger one, install the version that made it"
        raise CirisError("database_version", problem, field="CIRIS_DATABASE_URL", hint=hint)


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
    upgrade(settings().database)
