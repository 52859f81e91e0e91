"""Keys over HTTP, projects, and what is deleted, on the command line."""

from __future__ import annotations

import json
import subprocess
import time
from contextlib import closing
from datetime import timedelta
from pathlib import Path

import pytest

from api.access import KEYS_SECONDS
from db import audit, keys, migrate, projects, solver_time
from db.keys import Scope
from db.session import Database
from db.settings import Settings
from db.types import utcnow
from tests.client.conftest import Ciris, command, surroundings


def test_scenes_jobs_and_regions_are_deleted_once_it_was_said_what_goes_with_them(ciris: Ciris, url: str, region: str) -> None:
    told = ciris("scene", "rm", "slider", CIRIS_URL=url)
    assert told.status == 2
    assert "1 job, 1 region" in told.error
    assert "--dependents" in told.error
    assert ciris("region", "rm", region[:8]).status == 0
    (job,) = ciris("job", "ls", "--json").json
    assert ciris("job", "rm", job["id"][:8]).status == 0
    assert ciris("scene", "rm", "slider", "--dependents").status == 0
    assert ciris("scene", "ls", "--json").json == []


def test_an_admin_manages_the_keys_of_the_project_over_http(ciris: Ciris, url: str, database: Database) -> None:
    with database.write() as session:
        projects.add(session, "others")
        admin = keys.add(session, "boss", Scope.ADMIN, "others")
    time.sleep(KEYS_SECONDS)
    made = ciris("key", "add", "planner", "--scope", "read", "--url", url, CIRIS_API_KEY=admin)
    assert made.status == 0
    time.sleep(KEYS_SECONDS)
    key = made.stdout.strip()
    assert ciris("job", "ls", "--json", CIRIS_URL=url, CIRIS_API_KEY=key).json == []
    listed = ciris("key", "ls", "--url", url, "--json", CIRIS_API_KEY=admin)
    assert [(one["name"], one["scope"]) for one in listed.json] == [("planner", "read"), ("boss", "admin")]
    table = ciris("key", "ls", "--url", url, CIRIS_API_KEY=admin).stdout
    assert ("planner" in table, "last used" in table) == (True, True)
    assert ciris("key", "add", "visitor", "--scope", "read", "--days", "90", "--url", url, CIRIS_API_KEY=admin).status == 0
    visitor, planner, boss = ciris("key", "ls", "--url", url, "--json", CIRIS_API_KEY=admin).json
    in_90_days = (utcnow() + timedelta(days=90)).date().isoformat()
    assert (visitor["expires_at"][:10], planner["expires_at"], boss["revoked_at"]) == (in_90_days, None, None)
    assert (visitor["last_used_at"], boss["last_used_at"][:4]) == (None, str(utcnow().year))
    assert ciris("key", "add", "x", "--scope", "admin", "--url", url, CIRIS_API_KEY=key).status == 2
    assert ciris("key", "revoke", "planner", "--url", url, CIRIS_API_KEY=admin).status == 0
    time.sleep(KEYS_SECONDS)
    assert ciris("job", "ls", CIRIS_URL=url, CIRIS_API_KEY=key).status == 2


def test_whoever_runs_the_service_makes_a_team_over_http(ciris: Ciris, url: str, database: Database) -> None:
    with database.write() as session:
        admin = keys.add(session, "boss", Scope.ADMIN)
    time.sleep(KEYS_SECONDS)
    assert ciris("project", "add", "welding", "--url", url, CIRIS_API_KEY=admin).status == 0
    made = ciris("key", "add", "alice", "--scope", "admin", "--project", "welding", "--url", url)
    limited = ciris("project", "set", "welding", "--max-bytes", "50e9", "--keep-days", "30", "--url", url)
    assert (limited.status, limited.stdout) == (0, "max_bytes 50000000000  keep_days 30\n")
    listed = ciris("project", "ls", "--json", "--url", url).json
    assert [(one["name"], one["max_bytes"], one["keep_days"]) for one in listed] == [
        ("default", None, None),
        ("welding", 50_000_000_000, 30),
    ]
    assert ciris("project", "ls", "--url", url).stdout.splitlines()[2].split()[:3] == ["welding", "50000000000", "30"]
    assert ciris("project", "set", "welding", "--keep-days", "0", "--url", url).stdout == "max_bytes 50000000000\n"
    shown = ciris("project", "show", "welding", "--url", url).stdout
    assert ("project welding\n" in shown, "of 50000.0 MB" in shown, "your scope" in shown) == (True, True, False)
    for words, said in (
        (("add", "welding"), "there is a project 'welding' already"),
        (("add", "a b"), "a name has up to 64 letters"),
        (("add", ""), "a name has up to 64 letters"),
        (("set", "nobody", "--keep-days", "1"), "there is no project 'nobody'"),
        (("show", "nobody"), "there is no project 'nobody'"),
        (("set", "welding", "--max-bytes", "1e19"), "--max-bytes: input should be less than or equal to"),
        (("set", "welding", "--max-bytes", "inf"), "--max-bytes: inf is not a number from 0 on; 0 takes the limit away"),
        (("add", "mine", "--data", "here"), "--data: does not go with --url"),
    ):
        refused = ciris("project", *words, "--url", url)
        assert refused.status == 2
        assert said in refused.error
    alice = made.stdout.strip()
    assert ciris("project", "show", "--json", "--url", url, CIRIS_API_KEY=alice).json["name"] == "welding"
    for words in (("ls",), ("add", "more"), ("set", "welding", "--keep-days", "0"), ("show", "welding"), ("show", "nobody")):
        refused = ciris("project", *words, "--url", url)
        assert refused.status == 2
        assert "ask those who run the service: admins of the project default" in refused.error
    assert ciris("key", "add", "spy", "--scope", "read", "--project", "default", "--url", url).status == 2
    assert "--project: does not go with --url" in ciris("key", "revoke", "boss", "--project", "default", "--url", url).error


def test_the_command_shows_what_a_project_has_used_and_what_is_left(ciris: Ciris, url: str, database: Database) -> None:
    with database.write() as session:
        solver_time.add(session, "default", 60.0)
    shown = ciris("project", "show", CIRIS_URL=url)
    assert (shown.status, "60 s this month\n" in shown.stdout) == (0, True)
    with database.write() as session:
        projects.get(session, "default").max_solver_seconds = 200.0
    ends = solver_time.month_ends().date().isoformat()
    assert f"60 of 200 s this month; 140 s left until {ends}" in ciris("project", "show", CIRIS_URL=url).stdout
    found = ciris("project", "show", "--json", CIRIS_URL=url).json
    assert (found["solver_seconds"], found["max_solver_seconds"]) == (60.0, 200.0)


def test_projects_on_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("CIRIS_DATA_DIR", str(tmp_path))
    monkeypatch.delenv("CIRIS_DATABASE_URL", raising=False)  # other tests of this process may use another database
    migrate.upgrade(Settings().database)
    projects.main(["add", "welding"])
    projects.main(["set", "welding", "--max-bytes", "1e9", "--keep-days", "30", "--max-solver-seconds", "720e3"])
    keys.main(["add", "planner", "--scope", "read", "--project", "welding"])
    capsys.readouterr()
    projects.main(["ls", "--json"])
    listed = json.loads(capsys.readouterr().out)
    columns = ("name", "max_bytes", "keep_days", "max_solver_seconds", "solver_seconds")
    found = [tuple(row[name] for name in columns) for row in listed]
    assert found == [("default", None, None, None, 0.0), ("welding", 10**9, 30.0, 720e3, 0.0)]
    keys.main(["ls", "--json"])
    assert [(row["name"], row["project"]) for row in json.loads(capsys.readouterr().out)] == [("planner", "welding")]
    projects.main(["set", "welding", "--max-bytes", "0"])
    projects.main(["ls"])
    assert "max_bytes" not in capsys.readouterr().out
    with closing(Database(Settings().database)) as database, database.of("welding").read() as session:
        said = [row.what for row in audit.page(session).rows if row.action == "limits_set"]
    assert said == ["max_bytes 1000000000 -> none", "max_bytes none -> 1000000000, keep_days none -> 30, max_solver_seconds none -> 720000"]
    with closing(Database(Settings().database)) as database, database.of("default").read() as session:
        said = [row.what for row in audit.page(session).rows]
    assert said[:2] == ["welding: max_bytes 1000000000 -> none", "welding: planner (read)"], "those who run the service find it, too"
    for wrong in (["set", "welding", "--keep-days", "-1"], ["set", "nobody"], ["add", "welding"]):
        with pytest.raises(SystemExit) as ended:
            projects.main(wrong)
        assert ended.value.code == 2
    capsys.readouterr()
    for option, number, wrong_with_it in (
        ("--max-bytes", "none", "is not a number from 0 on"),
        ("--max-bytes", "nan", "is not a number from 0 on"),
        ("--max-bytes", "0.4", "is not a whole number"),
        ("--max-bytes", "1e19", f"is more than {2**62}"),
        ("--max-bytes", "inf", f"is more than {2**62}"),
        ("--keep-days", "1000000", "is more than 36500"),
        ("--max-solver-seconds", "-1", "is not a number from 0 on"),
    ):
        with pytest.raises(SystemExit):
            projects.main(["set", "welding", option, number])
        said = f"error: argument {option}: {number} {wrong_with_it}; 0 takes the limit away (see ciris project set --help)\n"
        assert capsys.readouterr().err == said
    projects.main(["ls"])
    assert "keep_days 30.0" in capsys.readouterr().out, "nothing was changed"
    with pytest.raises(SystemExit):
        keys.main(["revoke", "planner"])  # that of the default project


@pytest.mark.parametrize("words", [("key", "ls"), ("key", "add", "planner", "--scope", "read"), ("project", "ls"), ("project", "add", "a")])
def test_no_command_but_up_makes_a_database(tmp_path: Path, words: tuple[str, ...]) -> None:
    data = tmp_path / "misspelt"
    done = subprocess.run(command(*words, "--data", data), env=surroundings(), capture_output=True, text=True, check=False)
    where = data / "ciris.sqlite3"
    hint = "is it spelt so? `ciris up` and `ciris db upgrade` make one"
    assert (done.returncode, done.stderr) == (2, f"error: database: there is none at {where} ({hint})\n")
    assert not data.exists()


@pytest.mark.slow
def test_the_command_passes_limits_on(tmp_path: Path) -> None:
    migrate.upgrade(Settings(data_dir=tmp_path, database_url="").database)
    for words in (("add", "welding"), ("set", "welding", "--keep-days", "7")):
        subprocess.run(command("project", *words, "--data", tmp_path), env=surroundings(), check=True)
    listed = subprocess.run(command("project", "ls", "--json", "--data", tmp_path), env=surroundings(), check=True, capture_output=True)
    assert [row["keep_days"] for row in json.loads(listed.stdout)] == [None, 7.0]


def test_keys_are_those_of_a_database_that_is_named(tmp_path: Path) -> None:
    """CIRIS_URL alone names a service, not a database; an empty list says of which database it is."""

    def key(*words: str, **variables: str) -> subprocess.CompletedProcess[str]:
        environment = surroundings(XDG_DATA_HOME=str(tmp_path), **variables)
        return subprocess.run(command("key", *words), env=environment, capture_output=True, text=True, check=False)

    data = tmp_path / "ciris"
    migrate.upgrade(f"sqlite:///{data / 'ciris.sqlite3'}")
    for words in (("ls",), ("revoke", "planner"), ("add", "planner", "--scope", "read")):
        done = key(*words, CIRIS_URL="https://ciris.example.org")
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith("error: CIRIS_URL: this command does not take its service from it (add --url URL")
    for words in (("ls",), ("add", "welding"), ("set", "welding", "--keep-days", "1")):
        done = subprocess.run(
            command("project", *words),
            env=surroundings(XDG_DATA_HOME=str(tmp_path), CIRIS_URL="https://ciris.example.org"),
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith("error: CIRIS_URL: this command does not take its service from it (add --url URL")
    listed = key("ls")
    assert (listed.returncode, listed.stdout, listed.stderr) == (0, "", f"database: {data / 'ciris.sqlite3'}\n")
    told = key("ls", "--data", str(data), CIRIS_URL="https://ciris.example.org")
    assert (told.returncode, told.stderr) == (0, listed.stderr)
