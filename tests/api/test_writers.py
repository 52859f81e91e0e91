"""Who writes may wait long for SQLite's lock. Who reads, shows a key or looks at a page does not wait for that."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import httpx2
import pytest

from api import writing
from certifier.model import Scene
from db import keys
from db.keys import Scope
from db.session import Database

READS = ("/v1/jobs", "/v1/scenes", "/", "/readyz", "/scenes/slider", "/v1/planning/graph?scene=slider")
WAITING = 30


async def _while_writers_wait(database: Database, url: str, region: str, key: str) -> tuple[list[float], list[int], list[int]]:
    """Returns the seconds and statuses of reading while this many requests to write wait, and the statuses of these."""
    headers = {"Authorization": f"Bearer {key}"}
    request = {"kind": "certify", "scene": "slider", "polytope": {"C": [[1.0]], "d": [0.1]}}
    async with httpx2.AsyncClient(base_url=url, headers=headers, timeout=30.0) as client:
        assert (await client.get(READS[0])).status_code == 200
        held = database.writer.connect()
        held.begin()
        try:
            posts = [asyncio.create_task(client.post("/v1/jobs", json=request, timeout=120.0)) for _ in range(WAITING)]
            await asyncio.sleep(1.5)  # the keys that were read are too old by now
            seconds, statuses = [], []
            for path in READS * 3:
                began = time.monotonic()
                statuses.append((await client.get(path, headers={"Accept": "*/*"})).status_code)
                seconds.append(time.monotonic() - began)
        finally:
            held.rollback()
            held.close()
        return seconds, statuses, [(await post).status_code for post in posts]


def test_readers_never_wait_for_writers(database: Database, url: str, scene: Scene, region: str, sqlite_url: str) -> None:
    with database.write() as session:
        key = keys.add(session, "reader", Scope.ADMIN)
    other = Database(sqlite_url)  # of another process: the service's own writers share a connection
    try:
        seconds, statuses, written = asyncio.run(_while_writers_wait(other, url, region, key))
    finally:
        other.close()
    assert statuses == [200] * len(statuses)
    assert max(seconds) < 5.0, "a writer waits for half a minute"
    assert written == [201] * WAITING


@pytest.mark.parametrize("limit", ["WAITING", "OF_PROJECT_WAITING"])
def test_too_many_writers_are_told_to_come_again(
    database: Database, url: str, scene: Scene, sqlite_url: str, monkeypatch: Any, limit: str
) -> None:
    monkeypatch.setattr(writing, limit, 1)
    other = Database(sqlite_url)
    held = other.writer.connect()
    held.begin()

    async def post() -> list[httpx2.Response]:
        async with httpx2.AsyncClient(base_url=url, timeout=30.0) as client:
            request = {"kind": "certify", "scene": "slider", "polytope": {"C": [[1.0]], "d": [0.1]}}
            posts = [asyncio.create_task(client.post("/v1/jobs", json=request)) for _ in range(6)]
            done, _ = await asyncio.wait(posts, timeout=20, return_when=asyncio.FIRST_COMPLETED)
            assert all(task.result().status_code == 503 for task in done)
            await asyncio.sleep(0.5)
            held.rollback()
            return [await task for task in posts]

    answers = asyncio.run(post())
    held.close()
    other.close()
    refused = [answer.json()["code"] for answer in answers if answer.status_code == 503]
    assert refused == ["busy"] * len(refused)
    assert len(refused) == 6 - writing.WRITERS - 1
    assert sum(answer.status_code == 201 for answer in answers) == writing.WRITERS + 1


pytestmark = pytest.mark.usefixtures("client")
