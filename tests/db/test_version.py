"""Nobody writes to a database of another version, and none is migrated under who writes or works."""

from __future__ import annotations

import threading

import pytest
from sqlalchemy import select, text

from certifier.errors import CirisError
from db import migrate, version, workers
from db.models import ProjectRow
from db.session import Database, check_version
from db.states import WorkerState
from db.workers import Made, WorkerKind

LINGER_SECONDS = 0.5


def put(database: Database, revision: str) -> None:
    """Makes the database say that it is at this revision."""
    with database.writer.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = :revision"), {"revision": revision})


def test_the_revisions_are_those_of_the_migrations() -> None:
    assert version.revisions()[0] == "0025"
    assert list(version.revisions()) == sorted(version.revisions())


@pytest.mark.parametrize(
    ("revision", "hint"),
    [("0001", "start version 0.1.0"), ("0025", "`ciris db upgrade`"), ("9999", "install the version that migrated it")],
)
def test_a_database_of_another_version_is_not_written(db: Database, database_url: str, revision: str, hint: str) -> None:
    put(db, revision)
    with pytest.raises(CirisError, match=revision) as refused, db.write() as session:
        session.execute(text("DELETE FROM projects"))
    assert (refused.value.code, refused.value.field) == ("database_version", "CIRIS_DATABASE_URL")
    assert hint in refused.value.hint
    with pytest.raises(CirisError, match=revision), db.read() as session:
        version.check(session)
    with pytest.raises(CirisError, match=revision):
        check_version(database_url)
    put(db, version.revisions()[-1])
    check_version(database_url)
    with db.write() as session:
        assert session.scalars(select(ProjectRow.name)).all() == ["default"]


def test_a_database_without_tables_is_refused(empty_database_url: str) -> None:
    with pytest.raises(CirisError, match="has no tables") as refused:
        check_version(empty_database_url)
    assert refused.value.code == "database_version"


def test_what_cannot_be_reached_is_not_refused_yet() -> None:
    check_version("postgresql+psycopg://nobody@127.0.0.1:1/nothing")


def test_a_migration_waits_for_who_writes_and_who_writes_later_is_refused(db: Database, database_url: str) -> None:
    held, over, told = threading.Event(), threading.Event(), []

    def write() -> None:
        with db.write() as session:
            session.add(ProjectRow(name="first"))
            session.flush()
            held.set()
            over.wait()

    def migrated() -> None:
        told.append(migrate.downgrade(database_url, version.revisions()[-2]))

    first, down = threading.Thread(target=write), threading.Thread(target=migrated)
    first.start()
    assert held.wait(30)
    down.start()
    down.join(LINGER_SECONDS)
    assert down.is_alive(), "it waits"
    over.set()
    first.join(30)
    down.join(30)
    assert told == [version.revisions()[-1]]
    with pytest.raises(CirisError, match=version.revisions()[-2]), db.write() as session:
        session.add(ProjectRow(name="second"))
    with db.read() as session:
        assert set(session.scalars(select(ProjectRow.name))) == {"default", "first"}


@pytest.mark.parametrize("revision", version.revisions()[:-1])
def test_nothing_is_migrated_while_workers_live(empty_database_url: str, revision: str) -> None:
    """Whatever the revision is: their table has not changed."""
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    made = Made("elsewhere:7:8", WorkerKind.SOLVE, "0.0.9", 1, 1, 2**30)
    with database.write() as session:
        workers.tell(session, made, WorkerState.RUNNING)
    for act in (lambda: migrate.downgrade(empty_database_url, revision), lambda: migrate.downgrade(empty_database_url, "base")):
        with pytest.raises(CirisError, match=r"elsewhere:7:8 \(version 0.0.9\)") as refused:
            act()
        assert refused.value.code == "workers_live"
    with database.write() as session:
        workers.leave(session, made.process)
    assert migrate.downgrade(empty_database_url, revision) == version.revisions()[-1]
    with database.writer.begin() as connection:
        connection.execute(
            text(
                "INSERT INTO workers (id, process, kind, version, processes, cores, memory_bytes, wanted, state, created_at, seen_at)"
                " VALUES ('w', 'elsewhere:7:8', 'solve', '0.0.9', 1, 1, 1, 'running', 'running', '2999-01-01',"
                " '2999-01-01 00:00:00.000000')"
            )
        )
    with pytest.raises(CirisError, match="these workers live"):
        migrate.upgrade(empty_database_url)
    with database.writer.begin() as connection:
        connection.execute(text("UPDATE workers SET seen_at = '2020-01-01 00:00:00.000000'"))
    database.close()
    assert migrate.upgrade(empty_database_url) == (revision, version.revisions()[-1])


@pytest.mark.parametrize("revision", ["0031x", "9999", "head"])
def test_no_way_leads_to_an_unknown_revision(empty_database_url: str, revision: str) -> None:
    migrate.upgrade(empty_database_url)
    with pytest.raises(CirisError, match="no way leads") as refused:
        migrate.downgrade(empty_database_url, revision)
    assert version.revisions()[0] in refused.value.hint
    with pytest.raises(CirisError, match="no way leads"):
        migrate.upgrade(empty_database_url, revision)
    assert migrate.drift(empty_database_url) == []


def test_an_older_revision_is_no_upgrade(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    with pytest.raises(CirisError, match="no way leads"):
        migrate.upgrade(empty_database_url, version.revisions()[0])
