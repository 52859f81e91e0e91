"""``ciris db`` as operators run it."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import create_engine
from sqlalchemy.exc import OperationalError

from db import command_line, keys, version
from db.keys import Scope
from db.session import Database
from tests.client.conftest import command, surroundings

NEWEST = version.revisions()[-1]


def db(data: Path, *words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command("db", *words, "--data", data), env=surroundings(), capture_output=True, text=True, check=False)


@pytest.mark.parametrize("verb", ["upgrade", "downgrade", "backup", "restore"])
def test_help_and_misspelt_words_change_nothing(tmp_path: Path, verb: str) -> None:
    helped = db(tmp_path / "data", verb, "--help")
    assert (helped.returncode, helped.stdout.startswith(f"usage: ciris db {verb}")) == (0, True)
    assert db(tmp_path / "data", verb, "a", "b").returncode == 2
    assert not list(tmp_path.iterdir())


def test_there_and_back_with_a_backup(tmp_path: Path) -> None:
    data, file = tmp_path / "data", tmp_path / "file"
    made = db(data, "upgrade")
    assert (made.returncode, made.stdout) == (0, f"the database is at revision {NEWEST}; before: no tables\n")
    assert db(data, "upgrade").stdout == f"the database is at revision {NEWEST} already\n"
    database = Database(f"sqlite:///{data / 'ciris.sqlite3'}")
    with database.write() as session:
        key = keys.add(session, "planner", Scope.READ)
    database.close()
    assert db(data, "downgrade", "0031").stdout == f"the database is at revision 0031; before: {NEWEST}\n"
    refused = subprocess.run(command("key", "ls", "--data", data), env=surroundings(), capture_output=True, text=True, check=False)
    assert refused.returncode == 2
    assert "the database is at revision 0031, and this version of ciris" in refused.stderr
    assert db(data, "backup", file).stdout == f"{file} has every row of revision 0031; CIRIS_SECRET_KEY, or secret.key, is not in it\n"
    assert "not empty" in db(data, "restore", file).stderr
    other = tmp_path / "other"
    assert db(other, "restore", file).stdout == f"restored at revision 0031; `ciris db upgrade` brings it to {NEWEST}\n"
    assert db(other, "upgrade").returncode == 0
    database = Database(f"sqlite:///{other / 'ciris.sqlite3'}")
    with database.read() as session:
        assert keys.check(session, key) is not None
    database.close()


@pytest.mark.parametrize("words", [("downgrade", "0031"), ("backup", "file")])
def test_a_misspelt_directory_is_refused(tmp_path: Path, words: tuple[str, ...]) -> None:
    done = db(tmp_path / "misspelt", *words)
    assert (done.returncode, "there is none at" in done.stderr) == (2, True)
    assert not list(tmp_path.iterdir())


def test_a_server_that_cannot_be_reached_is_named_without_its_password(tmp_path: Path) -> None:
    environment = surroundings() | {"CIRIS_DATABASE_URL": "postgresql+psycopg://ciris:hidden@127.0.0.1:1/ciris"}
    done = subprocess.run(command("db", "upgrade"), env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("error: CIRIS_DATABASE_URL: the database cannot be used: OperationalError (does its server run")
    assert "hidden" not in done.stderr


def test_a_full_disk_is_said_to_be_full(capsys: pytest.CaptureFixture[str]) -> None:
    def fill(_url: str) -> list[str]:
        with create_engine("sqlite://").begin() as connection:
            connection.exec_driver_sql("PRAGMA max_page_count = 2")
            connection.exec_driver_sql("CREATE TABLE full AS SELECT zeroblob(100000)")
        return []

    with pytest.raises(SystemExit) as ended:
        command_line.on_url(None, fill)
    assert ended.value.code == 2
    assert capsys.readouterr().err == "error: database: the disk is full, or cannot be written (free some room; nothing was changed)\n"
    full, away = (command_line._unavailable(error) for error in (_error(fill), OperationalError("", None, ConnectionError())))
    assert (full.code, away.code) == ("no_room", "no_database")


def _error(act: Callable[[str], object]) -> OperationalError:
    with pytest.raises(OperationalError) as raised:
        act("")
    return raised.value
