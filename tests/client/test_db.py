"""``ciris db`` as operators run it."""

from __future__ import annotations

import re
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import create_engine
from sqlalchemy.exc import OperationalError

from certifier.errors import CirisError
from db import command_line, commands, keys, projects, unusable, version
from db.keys import Scope
from db.session import Database
from db.settings import chosen as settings_of_the_environment
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


def test_words_that_name_no_new_file_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, said in (
        (["--data", str(tmp_path), "backup", ""], "error: argument file: an empty text names nothing (see ciris db backup --help)\n"),
        (["--data", str(tmp_path), "restore", ""], "error: argument file: an empty text names nothing (see ciris db restore --help)\n"),
        (["--data", "", "upgrade"], "error: argument --data: an empty text names nothing (see ciris db --help)\n"),
    ):
        with pytest.raises(SystemExit) as ended:
            commands.main(words)
        assert (ended.value.code, capsys.readouterr().err) == (2, said)


@pytest.mark.parametrize("words", [("downgrade", "0031"), ("backup", "file")])
def test_a_misspelt_directory_is_refused(tmp_path: Path, words: tuple[str, ...]) -> None:
    done = db(tmp_path / "misspelt", *words)
    assert (done.returncode, "there is none at" in done.stderr) == (2, True)
    assert not list(tmp_path.iterdir())


def test_a_server_that_cannot_be_reached_is_named_without_its_password(tmp_path: Path) -> None:
    environment = surroundings() | {"CIRIS_DATABASE_URL": "postgresql+psycopg://ciris:hidden@127.0.0.1:1/ciris"}
    done = subprocess.run(command("db", "upgrade"), env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("error: CIRIS_DATABASE_URL: the database ciris on 127.0.0.1:1 cannot be used: OperationalError (does its")
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
    full, away = (unusable.refusal(error, "sqlite://") for error in (_error(fill), OperationalError("", None, ConnectionError())))
    assert (full.code, away.code) == ("no_room", "no_database")


def _error(act: Callable[[str], object]) -> OperationalError:
    with pytest.raises(OperationalError) as raised:
        act("")
    return raised.value


def _garbage(data: Path) -> None:
    data.mkdir()
    (data / "ciris.sqlite3").write_bytes(b"no database at all" * 100)


def _of_another_program(data: Path) -> None:
    data.mkdir()
    with closing(sqlite3.connect(data / "ciris.sqlite3")) as file:
        file.execute("CREATE TABLE api_keys (x)")


PLACES: dict[str, tuple[Callable[[Path], object], str]] = {
    "a plain file": (lambda data: data.write_text(""), r"--data: .* cannot be made: file exists"),
    "garbage": (_garbage, r"--data: .*/ciris.sqlite3 is no database of SQLite, or a broken one"),
    "another program's": (_of_another_program, "--data: the database has tables of another program: api_keys"),
}


@pytest.mark.parametrize("place", PLACES)
def test_a_directory_without_a_database_of_ciris_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], place: str
) -> None:
    monkeypatch.delenv("CIRIS_DATABASE_URL", raising=False)
    data, (make, said) = tmp_path / "data", PLACES[place]
    make(data)
    done = db(data, "upgrade")
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(rf"error: {said} \(.+\)\n", done.stderr)
    for main, words in ((commands.main, ["backup", str(tmp_path / "file")]), (keys.main, ["ls"]), (projects.main, ["ls"])):
        with pytest.raises(SystemExit) as ended:
            main(["--data", str(data), *words])
        said = capsys.readouterr()
        assert (ended.value.code, said.out, said.err.count("\n"), said.err[:7]) == (2, "", 1, "error: ")
    assert not (tmp_path / "file").exists()


def test_a_directory_that_cannot_be_made_is_refused_in_one_line() -> None:
    done = db(Path("/proc/x"), "upgrade")
    assert done.returncode == 2
    assert done.stderr.startswith("error: --data: /proc/x cannot be made: ")
    assert done.stderr.count("\n") == 1


def test_a_name_that_is_no_text_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--data", "a\udcff", "upgrade"], ["--data", str(tmp_path), "backup", "a\udcff"]):
        with pytest.raises(SystemExit) as ended:
            commands.main(words)
        said = capsys.readouterr().err
        assert (ended.value.code, said.count("\n"), "is no UTF-8" in said) == (2, 1, True)


BAD_URLS = {
    "nonsense": "it is no URL of a database",
    "mysql://ciris:hidden@127.0.0.1/ciris": "the service knows no database 'mysql'",
    "oracle9://ciris:hidden@127.0.0.1/ciris": "it is no URL of a database",
    "sqlite+aiosqlite:///ciris.sqlite3": "the service knows no database 'sqlite+aiosqlite'",
    "sqlite://": "it names no database",
    "postgresql+psycopg://ciris:hidden@127.0.0.1:here/ciris": "it is no URL of a database",
}


@pytest.mark.parametrize("url", BAD_URLS)
def test_what_names_no_database_is_refused_without_its_password(monkeypatch: pytest.MonkeyPatch, url: str) -> None:
    monkeypatch.setenv("CIRIS_DATABASE_URL", url)
    with pytest.raises(CirisError) as refused:
        settings_of_the_environment()
    assert str(refused.value).startswith(f"CIRIS_DATABASE_URL: {BAD_URLS[url]}; write postgresql+psycopg://")
    assert "hidden" not in str(refused.value)


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [("CIRIS_DATABASE_URL", "nonsense", "it is no URL of a database"), ("CIRIS_PORT", "many", "input should be a valid integer")],
)
def test_every_process_says_in_one_line_which_setting_is_wrong(variable: str, value: str, said: str) -> None:
    python = [sys.executable, "-m"]
    for words in ([*python, "api"], [*python, "workers", "solve"], command("up"), command("key", "ls")):
        done = subprocess.run(words, env=surroundings(**{variable: value}), capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith(f"error: {variable}: {said}")
        assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("module", ["api", "workers"])
def test_a_process_of_the_service_refuses_what_is_no_database(tmp_path: Path, module: str) -> None:
    _garbage(tmp_path / "data")
    words = [sys.executable, "-m", module, *(["control"] if module == "workers" else [])]
    done = subprocess.run(words, env=surroundings(CIRIS_DATA_DIR=str(tmp_path / "data")), capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert re.fullmatch(r"error: CIRIS_DATABASE_URL: .* is no database of SQLite, or a broken one \(.+\)\n", done.stderr)


def test_start_says_why_the_service_did_not_start(tmp_path: Path) -> None:
    _garbage(tmp_path / "data")
    words = [sys.executable, "-m", "client.demo", "--once"]
    done = subprocess.run(words, env=surroundings(CIRIS_DATA_DIR=str(tmp_path / "data")), capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert re.fullmatch(r"error: the service did not start: --data: .* is no database of SQLite, .*stack.log\)\n", done.stderr)


def test_one_of_two_databases_is_not_chosen_silently(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CIRIS_DATABASE_URL", f"sqlite:///{tmp_path}/one.sqlite3")
    for main, words in ((commands.main, ["upgrade"]), (keys.main, ["ls"]), (projects.main, ["ls"])):
        with pytest.raises(SystemExit):
            main(["--data", str(tmp_path), *words])
        assert capsys.readouterr().err.startswith("error: --data: does not go with CIRIS_DATABASE_URL")
    assert not list(tmp_path.iterdir())
