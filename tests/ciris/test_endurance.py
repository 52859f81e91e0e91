"""The Python client across processes, restarts and many waits, and what it gives out."""

from __future__ import annotations

import asyncio
import copy
import dataclasses
import multiprocessing
import pickle
import re
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import uvicorn

import ciris
from api.app import create_app
from ciris.synchronous import client as synchronous
from db import jobs
from db.session import Database
from db.states import JobState
from tests.errors.python import NOBODY, answered


@contextmanager
def serving(database: Database, port: int) -> Iterator[None]:
    server = uvicorn.Server(uvicorn.Config(create_app(database), log_level="warning", timeout_graceful_shutdown=1))
    listening = socket.create_server(("127.0.0.1", port), reuse_port=True)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    while not server.started:
        time.sleep(0.02)
    try:
        yield
    finally:
        server.should_exit = True
        thread.join()
        listening.close()


@pytest.fixture
def port() -> Iterator[int]:
    """A port that nobody else is given, at which nobody listens yet."""
    with socket.socket() as held:
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        held.bind(("127.0.0.1", 0))
        yield held.getsockname()[1]


def end(database: Database, job_id: str) -> None:
    with database.write() as session:
        jobs.finish(session, jobs.lock(session, job_id), JobState.SUCCEEDED, outcome="inconclusive", reason="the deadline was reached")


def test_a_wait_outlives_a_restart_of_the_service(database: Database, client: Any, running: str, port: int) -> None:
    with serving(database, port):
        job = ciris.connect(f"http://127.0.0.1:{port}").job(running)
        found: list[ciris.Job] = []
        waiting = threading.Thread(target=lambda: found.append(job.wait()))
        waiting.start()
        time.sleep(0.3)
    time.sleep(0.5)
    end(database, running)
    with serving(database, port):
        waiting.join(20)
        assert [one.state for one in found] == ["succeeded"]


def test_who_has_waited_in_vain_is_told_the_job(
    database: Database, client: Any, running: str, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(synchronous, "ABSENCE_S", 0.5)
    with serving(database, port):
        job = ciris.connect(f"http://127.0.0.1:{port}").job(running)
    with pytest.raises(ciris.CirisError, match=f"the job {running} goes on") as caught:
        job.wait()
    assert caught.value.code == "unreachable"
    assert f"job({running!r})" in caught.value.hint


def test_many_waits_leave_room_for_questions(database: Database, client: Any, url: str, running: str, region: str) -> None:
    async def ask() -> bool:
        async with ciris.connect_async(url, timeout=10) as service:
            job = await service.job(running)
            waits = [asyncio.create_task(job.wait()) for _ in range(120)]
            await asyncio.sleep(2)
            inside = bool(await service.contains("slider", [0.1]))
            end(database, running)
            ended = await asyncio.gather(*waits)
            return inside and all(one.ended for one in ended)

    assert asyncio.run(ask())


def _names(service: ciris.Service, answers: Any) -> None:
    answers.put([one.name for one in service.scenes()])


def test_a_forked_process_hears_its_own_answers(url: str, region: str) -> None:
    service = ciris.connect(url)
    assert service.scenes()
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    children = [context.Process(target=_names, args=(service, answers)) for _ in range(4)]
    before = service.client._connections
    for child in children:
        child.start()
    for _ in range(20):
        assert [one.name for one in service.scenes()] == ["slider"]
    heard = [answers.get(timeout=30) for _ in children]
    for child in children:
        child.join()
    assert heard == [["slider"]] * 4
    assert service.client._connections is before


def test_what_is_pickled_works_elsewhere_and_holds_no_key(url: str, region: str) -> None:
    assert b"ciris_secret" not in pickle.dumps(ciris.connect(url, "ciris_secret"))
    service = ciris.connect(url)
    found, scene, (job,) = service.region(region), service.scene("slider"), service.jobs()
    data = pickle.dumps((service, found, scene, job))
    for one in (pickle.loads(data), copy.deepcopy((service, found, scene, job))):
        again, same_region, same_scene, same_job = one
        assert [other.name for other in again.scenes()] == ["slider"]
        assert (same_region, same_scene) == (found, scene)
        assert same_region.verify()
        assert same_job.refresh().state == job.state
    error = pickle.loads(pickle.dumps(ciris.CirisError("code", "what", field="where", hint="do")))
    assert (error.code, error.message, error.field, error.hint, str(error)) == ("code", "what", "where", "do", "where: what (do)")


def test_arrays_cannot_be_written_to(url: str, region: str) -> None:
    service = ciris.connect(url)
    found = service.region(region)
    for owner in (found, found.space, service.scene("slider").space, service.nearest("slider", [0.9])[0]):
        arrays = [value for field in dataclasses.fields(owner) if isinstance(value := getattr(owner, field.name), np.ndarray)]
        assert arrays
        for array in arrays:
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0


def test_equal_are_what_has_the_same_id(url: str, region: str) -> None:
    first, second = ciris.connect(url), ciris.connect(url)
    assert first.region(region) == second.region(region[:8])
    assert len({first.region(region), second.region(region)}) == 1
    assert first.scene("slider") == second.scene("slider") != first.region(region)


def test_a_part_of_answers_is_true_only_if_all_of_it_is(url: str, region: str) -> None:
    answer = ciris.connect(url).contains("slider", [[0.1], [0.9], [0.0]])
    assert not answer[:2]
    assert answer[2:]
    assert answer[::2].inside.tolist() == [True, True]
    assert answer[1:].version == answer.version


def test_half_a_turn_from_the_centre_has_no_s() -> None:
    space = ciris.Space(("a", "b", "slide"), np.zeros(3), -2 * np.ones(3), 2 * np.ones(3), np.array([True, True, False]))
    assert np.allclose(space.to_q(space.to_s([[3.1, -3.1, 9.0]])), [[3.1, -3.1, 9.0]])
    for q in ([np.pi, 0, 0], [0, -3.2, 0], [[0, 0, 0], [6.4, 0, 0]]):
        with pytest.raises(ciris.CirisError, match="half a turn or more") as caught:
            space.to_s(q)
        assert caught.value.field == "q"


@pytest.mark.parametrize(
    "q",
    [[[0.0], [1.0, 2.0]], [1j], [None], [np.nan], np.ma.masked_array([1.0], mask=[True]), object()],
    ids=["ragged", "complex", "none", "nan", "masked", "object"],
)
def test_what_is_no_array_of_numbers_is_refused_before_it_is_sent(q: Any) -> None:
    service = ciris.connect("http://127.0.0.1:9")
    for ask in (service.contains, service.grow, service.nearest, service.certify_path):
        with pytest.raises(ciris.CirisError) as caught:
            ask("cell", q)
        assert (caught.value.code, caught.value.field) == ("points", "q")


def test_numbers_of_numpy_are_numbers(url: str, region: str) -> None:
    service = ciris.connect(url)
    job = service.submit_grow("slider", np.zeros(1), cells=np.int64(50), deadline=np.float64(1), priority=np.int8(1))
    assert job.cancel().id == job.id


@pytest.mark.parametrize("body", [b"[]", b"3", b"null", b"{}"])
def test_json_that_is_no_answer_of_ciris_is_said(body: bytes) -> None:
    with pytest.raises(ciris.CirisError) as caught:
        answered(200, body)
    assert caught.value.code == "not_ciris"


def test_a_pause_of_a_day_is_not_waited_for() -> None:
    begin = time.monotonic()
    with pytest.raises(ciris.CirisError, match="asked too often"):
        answered(429, **{"retry-after": "86400"})
    assert time.monotonic() - begin < 30


@pytest.mark.parametrize("url", ["http://127.0.0.1:99999", "http://two words", "http://[::1"])
def test_what_is_no_address_is_refused_before_anybody_is_asked(url: str) -> None:
    with pytest.raises(ciris.CirisError) as caught:
        ciris.connect(url)
    assert caught.value.code == "url"


@pytest.mark.parametrize("timeout", [0, -1, float("nan"), float("inf"), None, "x"])
def test_a_timeout_is_a_positive_number(timeout: Any) -> None:
    with pytest.raises(ciris.CirisError) as caught:
        ciris.connect("http://127.0.0.1:9", timeout=timeout)
    assert (caught.value.code, caught.value.field) == ("argument", "timeout")


def test_options_that_are_none_are_not_given(url: str, region: str) -> None:
    service = ciris.connect(url)
    assert service.submit_grow("slider", [0.0], contain=None, method=None).cancel()  # type: ignore[typeddict-item]
    assert service.submit_cover("slider", paths=None, connect=None, deadline=1).cancel()  # type: ignore[arg-type]


def test_names_that_are_none_are_refused() -> None:
    service = ciris.connect(NOBODY)
    for name in ("x" * 100_000, "\ud800", "a\nb", "a\0b", ""):
        with pytest.raises(ciris.CirisError) as caught:
            service.scene(name)
        assert caught.value.code == "not_found"
        assert len(str(caught.value)) < 1000
        with pytest.raises(ciris.CirisError) as caught:
            service.jobs("x" * 100_000)
        assert caught.value.code == "argument"
    for path in (None, 3, b"scene.yaml"):
        with pytest.raises(ciris.CirisError) as caught:
            service.add_scene(path)  # type: ignore[arg-type]
        assert (caught.value.code, caught.value.field) == ("argument", "path")


def test_hints_are_for_whoever_asks_in_python(url: str, region: str) -> None:
    service = ciris.connect(url)
    for ask, hint in (
        (lambda: service.submit_grow("slider", [0.0], deadline=-1), r"help\(\) of the method"),
        (lambda: ciris.connect(f"{url}/elsewhere").scenes(), "address of a ciris service"),
        (lambda: service.region("nothing"), r"regions\(\)"),
        (lambda: service.job("nothing"), r"jobs\(\)"),
        (lambda: service.scene("nothing like it"), r"scenes\(\)"),
    ):
        with pytest.raises(ciris.CirisError) as caught:
            ask()
        assert re.search(hint, caught.value.hint)
        assert "openapi" not in caught.value.hint
    with pytest.raises(ciris.CirisError) as caught:
        service.contains("slider", np.zeros((0, 1)))
    assert "validation" not in caught.value.message


def test_a_refuted_polytope_has_no_region_and_says_so(url: str, scene: Any, database: Database) -> None:
    job = ciris.connect(url).submit_certify("slider", [[1.0], [-1.0]], [0.1, 0.1])
    with database.write() as session:
        row = jobs.get(session, job.id)
        jobs.start(session, row)
        jobs.finish(session, row, JobState.SUCCEEDED, outcome="refuted", reason="the given polytope, every pair")
    with pytest.raises(ciris.CirisError, match="its outcome is refuted") as caught:
        job.result()
    assert caught.value.code == "no_region"


def test_no_message_shows_a_key(monkeypatch: pytest.MonkeyPatch) -> None:
    for key in ("secret\nkey", "secret key", "geheimnisß", b"secret key"):
        with pytest.raises(ciris.CirisError) as caught:
            ciris.connect("http://127.0.0.1:9", key)  # type: ignore[arg-type]
        assert caught.value.code == "api_key"
        assert "secret" not in str(caught.value)
        assert "geheimnis" not in str(caught.value)
