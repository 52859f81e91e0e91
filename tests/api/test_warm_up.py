"""A process of the API has done what takes long once, before it takes requests."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import event, text
from sqlalchemy.engine.interfaces import CacheStats

from api.app import create_app
from api.reading import READERS
from api.warm_up import warm_up
from db import jobs, migrate, steps
from db.session import Database
from tests.api.conftest import BASE_URL
from tests.db.builders import a_job, a_running_job
from tests.services import Postgres, Queue, free_port


@pytest.fixture(params=["sqlite", "postgresql"])
def database(request: pytest.FixtureRequest) -> Iterator[Database]:
    if request.param == "sqlite":
        url: str = request.getfixturevalue("sqlite_url")
    else:
        postgres: Postgres = request.getfixturevalue("postgres")
        migrate.upgrade(url := postgres.new_database())
    database = Database(url)
    yield database
    database.close()


def test_requests_build_no_query_and_open_no_connection(database: Database, queue: Queue, environment: pytest.MonkeyPatch) -> None:
    with database.write() as session:
        job, seeding = a_running_job(session), a_job(session)
        jobs.start(session, seeding)
        steps.add(session, seeding, "propose", {})
    environment.setenv("CIRIS_REDIS_URL", queue.url)
    built = []

    def note(_connection: Any, _cursor: Any, statement: str, _parameters: Any, context: Any, _many: bool) -> None:
        if context.cache_hit not in (CacheStats.CACHE_HIT, CacheStats.NO_DIALECT_SUPPORT) and context.compiled is not None:
            built.append(statement)

    with TestClient(create_app(database), base_url=BASE_URL) as client:
        opened = database.connections()
        assert sum(number for (_, use), number in opened.items() if use == "idle") >= READERS
        event.listen(database.reader, "before_cursor_execute", note)
        for path in (job.id, seeding.id, f"{job.id}/events", f"{job.id}/pairs?limit=100"):
            assert client.get(f"/v1/jobs/{path}").is_success
        assert client.get("/v1/jobs?limit=20").is_success
        assert client.get(f"/v1/regions?scene={job.scene_id}&limit=20").is_success
    assert built == []
    assert database.connections() == opened


def test_a_database_that_cannot_be_reached_stops_nothing(caplog: pytest.LogCaptureFixture) -> None:
    away = Database(f"postgresql+psycopg://ciris@127.0.0.1:{free_port()}/ciris")
    with caplog.at_level(logging.WARNING):
        warm_up(away)
    assert "the first requests will take longer" in caplog.text


def test_a_database_that_hangs_does_not_keep_the_process_from_taking_requests(
    postgres: Postgres, queue: Queue, environment: pytest.MonkeyPatch
) -> None:
    migrate.upgrade(url := postgres.new_database())
    environment.setenv("CIRIS_REDIS_URL", queue.url)
    environment.setattr("api.warm_up.SECONDS", 0.5)
    database, other = Database(url), Database(url)
    with other.write() as session:
        session.execute(text("LOCK TABLE jobs"))
        with TestClient(create_app(database), base_url=BASE_URL) as client:
            assert client.get("/healthz").status_code == 200
            session.rollback()
    database.close()
    other.close()
