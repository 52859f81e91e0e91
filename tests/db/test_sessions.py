"""Sessions and grants: what is kept of them, who is let in by them, and the commands."""

from __future__ import annotations

import json
import sys
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import select, update

from certifier.errors import CirisError
from client.cli import main as ciris
from db import audit, grants, keys, migrate, projects, sessions
from db.grants import Kind, Person
from db.keys import Key, Scope
from db.models import DEFAULT_PROJECT, ApiKeyRow, SessionRow
from db.session import Database
from db.settings import Settings
from db.types import utcnow

ALICE = Person("alice-1", "alice@example.org", ("robotics", "welders"))


def a_key(db: Database, name: str = "planner") -> Key:
    with db.write() as session:
        key = keys.check(session, keys.add(session, name, Scope.READ))
    assert key is not None
    return key


def begin(db: Database, who: Key | Person) -> str:
    with db.write() as session:
        return sessions.begin(session, who)


def held(db: Database, token: str) -> sessions.SignedIn | None:
    with db.read() as session:
        return sessions.get(session, token)


def test_a_session_lasts_until_it_is_ended(db: Database) -> None:
    key = a_key(db)
    one, other = begin(db, key), begin(db, ALICE)
    found = [held(db, token) for token in (one, other, one[:-1] + "?", "x" * 43)]
    assert [known and (known.key, known.person) for known in found] == [(key, None), (None, ALICE), None, None]
    with db.write() as session:
        sessions.end(session, one)
        sessions.end(session, "x" * 43)
        sessions.end(session, "no token")
    assert [held(db, token) is None for token in (one, other)] == [True, False]


def test_a_key_or_a_person_has_a_limited_number_of_sessions(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sessions, "MOST_OF_ONE", 3)
    key = a_key(db)
    others = begin(db, a_key(db, "other")), begin(db, Person("bob", None, ()))
    tokens = {who: [begin(db, who) for _ in range(5)] for who in (key, ALICE)}
    assert [[held(db, token) is not None for token in tokens[who]] for who in (key, ALICE)] == [[False, False, True, True, True]] * 2
    assert None not in [held(db, token) for token in others]


def test_sessions_that_have_expired_are_forgotten(db: Database) -> None:
    old, new = begin(db, ALICE), begin(db, Person("bob", None, ()))
    with db.write() as session:
        session.execute(update(SessionRow).where(SessionRow.digest == sessions.id_of(old)).values(expires_at=utcnow()))
        ids = sessions.forgettable(session, utcnow() + timedelta(seconds=1))
        assert list(ids) == [sessions.id_of(old)]
        sessions.forget(session, ids)
    assert (held(db, old), held(db, new) is not None) == (None, True)


def test_sessions_go_with_their_key(db: Database) -> None:
    old, token = a_key(db, "old"), begin(db, a_key(db))
    gone = begin(db, old)
    with db.write() as session:
        keys.revoke(session, "old")
        session.execute(update(ApiKeyRow).where(ApiKeyRow.id == old.id).values(revoked_at=utcnow() - timedelta(days=1)))
    assert (held(db, gone), held(db, token) is not None) == (None, True)
    with db.write() as session:
        keys.forget(session, [old.id])
    with db.read() as session:
        assert session.scalars(select(SessionRow.digest)).all() == [sessions.id_of(token)]


def test_a_person_has_the_widest_grant_of_each_project(db: Database) -> None:
    def of(person: Person) -> dict[str, str]:
        with db.read() as session:
            return {row.project: row.scope for row in grants.of_person(session, person)}

    with db.write() as session:
        for name in ("welding", "paint"):
            projects.add(session, name)
        grants.add(session, "welding", Kind.GROUP, "robotics", Scope.READ)
        grants.add(session, "welding", Kind.GROUP, "welders", Scope.ADMIN)
        grants.add(session, "welding", Kind.PERSON, "alice@example.org", Scope.SUBMIT)
        grants.add(session, "paint", Kind.PERSON, "alice-1", Scope.READ)
        grants.add(session, "paint", Kind.PERSON, "robotics", Scope.ADMIN)
        grants.add(session, DEFAULT_PROJECT, Kind.GROUP, "alice@example.org", Scope.ADMIN)
    assert of(ALICE) == {"welding": "admin", "paint": "read"}
    assert of(Person("alice-1", None, ())) == {"paint": "read"}
    assert of(Person("alice@example.org", None, ())) == {}, "a subject is no e-mail address"
    assert of(Person("x", "alice@example.org", ())) == {"welding": "submit"}
    with db.write() as session:
        grants.add(session, "welding", Kind.GROUP, "welders", Scope.READ)
    assert of(ALICE)["welding"] == "submit"


def test_a_session_works_by_its_grant_and_chooses_by_a_new_token(db: Database) -> None:
    with db.write() as session:
        projects.add(session, "welding")
        grants.add(session, "welding", Kind.GROUP, "robotics", Scope.READ)
    token = begin(db, ALICE)
    before = held(db, token)
    assert before is not None
    assert before.project is None
    with db.write() as session:
        assert sessions.choose(session, token, DEFAULT_PROJECT) is None
        assert sessions.choose(session, "x" * 43, "welding") is None
        chosen = sessions.choose(session, token, "welding")
        assert chosen is not None
    found = held(db, chosen)
    assert found is not None
    assert (found.project, found.person, found.expires_at) == (("welding", Scope.READ), ALICE, before.expires_at)
    assert held(db, token) is None
    with db.write() as session:
        grants.add(session, "welding", Kind.GROUP, "robotics", Scope.ADMIN)
    assert (found := held(db, chosen)) is not None
    assert found.project == ("welding", Scope.ADMIN)
    with db.write() as session:
        grants.revoke(session, "welding", Kind.GROUP, "robotics")
    assert (found := held(db, chosen)) is not None
    assert (found.project, found.person) == (None, ALICE)
    with db.write() as session, pytest.raises(CirisError, match="no grant for the group 'robotics'"):
        grants.revoke(session, "welding", Kind.GROUP, "robotics")


def test_people_of_another_provider_are_not_let_in(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    with db.write() as session:
        grants.add(session, DEFAULT_PROJECT, Kind.PERSON, "alice@example.org", Scope.ADMIN)
    token = begin(db, ALICE)
    with db.write() as session:
        token = sessions.choose(session, token, DEFAULT_PROJECT) or ""
    found = held(db, token)
    assert found is not None
    assert found.person == ALICE
    monkeypatch.setattr(sessions, "settings", lambda: Settings(oidc_issuer="https://login.example.org", oidc_client_id="ciris"))
    found = held(db, token)
    assert found is not None
    assert found.person is None
    with db.write() as session:
        assert sessions.choose(session, token, DEFAULT_PROJECT) is None


def test_the_use_of_a_session_is_noted_now_and_then(db: Database) -> None:
    key = a_key(db)
    token = begin(db, key)
    now = utcnow()
    noted = {}
    for seconds in (0.0, 599.0, 601.0):
        with db.write() as session:
            sessions.note_use(session, [sessions.id_of(token) or "", key.id], now + timedelta(seconds=seconds))
        with db.read() as session:
            times = [*session.scalars(select(SessionRow.last_used_at)), *session.scalars(select(ApiKeyRow.last_used_at))]
        noted[seconds] = [(at - now).total_seconds() for at in times if at is not None]
    assert noted == {0.0: [0.0, 0.0], 599.0: [0.0, 0.0], 601.0: [601.0, 601.0]}


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> object:
    """Runs ``ciris project`` on a new database, and returns what it has printed."""
    monkeypatch.setenv("CIRIS_DATA_DIR", str(tmp_path))
    monkeypatch.delenv("CIRIS_DATABASE_URL", raising=False)
    migrate.upgrade(Settings().database)

    def execute(_program: str, words: list[str]) -> None:
        assert words[:4] == [sys.executable, "-P", "-m", "db.grants"]
        grants.main(words[4:])

    monkeypatch.setattr("os.execv", execute)

    def said(*words: str) -> str:
        ciris(["project", *words])
        return capsys.readouterr().out

    return said


def test_the_commands(run: object, capsys: pytest.CaptureFixture[str]) -> None:
    assert callable(run)
    run("grant", "default", "--person", "Alice@Example.org", "--scope", "submit")
    run("grant", "default", "--group=robotics", "--scope=read")
    run("grant", "default", "--person", "Sub-1", "--scope", "admin")
    (group, sub, person) = json.loads(run("grants", "default", "--json"))
    assert (group["group"], group["scope"]) == ("robotics", "read")
    assert ({sub["person"], person["person"]}, sub["project"]) == ({"Sub-1", "alice@example.org"}, "default")
    assert "person alice@example.org  scope submit" in run("grants")
    run("revoke-grant", "default", "--person", "alice@example.org")
    assert "alice" not in run("grants")
    database = Database(Settings().database)
    with database.read() as session:
        lines = [(row.action, row.what, row.who) for row in audit.page(session).rows]
    database.close()
    assert lines[0] == ("grant_revoked", "person alice@example.org", "command line")
    assert lines[-1] == ("grant_made", "person alice@example.org (submit)", "command line")
    for words, problem in (
        (("revoke-grant", "default", "--group", "robots"), "the project default has no grant for the group 'robots'"),
        (("grant", "nobody", "--group", "robots", "--scope", "read"), "there is no project 'nobody'"),
        (("grants", "nobody"), "there is no project 'nobody'"),
        (("grant", "default", "--group", "", "--scope", "read"), "'' names nobody"),
    ):
        with pytest.raises(SystemExit) as ended:
            run(*words)
        assert ended.value.code == 2
        assert problem in capsys.readouterr().err
