"""Uploads and other requests that a child process answers have few places, and no project can hold all of them."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import anyio
import pytest
from fastapi.testclient import TestClient

from api.access import KEYS_SECONDS
from api.children import OF_PROJECT, OF_PROJECT_WAITING, ChildLimiter
from certifier.errors import CirisError
from certifier.scene.bundle import BundleLimits
from db import keys, projects
from db.keys import Scope
from db.session import Database
from tests.api.test_hostile_uploads import URDF, zipped

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + "f 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n" * 60_000
"""A file of 2 MB whose zip has some 15 kB, and which takes seconds to read."""
LINK = "<link name='a'><collision><geometry><mesh filename='m.obj'/></geometry></collision></link>"


def test_an_upload_is_answered_while_another_project_holds_the_places_that_it_may(client: TestClient, database: Database) -> None:
    with database.write() as session:
        projects.add(session, "others")
        own, theirs = (keys.add(session, "key", Scope.SUBMIT, name) for name in ("default", "others"))
    time.sleep(KEYS_SECONDS)
    attacks = [zipped(**{"arm.urdf": URDF.format(LINK), "m.obj": f"# {k}\n{MESH}"}) for k in range(OF_PROJECT + 1)]
    assert all(len(attack) < 25_000 for attack in attacks)

    def upload(data: bytes, key: str) -> int:
        headers = {"Authorization": f"Bearer {key}"}
        return client.post("/v1/scenes", files={"bundle": ("scene.zip", data, "application/zip")}, headers=headers).status_code

    with ThreadPoolExecutor(OF_PROJECT + 1) as pool:
        held = [pool.submit(upload, attack, theirs) for attack in attacks]
        time.sleep(1)
        assert upload(zipped(), own) == 201
        assert not all(one.done() for one in held), "the places were free"
        assert {one.result() for one in held} <= {201, 422}


def test_a_project_holds_fewer_places_than_there_are_and_may_not_wait_without_limit() -> None:
    go, started = Event(), list[str]()

    def hold() -> None:
        started.append("greedy")
        go.wait(60)

    async def ask() -> None:
        limiter = ChildLimiter()
        async with anyio.create_task_group() as group:
            for _ in range(OF_PROJECT + OF_PROJECT_WAITING):
                group.start_soon(limiter.run, "greedy", hold)
            while len(started) < OF_PROJECT:
                await anyio.sleep(0.01)
            with pytest.raises(CirisError) as busy:
                await limiter.run("greedy", hold)
            assert busy.value.code == "busy"
            assert await limiter.run("other", lambda: "answered") == "answered"
            assert len(started) == OF_PROJECT
            go.set()

    anyio.run(ask)
    assert len(started) == OF_PROJECT + OF_PROJECT_WAITING


def test_the_time_for_a_bundle_follows_its_size() -> None:
    limits = BundleLimits()
    assert limits.seconds(0) == limits.timeout_s
    assert limits.seconds(150_000) < limits.timeout_s + 2
    assert limits.seconds(limits.bytes) == limits.longest_s
