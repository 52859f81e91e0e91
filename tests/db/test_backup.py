"""A backup has every row, and goes back into either database whole or not at all."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select, text

from certifier.errors import CirisError
from db import backup, jobs, leases, migrate, proofs, version, workers
from db.models import EventRow, JobRow, ProofRow
from db.session import Database
from db.settings import Settings, sqlite_url
from db.states import WorkerState
from db.workers import Made, WorkerKind
from tests.db.builders import a_job, a_running_job, add_region
from tests.services import Postgres

PROOF = b"a proof \0 of all bytes: " + bytes(range(256))
NEWEST = version.revisions()[-1]


@pytest.fixture(params=["sqlite", "postgresql"])
def other_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """The URL of another empty database."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'other' / 'ciris.sqlite3'}"
    server: Postgres = request.getfixturevalue("postgres")
    return server.new_database()


@pytest.fixture
def filled(database_url: str) -> str:
    """A database with jobs, one of which retries a later one, a region, and a proof; the newest event has been deleted."""
    database = Database(database_url)
    with database.write() as session:
        first, second = a_running_job(session, pair_count=3), a_job(session)
        add_region(session, second)
        jobs.keep_growth(session, first, {"next": 1, "ratio": 0.1 + 0.2})
        first.retry_of = second.id
        proofs.put(session, [PROOF])
        session.add(EventRow(job_id=second.id, seq=998, kind="lost", data={}))
        session.flush()
        session.delete(session.scalars(select(EventRow).order_by(EventRow.id.desc()).limit(1)).one())
    database.close()
    return database_url


def rows(path: Path) -> list[str]:
    """Every row of a backup, as it is stored."""
    with closing(sqlite3.connect(path)) as file:
        return sorted(line for line in file.iterdump() if line.startswith("INSERT"))


def last_event(url: str) -> int:
    database = Database(url)
    with database.write() as session:
        event = EventRow(job_id=session.scalars(select(JobRow.id)).first(), seq=999, kind="later", data={})
        session.add(event)
        session.flush()
        number = event.id
        session.rollback()
    database.close()
    return number


def test_every_row_comes_back_and_later_ids_stay_later(filled: str, other_url: str, tmp_path: Path) -> None:
    first, again = tmp_path / "first", tmp_path / "again"
    assert backup.backup(filled, first) == backup.restore(other_url, first) == NEWEST
    assert migrate.drift(other_url) == []
    backup.backup(other_url, again)
    assert rows(first) == rows(again)
    database = Database(other_url)
    with database.read() as session:
        assert proofs.get(session, proofs.digest(PROOF)) == PROOF
        assert any(jobs.growth(session, job.id) == {"next": 1, "ratio": 0.1 + 0.2} for job in session.scalars(select(JobRow)))
    database.close()
    assert last_event(other_url) == last_event(filled), "an event that clients have seen has no namesake"


def test_a_backup_of_before_an_upgrade_is_restored_and_upgraded(filled: str, other_url: str, tmp_path: Path) -> None:
    oldest, file = version.revisions()[0], tmp_path / "old"
    migrate.downgrade(filled, oldest)
    assert backup.backup(filled, file) == oldest
    assert backup.restore(other_url, file) == oldest
    assert migrate.upgrade(other_url) == (oldest, NEWEST)
    assert migrate.drift(other_url) == []
    database = Database(other_url)
    with database.read() as session:
        assert session.get_one(ProofRow, proofs.digest(PROOF)).data == PROOF
    database.close()


def test_a_backup_of_an_older_version_has_no_digest_and_is_restored(filled: str, other_url: str, tmp_path: Path) -> None:
    file, again = tmp_path / "file", tmp_path / "again"
    backup.backup(filled, file)
    assert backup.sealed(file)
    _as_of_an_older_version(file)
    assert not backup.sealed(file)
    backup.restore(other_url, file)
    backup.backup(other_url, again)
    assert rows(file) == rows(again)


def test_workers_of_the_other_database_are_none_of_the_restored_one(filled: str, other_url: str, tmp_path: Path) -> None:
    database = Database(filled)
    with database.write() as session:
        made = Made(leases.name_of(os.getpid()), WorkerKind.SOLVE, "1", 1, 1, 1)
        workers.tell(session, made, WorkerState.RUNNING)
    database.close()
    backup.backup(filled, tmp_path / "file")
    backup.restore(other_url, tmp_path / "file")
    assert migrate.downgrade(other_url, "base") == NEWEST


def test_what_has_no_tables_any_more_is_restored_into(filled: str, other_url: str, tmp_path: Path) -> None:
    file, again = tmp_path / "file", tmp_path / "again"
    backup.backup(filled, file)
    migrate.upgrade(other_url)
    migrate.downgrade(other_url, "base")
    backup.restore(other_url, file)
    backup.backup(other_url, again)
    assert rows(file) == rows(again)


@pytest.mark.parametrize("name", ["a b?c#d%20.db", "b1%41", "?", "file:x", "ü&mode=memory", "'"])
def test_every_name_names_what_it_says(filled: str, other_url: str, tmp_path: Path, name: str) -> None:
    """No character of a path has a meaning in SQLite's URIs or in the URL of a database."""
    (place := tmp_path / f"in {name}").mkdir()
    backup.backup(filled, place / name)
    backup.restore(other_url, place / name)
    assert os.listdir(place) == [name]
    data = tmp_path / f"data {name}"
    there = Settings(data_dir=data, database_url="").database
    backup.restore(there, place / name)
    assert os.listdir(data) == ["ciris.sqlite3"]
    migrate.upgrade(there)
    backup.backup(there, place / "again")
    assert rows(place / name) == rows(place / "again")


def test_a_name_that_no_disk_holds_is_refused(filled: str, tmp_path: Path) -> None:
    file, long = tmp_path / "file", tmp_path / ("x" * 300)
    backup.backup(filled, file)
    for act, code in (
        (lambda: backup.backup(filled, long), "unwritable"),
        (lambda: backup.restore(filled, long), "not_a_backup"),
        (lambda: backup.restore(sqlite_url(long), file), "unwritable"),
    ):
        with pytest.raises(CirisError, match="name too long") as refused:
            act()
        assert refused.value.code == code


def test_a_pipe_where_a_killed_run_left_its_file_is_not_waited_for(filled: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "file.partial")
    backup.backup(filled, tmp_path / "file")
    assert [path.name for path in tmp_path.glob("file*")] == ["file"]


def test_a_file_that_is_no_database_is_not_replaced(sqlite_url: str, tmp_path: Path) -> None:
    file, place = tmp_path / "file", tmp_path / "photos"
    backup.backup(sqlite_url, file)
    place.write_bytes(b"photos" * 100)
    with pytest.raises(CirisError, match="photos is not empty"):
        backup.restore(f"sqlite:///{place}", file)
    assert place.read_bytes() == b"photos" * 100


def test_a_backup_is_for_its_user_alone_and_takes_no_other_files_place(filled: str, tmp_path: Path) -> None:
    file = tmp_path / "file"
    backup.backup(filled, file)
    assert file.stat().st_mode & 0o777 == 0o600
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith("file")] == ["file"]
    before = file.read_bytes()
    with pytest.raises(CirisError, match="already") as refused:
        backup.backup(filled, file)
    assert (refused.value.code, file.read_bytes()) == ("file_exists", before)


def test_what_is_not_empty_is_not_replaced(filled: str, database_url: str, tmp_path: Path) -> None:
    file, later = tmp_path / "file", tmp_path / "later"
    backup.backup(filled, file)
    with pytest.raises(CirisError, match="is not empty") as refused:
        backup.restore(database_url, file)
    assert refused.value.code == "not_empty"
    backup.backup(database_url, later)
    assert rows(file) == rows(later)


def test_a_log_without_its_database_is_not_empty(sqlite_url: str, tmp_path: Path) -> None:
    file, place = tmp_path / "file", tmp_path / "gone.sqlite3"
    backup.backup(sqlite_url, file)
    place.with_name("gone.sqlite3-wal").write_bytes(b"what was committed last")
    with pytest.raises(CirisError, match="-wal is not empty"):
        backup.restore(f"sqlite:///{place}", file)
    assert not place.exists()


def _as_of_an_older_version(path: Path) -> None:
    """Takes the digest of a backup away, and the sign that it has one."""
    os.truncate(path, path.stat().st_size - backup._SEAL_BYTES)
    with closing(sqlite3.connect(path)) as file:
        file.execute("PRAGMA application_id=0")


def _change(statement: str, *values: object) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        if backup.sealed(path):
            _as_of_an_older_version(path)
        with closing(sqlite3.connect(path)) as file:
            file.execute(statement, values)
            file.commit()

    return change


def _cut(left: float) -> Callable[[Path], None]:
    return lambda path: os.truncate(path, int(path.stat().st_size * left))


def _cut_by(count: int) -> Callable[[Path], None]:
    return lambda path: os.truncate(path, path.stat().st_size - count)


def _flip(place: float) -> Callable[[Path], None]:
    def flip(path: Path) -> None:
        content = bytearray(path.read_bytes())
        content[int(place * (len(content) - 1))] ^= 1
        path.write_bytes(content)

    return flip


def _half_of_an_old_file(path: Path) -> None:
    _as_of_an_older_version(path)
    _cut(0.5)(path)


def _replace_by(make: Callable[[Path], None]) -> Callable[[Path], None]:
    def replace(path: Path) -> None:
        path.unlink()
        make(path)

    return replace


DOCUMENT = "UPDATE scenes SET document = replace(document, '\"padding\"', '\"paddinG\"')"


DAMAGES: dict[str, tuple[Callable[[Path], Any], str, str]] = {
    "a proof that has changed": (_change("UPDATE proofs SET data = ?", b"another"), "damaged_backup", "the proof .* has changed"),
    "a row that is missing": (_change("DELETE FROM scenes"), "damaged_backup", "refers to a row of scenes that is missing"),
    "a scene that has changed": (_change(DOCUMENT), "damaged_backup", "the scene .* has changed"),
    "a scene that is no document": (_change("UPDATE scenes SET document = '[1'"), "damaged_backup", "the scene .* has changed"),
    "half a file": (_cut(0.5), "damaged_backup", "its end is missing"),
    "half a file of an older version": (_half_of_an_old_file, "damaged_backup", "is not whole"),
    "a file without its last byte": (_cut_by(1), "damaged_backup", "its end is missing"),
    "a file without its digest": (_cut_by(backup._SEAL_BYTES), "damaged_backup", "its end is missing"),
    "a file with something behind it": (lambda path: path.open("a").write("xy"), "damaged_backup", "2 bytes stand behind its end"),
    "a flipped bit of the digest": (_flip(1.0), "damaged_backup", "another digest"),
    **{f"a flipped bit at {i}/16": (_flip(i / 16.01), "damaged_backup", "another digest") for i in range(16)},
    "another file": (lambda path: path.write_bytes(b"no database at all" * 100), "damaged_backup", "is not whole"),
    "no file": (lambda path: path.unlink(), "not_a_backup", "no such file"),
    "a directory": (_replace_by(os.mkdir), "not_a_backup", "is a directory"),
    "a pipe": (_replace_by(os.mkfifo), "not_a_backup", "is no regular file"),
    "an empty file": (lambda path: path.write_bytes(b""), "not_a_backup", "has no tables"),
    "a later version": (_change("UPDATE alembic_version SET version_num = '9999'"), "database_version", "9999"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_file_that_is_not_whole_is_refused_and_leaves_the_database_empty(
    sqlite_url: str, other_url: str, tmp_path: Path, damage: str
) -> None:
    database = Database(sqlite_url)
    with database.write() as session:
        add_region(session, a_job(session))
        proofs.put(session, [PROOF])
    database.close()
    file, (act, code, said) = tmp_path / "file", DAMAGES[damage]
    backup.backup(sqlite_url, file)
    act(file)
    with pytest.raises(CirisError, match=said) as refused:
        backup.restore(other_url, file)
    assert refused.value.code == code
    assert migrate.upgrade(other_url)[0] is None, "it is as empty as before"


def test_what_fails_half_way_leaves_an_empty_database(filled: str, postgres: Postgres, tmp_path: Path) -> None:
    """A text that PostgreSQL cannot hold is among the last rows."""
    file, url = tmp_path / "file", postgres.new_database()
    backup.backup(filled, file)
    _change("UPDATE jobs SET reason = 'zero ' || char(0) || ' byte'")(file)
    with pytest.raises(Exception, match="NUL"):
        backup.restore(url, file)
    assert migrate.upgrade(url)[0] is None
    migrate.downgrade(url, "base")
    _change("UPDATE jobs SET reason = NULL")(file)
    assert backup.restore(url, file) == NEWEST


def test_a_backup_that_fails_leaves_no_file(filled: str, tmp_path: Path) -> None:
    database = Database(filled)
    with database.write() as session:
        session.execute(text("UPDATE proofs SET data = :data WHERE digest = :digest"), {"data": b"x", "digest": proofs.digest(PROOF)})
    database.close()
    with pytest.raises(CirisError, match="has changed"):
        backup.backup(filled, tmp_path / "file")
    with pytest.raises(CirisError, match="cannot be written") as refused:
        backup.backup(filled, tmp_path / "nowhere" / "file")
    assert refused.value.code == "unwritable"
    assert not [path for path in tmp_path.iterdir() if path.name.startswith("file")]


def test_a_database_without_tables_has_no_backup(empty_database_url: str, tmp_path: Path) -> None:
    with pytest.raises(CirisError, match="has no tables"):
        backup.backup(empty_database_url, tmp_path / "file")
    assert not (tmp_path / "file").exists()
