"""Health checks and metrics answer within a second, whatever hangs, and say what it is."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api import probes
from api.access import KEYS_SECONDS
from api.app import create_app
from api.probes import BELIEVED_SECONDS, SILENT, WAIT_SECONDS
from certifier.model import Scene
from db import disk, keys
from db.keys import Scope
from db.session import Database
from tests.api.conftest import BASE_URL
from tests.api.test_access import bearer
from tests.api.test_jobs import GROW
from tests.api.test_metrics import samples
from tests.services import Postgres, Queue, queue_server
from tests.workers.service import eventually

SOON = 5.0
"""Within a second on a machine that is idle; what hangs takes far longer than this to be given up."""


@pytest.fixture
def own_queue(environment: pytest.MonkeyPatch) -> Iterator[Queue]:
    with queue_server() as queue:
        environment.setenv("CIRIS_REDIS_URL", queue.url)
        yield queue


@pytest.fixture
def on_postgresql(postgres: Postgres, migrated_postgres: str, own_queue: Queue) -> Iterator[tuple[Database, TestClient]]:
    database = Database(postgres.new_database(migrated_postgres))
    with TestClient(create_app(database), base_url=BASE_URL) as client:
        yield database, client
    database.close()


def soon(client: TestClient, path: str, **options: Any) -> Any:
    began = time.monotonic()
    answer = client.get(path, **options)
    assert time.monotonic() - began < SOON, path
    return answer


def test_a_queue_that_hangs_takes_neither_readiness_nor_metrics(own_queue: Queue, database: Database, scene: Scene) -> None:
    with TestClient(create_app(database), base_url=BASE_URL) as client:
        eventually(lambda: samples(client.get("/metrics").text)['ciris_check{check="queue"}'] == 1, "the first connection is made", 30)
        with own_queue.hangs():
            time.sleep(BELIEVED_SECONDS)
            for _ in range(3):
                ready = soon(client, "/readyz")
                assert (ready.status_code, ready.json()["ready"]) == (200, True)
                assert ready.json()["checks"] == {"database": "ok", "queue": SILENT, "disk": "ok"}
                found = samples(soon(client, "/metrics").text)
                assert found['ciris_check{check="queue"}'] == 0
                assert found["ciris_regions"] == 0
                assert not any(name.startswith("ciris_queue_messages") for name in found)
            eventually(lambda: sum(thread.name == "probe" for thread in threading.enumerate()) == 1, "only the one that hangs is left", 10)
            assert client.post("/v1/jobs", json=GROW).status_code == 201


def test_a_database_that_hangs_leaves_the_metrics_of_the_process(
    postgres: Postgres, on_postgresql: tuple[Database, TestClient], monkeypatch: pytest.MonkeyPatch
) -> None:
    database, client = on_postgresql
    with database.write() as session:
        key = keys.add(session, "monitoring", Scope.READ)
    time.sleep(KEYS_SECONDS)
    eventually(lambda: samples(client.get("/metrics", headers=bearer(key)).text).get("ciris_regions") == 0, "the database is counted", 30)
    with postgres.hangs():
        time.sleep(KEYS_SECONDS)  # what was read of the keys is not believed any more
        ready = soon(client, "/readyz")
        assert (ready.status_code, ready.json()["ready"]) == (503, False)
        assert ready.json()["checks"] == {"database": SILENT, "queue": "ok"}
        assert soon(client, "/healthz").status_code == 200
        answer = soon(client, "/metrics", headers=bearer(key))
        assert answer.status_code == 200, answer.text
        found = samples(answer.text)
        assert found['ciris_check{check="database"}'] == 0
        assert found["ciris_regions"] == 0
        assert found["ciris_statistics_age_seconds"] > KEYS_SECONDS
        assert soon(client, "/metrics", headers=bearer("ciris_0_0")).status_code == 401
        monkeypatch.setattr(probes, "KEPT_SECONDS", 0.5)
        found = samples(soon(client, "/metrics", headers=bearer(key)).text)
        assert "ciris_regions" not in found
        assert found['ciris_http_requests_total{method="GET",status="200"}'] >= 3


def test_nobody_is_let_in_before_the_keys_were_read_once(postgres: Postgres, on_postgresql: tuple[Database, TestClient]) -> None:
    with postgres.hangs():
        answer = soon(on_postgresql[1], "/metrics")
    assert (answer.status_code, answer.json()["code"]) == (503, "database_unavailable")


def test_a_disk_that_hangs_is_named(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """No disk of a test can hang, so looking at it does."""
    monkeypatch.setattr(probes, "WAIT_SECONDS", WAIT_SECONDS)
    comes_back = threading.Event()

    def look(_directory: Path) -> str:
        comes_back.wait()
        return ""

    monkeypatch.setattr(disk, "_look", look)
    try:
        ready = soon(client, "/readyz")
        assert (ready.status_code, ready.json()["checks"]["disk"]) == (503, SILENT)
        assert samples(soon(client, "/metrics").text)['ciris_check{check="disk"}'] == 0
    finally:
        comes_back.set()
