"""API keys: what is kept of them, who is let in, and the command."""

from __future__ import annotations

import json
from datetime import timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import select, text, update
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import jobs, keys, migrate, projects
from db.keys import Scope
from db.models import DEFAULT_PROJECT, ApiKeyRow, JobRow
from db.session import Database
from db.settings import Settings, settings
from db.types import utcnow
from tests.db.builders import a_job


def test_a_key_is_valid_until_it_is_revoked(db: Database) -> None:
    with db.write() as session:
        assert not keys.exist(session)
        key = keys.add(session, "planner", Scope.READ)
    with db.write() as session:
        row = keys.check(session, key)
        assert row is not None
        assert (row.name, row.scope) == ("planner", "read")
        keys.revoke(session, "planner")
    with db.read() as session:
        assert keys.check(session, key) is None
        assert keys.exist(session), "revoking the last key does not open the service"


def test_a_name_serves_again_once_its_key_is_revoked(db: Database) -> None:
    with db.write() as session:
        first = keys.add(session, "planner", Scope.READ)
        with pytest.raises(CirisError, match="already"):
            keys.add(session, "planner", Scope.ADMIN)
        keys.revoke(session, "planner")
        with pytest.raises(CirisError, match="there is no key"):
            keys.revoke(session, "planner")
        second = keys.add(session, "planner", Scope.SUBMIT)
    with db.read() as session:
        assert keys.check(session, first) is None
        assert keys.check(session, second) is not None


def test_the_database_does_not_hold_the_key(db: Database) -> None:
    with db.write() as session:
        key = keys.add(session, "planner", Scope.READ)
    with db.read() as session:
        (row,) = session.execute(text("SELECT * FROM api_keys")).all()
    secret = key.removeprefix(f"ciris_{row.id}_")
    assert len(secret) == 43
    assert secret not in str(row)


@given(place=st.integers(0, 60), letter=st.sampled_from("aZ0_-\n é"))
def test_no_other_key_is_valid(key_database: tuple[Database, str], place: int, letter: str) -> None:
    database, key = key_database
    other = key[: place % len(key)] + letter + key[place % len(key) + 1 :]
    with database.read() as session:
        assert (keys.check(session, other) is not None) == (other == key)
        assert keys.check(session, key + letter) is None


@pytest.fixture(scope="module")
def key_database(tmp_path_factory: pytest.TempPathFactory, migrated_sqlite: Path) -> tuple[Database, str]:
    path = tmp_path_factory.mktemp("keys") / "keys.sqlite3"
    path.write_bytes(migrated_sqlite.read_bytes())
    database = Database(f"sqlite:///{path}")
    with database.write() as session:
        return database, keys.add(session, "planner", Scope.READ)


def test_a_project_has_a_limited_number_of_keys(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings(), "max_keys_per_project", 2)
    with db.write() as session:
        projects.add(session, "others")
        for name in ("a", "b"):
            keys.add(session, name, Scope.READ)
        with pytest.raises(CirisError, match="CIRIS_MAX_KEYS_PER_PROJECT") as refused:
            keys.add(session, "c", Scope.READ)
        assert refused.value.code == "too_many_keys"
        keys.add(session, "a", Scope.READ, "others")
        keys.revoke(session, "a")
        with pytest.raises(CirisError, match="a revoked key counts for a day more"):
            keys.add(session, "c", Scope.READ)
        revoked_ago(session, "a", keys.COUNTED_DAYS)
        keys.add(session, "c", Scope.READ)


def revoked_ago(session: Session, name: str, days: float) -> None:
    mine = (ApiKeyRow.name == name, ApiKeyRow.project == DEFAULT_PROJECT)
    session.execute(update(ApiKeyRow).where(*mine).values(revoked_at=utcnow() - timedelta(days=days)))


def forget(db: Database) -> set[str]:
    """The names of the keys that are left when the service has forgotten what it may."""
    while True:
        with db.write() as session:
            ids = keys.forgettable(session, utcnow())
            if not ids:
                return set(session.scalars(select(ApiKeyRow.name)))
            keys.forget(session, ids)


def test_a_revoked_key_is_forgotten_after_a_time(db: Database) -> None:
    with db.write() as session:
        for name in ("used", "old", "lately"):
            keys.add(session, name, Scope.READ)
        revoked_ago(session, "old", keys.KEPT_DAYS)
        revoked_ago(session, "lately", keys.KEPT_DAYS - 1)
    assert forget(db) == {"used", "lately"}


def test_the_last_key_is_never_forgotten_because_the_service_would_be_open(db: Database) -> None:
    with db.write() as session:
        for days, name in enumerate(("last", "before")):
            keys.add(session, name, Scope.READ)
            revoked_ago(session, name, 2 * keys.KEPT_DAYS + days)
    assert forget(db) == {"last"}


def test_a_key_is_forgotten_once_its_jobs_have_ended(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keys, "JOBS_TOGETHER", 2)
    with db.write() as session:
        for name in ("gone", "stays"):
            keys.add(session, name, Scope.SUBMIT)
        key_id = session.scalars(select(ApiKeyRow.id).where(ApiKeyRow.name == "gone")).one()
        ids = [a_job(session, key_id=key_id).id for _ in range(5)]
        revoked_ago(session, "gone", keys.KEPT_DAYS)
        revoked_ago(session, "stays", 0)
    assert forget(db) == {"gone", "stays"}
    with db.write() as session:
        for job_id in ids:
            jobs.cancel(session, job_id)
    assert forget(db) == {"stays"}
    with db.read() as session:
        assert {job.key_id for job in session.scalars(select(JobRow))} == {None}


def test_a_key_that_expires_is_a_revoked_key_from_then_on(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings(), "max_keys_per_project", 2)
    began = utcnow()

    def after(days: float) -> None:
        monkeypatch.setattr(keys, "utcnow", lambda: began + timedelta(days=days))

    with db.write() as session:
        key, lasting = keys.add(session, "visitor", Scope.READ, days=90), keys.add(session, "planner", Scope.READ)
        with pytest.raises(CirisError, match="there is a key 'visitor' already"):
            keys.add(session, "visitor", Scope.READ)
    for days, valid in ((89.9, True), (90.1, False)):
        after(days)
        with db.read() as session:
            found = keys.check(session, key)
            assert (found is not None, keys.check(session, lasting) is not None) == (valid, True)
            (expires_at, revoked_at), (never, not_yet) = (
                keys.ends(row) for row in sorted(keys.newest(session), key=lambda r: r.name)[::-1]
            )
        assert ((expires_at is None, revoked_at is None), (never, not_yet)) == ((not valid, valid), (None, None))
    with db.write() as session:
        with pytest.raises(CirisError, match="there is no key"):
            keys.revoke(session, "visitor")
        with pytest.raises(CirisError, match="the most that it may have"):
            keys.add(session, "visitor", Scope.READ)  # it counts for a day more
        after(91.1)
        keys.add(session, "visitor", Scope.READ)
        revoked_ago(session, "planner", -100)  # it will be
    with db.read() as session:
        assert list(keys.forgettable(session, began + timedelta(days=119))) == []
        assert list(keys.forgettable(session, began + timedelta(days=121))) == [key.split("_")[1]]


def test_the_use_of_a_key_is_noted_now_and_then(db: Database) -> None:
    with db.write() as session:
        used, unused = (keys.add(session, name, Scope.READ).split("_")[1] for name in ("used", "unused"))
    now = utcnow()
    noted = {}
    for seconds in (0.0, 599.0, 601.0):
        with db.write() as session:
            keys.note_use(session, [used], now + timedelta(seconds=seconds))
        with db.read() as session:
            at = {row.id: row.last_used_at for row in keys.newest(session)}
        noted[seconds] = None if at[used] is None else (at[used] - now).total_seconds()
        assert at[unused] is None
    assert noted == {0.0: 0.0, 599.0: 0.0, 601.0: 601.0}


@pytest.mark.parametrize("name", ["", "-x", "a b", "a" * 65, "a\n"])
def test_names_that_cannot_be_typed_are_refused(db: Database, name: str) -> None:
    with db.write() as session, pytest.raises(CirisError, match="no name for a key"):
        keys.add(session, name, Scope.READ)


def test_scopes_are_ordered() -> None:
    held = [[scope.includes(other) for other in Scope] for scope in (Scope.READ, Scope.SUBMIT, Scope.ADMIN)]
    assert held == [[True, False, False], [True, True, False], [True, True, True]]


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("CIRIS_DATA_DIR", str(tmp_path))
    monkeypatch.delenv("CIRIS_DATABASE_URL", raising=False)  # other tests of this process may use another database
    migrate.upgrade(Settings().database)
    keys.main(["add", "planner", "--scope", "submit"])
    key = capsys.readouterr().out.strip()
    keys.main(["ls", "--json"])
    (listed,) = json.loads(capsys.readouterr().out)
    assert (listed["name"], listed["scope"]) == ("planner", "submit")
    assert (listed["last_used_at"], listed["expires_at"], listed["revoked_at"]) == (None, None, None)
    assert listed["id"] == key.split("_")[1]
    keys.main(["revoke", "planner"])
    keys.main(["ls"])
    line = capsys.readouterr().out
    assert "revoked_at" in line
    assert key.split("_", 2)[2] not in line
    with pytest.raises(SystemExit) as ended:
        keys.main(["revoke", "planner"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == "error: name: there is no key 'planner' (`ciris key ls` lists them)\n"
    keys.main(["add", "visitor", "--scope", "read", "--days", "90"])
    capsys.readouterr()
    keys.main(["ls"])
    assert f"expires_at {(utcnow() + timedelta(days=90)).date()}" in capsys.readouterr().out
    for days in ("0", "-1", "nan", "3651", "some"):
        with pytest.raises(SystemExit):
            keys.main(["add", "other", "--scope", "read", "--days", days])
        assert f"{days} is not a number of days above 0, of at most 3650" in capsys.readouterr().err
