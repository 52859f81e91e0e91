"""A backup is one SQLite file with every row of the database, proofs included, as of one moment. It does not matter of which kind the
database was: the file can be restored into SQLite and into PostgreSQL. Behind the pages of SQLite, which does not look there, stands one
line with the SHA-256 of all before it. Files of older versions have no such line, and the number that SQLite keeps for applications tells
them from files that have lost it.

A file is written beside its place and put there when it is whole and on the disk. A database is restored in one transaction, or put in
place as a whole file. So what fails half way leaves everything as it was.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sqlite3
import stat
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

from sqlalchemy import JSON, Connection, DateTime, LargeBinary, MetaData, Select, Table, Text, cast, create_engine, insert, inspect, select
from sqlalchemy.engine import make_url
from sqlalchemy.types import NullType

from certifier.errors import CirisError, unreadable
from certifier.model import hash_of
from db import migrate, version
from db.session import Database, make_directory
from db.settings import sqlite_url
from db.types import Utc

_FORGET_WORKERS = "DELETE FROM workers"
_PART_BYTES = 2**20
_ROWS, _LARGE_ROWS = 500, 1
"""This many rows are in memory at once; of tables with files, which may have 100 MB each, the second number."""
_FIELD = "FILE"
_APPLICATION, _APPLICATION_AT, _HEAD_BYTES = 0x43495249, 68, 72
"""The number of files that have a digest, "CIRI" in ASCII, and where SQLite's format has it."""
_SEAL = b"\nciris backup; sha256 of what stands before this line: "
_SEAL_BYTES = len(_SEAL) + 65


def backup(url: str, path: Path) -> str:
    """Writes the database into a new file, whichever revision it is at, and returns the revision. Others may work on it meanwhile.

    Raises:
        CirisError: file_exists, unwritable, database_version; damaged_backup, when what was read is not whole.
    """
    if os.path.exists(path):
        kind = "directory" if path.is_dir() else "file"
        raise CirisError("file_exists", f"there is a {kind} {path} already", field=_FIELD, hint="name a file that is not there yet")
    database = Database(url)
    try:
        with _new_file(path) as partial:
            revision = (_backup_sqlite if database.sqlite else _backup_postgresql)(database, partial)
            with closing(sqlite3.connect(partial)) as file:
                file.execute("PRAGMA journal_mode=DELETE")  # so that the backup is one file
                file.execute(f"PRAGMA application_id={_APPLICATION}")
            _check_content(partial)
            _seal(partial)
    finally:
        database.close()
    return revision


def restore(url: str, path: Path) -> str:
    """Fills a database that is empty from the file, and returns its revision. The workers of the file's database are none of this one.

    Raises:
        CirisError: not_a_backup, damaged_backup, unwritable; database_version, when this version does not know the file's revision;
            not_empty, when the database has tables; data_directory.
    """
    revision = _check_whole(path)
    parsed = make_url(url)
    if parsed.get_backend_name() == "sqlite":
        _restore_sqlite(path, Path(parsed.database or ""))
    else:
        _restore_postgresql(url, path, revision)
    return revision


def _backup_sqlite(database: Database, partial: Path) -> str:
    with database.reader.connect() as connection:
        revision = _known(connection)
    with closing(database.reader.raw_connection()) as raw:
        raw.cursor().execute("VACUUM INTO ?", (str(partial),))
    return revision


def _backup_postgresql(database: Database, partial: Path) -> str:
    snapshot = database.writer.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)
    with snapshot.begin() as source:
        source.exec_driver_sql("SET LOCAL idle_in_transaction_session_timeout = 0")  # the file's disk may take its time
        revision = _known(source)
        migrate.upgrade(sqlite_url(partial), revision)
        with migrate.connection_for_migrations(sqlite_url(partial)) as target:
            _copy(source, target)
            for table, last in _last_ids(source).items():
                target.exec_driver_sql("UPDATE sqlite_sequence SET seq = ? WHERE name = ?", (last, table))
    return revision


def _restore_sqlite(path: Path, place: Path) -> None:
    make_directory(place.parent)
    _check_empty(not os.path.exists(f"{place}-wal"), f"{place}-wal")
    _check_empty(not os.path.exists(place) or _has_no_tables(place), str(place))
    with _new_file(place) as partial:
        shutil.copyfile(path, partial)
        if sealed(partial):
            os.truncate(partial, partial.stat().st_size - _SEAL_BYTES)
        with closing(sqlite3.connect(partial)) as file:
            file.execute("PRAGMA application_id=0")
            file.execute(_FORGET_WORKERS)
            file.commit()


def _open(path: Path, how: str) -> sqlite3.Connection:
    """Opens a file that is there, as SQLite's URIs say how. No character of its path has a meaning in the URI."""
    return sqlite3.connect(f"file:{quote(os.fsencode(path.absolute()))}?{how}", uri=True)


def _has_no_tables(place: Path) -> bool:
    """Says whether an SQLite database that has no log has no tables, or only the empty one that `ciris db downgrade base` leaves."""
    try:
        with closing(_open(place, "immutable=1")) as there:
            tables = {name for (name,) in there.execute("SELECT name FROM sqlite_master WHERE name NOT LIKE 'sqlite_%'")}
            return not tables or (tables == {version.TABLE} and not there.execute(f"SELECT 1 FROM {version.TABLE}").fetchone())
    except sqlite3.DatabaseError:
        return False


def _restore_postgresql(url: str, path: Path, revision: str) -> None:
    """Makes the tables and fills them, in one transaction. Keys to other rows are checked at its end, as rows may refer to later ones."""
    source_engine = create_engine("sqlite://", creator=lambda: _open(path, "mode=ro"))
    try:
        with source_engine.connect() as source, migrate.connection_for_migrations(url) as target:
            target.exec_driver_sql("SET LOCAL idle_in_transaction_session_timeout = 0")
            _check_empty(set(inspect(target).get_table_names()) <= {version.TABLE}, target.engine.url.database or "")
            migrate.raise_to(target, revision)
            keys = target.exec_driver_sql(
                "SELECT conrelid::regclass::text, quote_ident(conname) FROM pg_constraint WHERE contype = 'f'"
                " AND connamespace = current_schema()::regnamespace"
            ).all()
            for table, key in keys:
                target.exec_driver_sql(f"ALTER TABLE {table} ALTER CONSTRAINT {key} DEFERRABLE INITIALLY DEFERRED")
            _copy(source, target)
            target.exec_driver_sql(_FORGET_WORKERS)
            target.exec_driver_sql("SET CONSTRAINTS ALL IMMEDIATE")
            for table, key in keys:
                target.exec_driver_sql(f"ALTER TABLE {table} ALTER CONSTRAINT {key} NOT DEFERRABLE")
            for table, last in _last_ids(source).items():
                target.exec_driver_sql("SELECT setval(pg_get_serial_sequence(%s, 'id'), %s)", (table, last))
    finally:
        source_engine.dispose()


def _copy(source: Connection, target: Connection) -> None:
    """Copies every row between two databases of the same revision, whatever rows a migration has made in the target."""
    tables, into = _tables(source), _tables(target)
    assert {table.name: set(table.c.keys()) for table in tables} == {table.name: set(table.c.keys()) for table in into}, "one revision"
    of = {table.name: table for table in into}
    for table in reversed(into):
        target.execute(table.delete())
    for table in tables:
        large = any(isinstance(column.type, LargeBinary) for column in table.c)
        together = _LARGE_ROWS if large else _ROWS
        rows = source.execute(_all(table), execution_options={"yield_per": together})
        for part in rows.mappings().partitions():
            target.execute(insert(of[table.name]), [dict(row) for row in part])


def _tables(connection: Connection) -> list[Table]:
    """Returns the tables as the database has them, those first that others refer to. Their columns take what those of the other kind give:
    times with their zone, and documents as the text that is stored.
    """
    metadata = MetaData()
    metadata.reflect(connection)
    for table in metadata.tables.values():
        for column in table.c:
            if isinstance(column.type, DateTime):
                column.type = Utc()
            elif isinstance(column.type, JSON):
                column.type = NullType()
    return [table for table in metadata.sorted_tables if table.name != version.TABLE]


def _all(table: Table) -> Select[Any]:
    return select(*(cast(column, Text).label(column.name) if isinstance(column.type, NullType) else column for column in table.c))


def _last_ids(connection: Connection) -> dict[str, int]:
    """Returns the last id that each table which counts its rows has given, also to a row that is gone: clients may know it."""
    if connection.dialect.name == "sqlite":
        counted = [table for table in inspect(connection).get_table_names() if table != version.TABLE]
        last = {str(table): int(seq) for table, seq in connection.exec_driver_sql("SELECT name, seq FROM sqlite_sequence")}
        for table in counted:
            columns = {column["name"]: column["type"] for column in inspect(connection).get_columns(table)}
            if str(columns.get("id")) == "INTEGER":
                found = connection.exec_driver_sql(f'SELECT max(id) FROM "{table}"').scalar()
                last[table] = max(last.get(table, 0), found or 0)
        return {table: number for table, number in last.items() if number}
    owned = connection.exec_driver_sql(
        "SELECT c.relname, s.last_value FROM pg_class c JOIN pg_depend d ON d.refobjid = c.oid AND d.deptype IN ('a', 'i')"
        " JOIN pg_class q ON q.oid = d.objid AND q.relkind = 'S' JOIN pg_namespace n ON n.oid = q.relnamespace"
        " JOIN pg_sequences s ON s.schemaname = n.nspname AND s.sequencename = q.relname"
        " WHERE n.nspname = current_schema() AND s.last_value IS NOT NULL"
    )
    return {str(table): int(last) for table, last in owned}


def _known(connection: Connection) -> str:
    revision = migrate.known_revision(connection)
    if revision is None:
        raise version.refusal(None)
    return revision


def _check_empty(empty: bool, what: str) -> None:
    if not empty:
        hint = "name a new one in CIRIS_DATABASE_URL or --data; nothing was changed"
        raise CirisError("not_empty", f"{what} is not empty, and a backup would replace what it holds", field="database", hint=hint)


def sealed(path: Path) -> bool:
    """Says whether a backup has a digest of its content behind it; one of an older version has none.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - _SEAL_BYTES))
        return file.read(len(_SEAL)) == _SEAL


def _seal(path: Path) -> None:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    with path.open("ab") as file:
        file.write(_SEAL + f"{digest}\n".encode())


def _check_seal(path: Path) -> None:
    """Compares the content of a file with the digest behind it.

    Raises:
        CirisError: damaged_backup, also for a file that has lost its digest.
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        left = path.stat().st_size - _SEAL_BYTES
        if not sealed(path):
            head = file.read(_HEAD_BYTES)
            if head[_APPLICATION_AT:] == _APPLICATION.to_bytes(4, "big"):
                more = left - _bytes_of_pages(head)
                raise _damaged(path, f"{more} bytes stand behind its end" if more > 0 else "its end is missing")
            return
        digest = hashlib.sha256()
        while left > 0 and (part := file.read(min(left, _PART_BYTES))):
            digest.update(part)
            left -= len(part)
        if file.read() != _SEAL + f"{digest.hexdigest()}\n".encode():
            raise _damaged(path, "its content has another digest than when it was written")


def _bytes_of_pages(head: bytes) -> int:
    """Returns how long the pages of SQLite are together, as the head of the file says."""
    size, count = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
    return count * (2**16 if size == 1 else size)


def _check_whole(path: Path) -> str:
    """Returns the revision of a backup that is as it was written.

    Raises:
        CirisError: not_a_backup, damaged_backup, database_version.
    """
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise _not_a_backup(f"{path} is {'a directory' if stat.S_ISDIR(mode) else 'no regular file'}")
        _check_seal(path)
    except OSError as error:
        raise _not_a_backup(f"{path}: {unreadable(error)}") from None
    return _check_content(path)


def _check_content(path: Path) -> str:
    """Returns the revision of a backup that is whole: its pages, its keys to other rows, each proof and each scene by its digest.

    Raises:
        CirisError: not_a_backup, damaged_backup, database_version.
    """
    try:
        with closing(_open(path, "mode=ro")) as file:
            return _check_rows(file, path)
    except sqlite3.DatabaseError as error:
        raise _damaged(path, str(error)) from None


def _check_rows(file: sqlite3.Connection, path: Path) -> str:
    if not file.execute("SELECT 1 FROM sqlite_master WHERE name = ?", (version.TABLE,)).fetchone():
        raise _not_a_backup(f"{path} has no tables of ciris")
    revision = file.execute(f"SELECT version_num FROM {version.TABLE}").fetchone()
    if revision is None or revision[0] not in version.revisions():
        raise version.refusal(revision and revision[0])
    (said,) = file.execute("PRAGMA integrity_check(1)").fetchone()
    if said != "ok":
        raise _damaged(path, said)
    if broken := file.execute("PRAGMA foreign_key_check").fetchone():
        raise _damaged(path, f"a row of {broken[0]} refers to a row of {broken[2]} that is missing")
    for digest, data in file.execute("SELECT digest, data FROM proofs"):
        if hashlib.sha256(data).hexdigest() != digest:
            raise _damaged(path, f"the proof {digest} has changed")
    for scene_id, digest, document in file.execute("SELECT id, hash, document FROM scenes"):
        if _hash_of_scene(document) != digest:
            raise _damaged(path, f"the scene {scene_id} has changed")
    return str(revision[0])


def _hash_of_scene(document: str) -> str | None:
    """Returns the hash of a stored scene; None for what is no document of one."""
    try:
        return hash_of(json.loads(document))
    except (ValueError, TypeError, AttributeError):
        return None


def _not_a_backup(problem: str) -> CirisError:
    return CirisError("not_a_backup", problem, field=_FIELD, hint="name a file of `ciris db backup`")


def _damaged(path: Path, why: str) -> CirisError:
    return CirisError("damaged_backup", f"{path} is not whole: {why}", field=_FIELD, hint="take another backup; nothing was changed")


@contextmanager
def _new_file(path: Path) -> Iterator[Path]:
    """Yields where to write a file that only its user may read. After the block it is in its place and whole, or it is gone.

    Raises:
        CirisError: unwritable.
    """
    partial = path.with_name(f"{path.name}.partial")
    try:
        partial.unlink(missing_ok=True)  # of a run that was killed
        os.close(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
        try:
            yield partial
            _to_disk(partial)
            partial.replace(path)
            _to_disk(path.parent)
        finally:
            for left in (partial, *(path.with_name(f"{partial.name}{end}") for end in ("-wal", "-shm", "-journal"))):
                left.unlink(missing_ok=True)
    except (OSError, sqlite3.Error) as error:
        why = unreadable(error) if isinstance(error, OSError) else str(error)
        problem = f"{path} cannot be written: {why}"
        raise CirisError("unwritable", problem, field=_FIELD, hint="name a place that you may write to, with room") from None


def _to_disk(path: Path) -> None:
    file = os.open(path, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)
