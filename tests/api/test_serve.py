"""The server process: what it refuses to bind to, and that it starts."""

import os
import subprocess
import sys
from pathlib import Path

from db import keys, migrate
from db.keys import Scope
from db.session import Database
from db.settings import Settings

ROOT = Path(__file__).parents[2]


def serve(directory: Path, module: str = "api", **variables: str) -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("CIRIS_")}
    environment = {**clean, "CIRIS_HOST": "0.0.0.0", "CIRIS_DATA_DIR": str(directory), "PYTHONPATH": str(ROOT), **variables}
    command = [sys.executable, "-m", module]
    return subprocess.run(command, env=environment, cwd=directory, capture_output=True, text=True, timeout=60, check=False)


def test_an_address_that_others_can_reach_is_refused_without_keys(tmp_path: Path) -> None:
    migrate.upgrade(Settings(data_dir=tmp_path, database_url="").database)
    done = serve(tmp_path)
    assert done.returncode == 2
    assert done.stderr == (
        "error: CIRIS_HOST: others can reach 0.0.0.0, and no API key has been made that could keep them out "
        "(`ciris key add NAME --scope admin` makes one)\n"
    )


def test_a_database_that_cannot_tell_is_no_permission(tmp_path: Path) -> None:
    done = serve(tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("error: CIRIS_DATABASE_URL: the database has no tables of ciris")


def test_the_stack_refuses_too(tmp_path: Path) -> None:
    done = serve(tmp_path, "workers.stack")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("error: CIRIS_HOST: others can reach 0.0.0.0")


def test_a_key_that_was_revoked_still_lets_the_service_bind_and_nobody_in(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path, database_url="", host="0.0.0.0")
    migrate.upgrade(settings.database)
    database = Database(settings.database)
    with database.write() as session:
        key = keys.add(session, "once", Scope.ADMIN)
    with database.write() as session:
        keys.revoke(session, "once")
        assert keys.check(session, key) is None
    keys.check_bind(settings)
    database.close()
