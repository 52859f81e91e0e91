"""No program of the service works with a database of another version, an older or a newer one."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence

import pytest
from sqlalchemy import text

from db import version
from db.session import Database
from tests.services import Queue
from tests.workers.service import ROOT

PROGRAMS = {
    "api": ["api"],
    "control worker": ["workers", "control"],
    "solve worker": ["workers", "solve"],
    "ciris key": ["client.cli", "key", "add", "somebody", "--scope", "read"],
    "ciris project": ["client.cli", "project", "add", "somewhere"],
}
STACK = {"ciris up": ["workers.stack", "--data", "data", "--port", "0"]}
"""It brings an older database up to date, so only a newer one stops it."""
OLDER, NEWER = version.revisions()[-2], "9999"
SECONDS = 120.0


def contents(database: Database) -> dict[str, Sequence[object]]:
    with database.reader.connect() as connection:
        tables = ("alembic_version", "api_keys", "projects", "workers")
        return {table: connection.execute(text(f"SELECT * FROM {table}")).all() for table in tables}


@pytest.mark.parametrize(("revision", "programs"), [(OLDER, PROGRAMS), (NEWER, PROGRAMS | STACK)])
def test_no_program_starts_on_a_database_of_another_version(
    db: Database, database_url: str, queue: Queue, tmp_path_factory: pytest.TempPathFactory, revision: str, programs: dict[str, list[str]]
) -> None:
    with db.writer.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = :revision"), {"revision": revision})
    before = contents(db)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("CIRIS_")}
    environment |= {"PYTHONPATH": str(ROOT), "CIRIS_DATABASE_URL": database_url, "CIRIS_REDIS_URL": queue.url, "CIRIS_PORT": "0"}
    begun = {
        name: subprocess.Popen(
            [sys.executable, "-m", *words], env=environment, cwd=tmp_path_factory.mktemp("at"), stderr=subprocess.PIPE, text=True
        )
        for name, words in programs.items()
    }
    try:
        said = {name: process.communicate(timeout=SECONDS)[1] for name, process in begun.items()}
    finally:
        for process in begun.values():
            process.kill()
    for name, process in begun.items():
        assert process.returncode == 2, (name, said[name])
        assert f"the database is at revision {revision}" in said[name], (name, said[name])
        assert "Traceback" not in said[name], (name, said[name])
    assert contents(db) == before, "they have left it as it was"
