"""What one project does costs the requests of the others nothing."""

from __future__ import annotations

import http.client
import json
import os
import secrets
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import insert

from certifier.errors import CirisError
from ciris.synchronous.client import Client
from db import keys, migrate, projects
from db.keys import Scope
from db.models import ApiKeyRow
from db.session import Database
from db.types import utcnow
from tests.services import Postgres

ROOT = Path(__file__).parents[2]
KEYS = 200_000
REQUESTS = 500


@contextmanager
def a_service(data: Path, url: str) -> Iterator[str]:
    """The URL of a whole stack on the database."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("CIRIS_")}
    environment = {**clean, "PYTHONPATH": str(ROOT), "CIRIS_DATABASE_URL": url, "CIRIS_SOLVE_PROCESSES": "1", "CIRIS_API_PROCESSES": "1"}
    command = [sys.executable, "-m", "workers.stack", "--data", str(data), "--port", "0"]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as stack:
        try:
            assert stack.stdout is not None
            assert "ciris is up" in stack.stdout.readline()
            yield json.loads((data / "stack.json").read_text())["url"]
        finally:
            stack.send_signal(signal.SIGINT)


def latencies(url: str, key: str) -> dict[str, float]:
    """Quantiles of the milliseconds that a request takes, of REQUESTS over some 15 s."""
    connection = http.client.HTTPConnection(url.removeprefix("http://"), timeout=60)
    seconds = []
    for _ in range(REQUESTS):
        began = time.perf_counter()
        connection.request("GET", "/v1/project", headers={"Authorization": f"Bearer {key}"})
        answer = connection.getresponse()
        answer.read()
        assert answer.status == 200
        seconds.append(time.perf_counter() - began)
        time.sleep(0.02)
    connection.close()
    seconds.sort()
    return {f"p{100 * part:g}": 1e3 * seconds[int(part * (REQUESTS - 1))] for part in (0.5, 0.9, 0.99, 1.0)}


@pytest.mark.slow
@pytest.mark.parametrize("database", ["sqlite", "postgresql"])
def test_keys_of_another_project_cost_nothing(database: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    url = f"sqlite:///{tmp_path / 'ciris.sqlite3'}"
    if database == "postgresql":
        postgres: Postgres = request.getfixturevalue("postgres")
        url = postgres.new_database()
    migrate.upgrade(url)
    db = Database(url)
    with db.write() as session:
        projects.add(session, "flood")
        key, flooding = keys.add(session, "quiet", Scope.READ), keys.add(session, "flooding", Scope.ADMIN, "flood")
    with a_service(tmp_path / "data", url) as service:
        latencies(service, key)  # the first requests load what the others find loaded
        before = latencies(service, key)
        many = [
            {"id": secrets.token_hex(6), "project": "flood", "name": f"k{i}", "digest": "", "scope": "read", "created_at": utcnow()}
            for i in range(KEYS)
        ]
        with db.write() as session:
            session.execute(insert(ApiKeyRow), many)
        after = latencies(service, key)
        with Client(service, flooding) as client, pytest.raises(CirisError, match="the most that it may have"):
            client.add_key("more", "read")
    db.close()
    print(f"{database}, milliseconds without and with {KEYS} keys: {before} {after}")
    assert after["p50"] < 2 * before["p50"]
    assert after["p99"] < 2 * before["p99"] + 5.0
