"""Events as a list and as a stream; the stream against a real server, because a test client would wait for its end."""

import json
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack

import httpx2
import pytest
from fastapi.testclient import TestClient

from api import streams
from certifier.model import Scene
from db import events, jobs
from db.session import Database
from db.states import JobState
from tests.workers.service import eventually


@pytest.fixture
def job_id(database: Database, scene: Scene) -> str:
    with database.write() as session:
        job, _ = jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"random_seed": 0})
        return job.id


def add(database: Database, job_id: str, number: int) -> None:
    with database.write() as session:
        events.emit(session, jobs.lock(session, job_id), "pairs", {"iteration": number, "pairs": []})


def finish(database: Database, job_id: str) -> None:
    with database.write() as session:
        job = jobs.lock(session, job_id)
        jobs.start(session, job)
        jobs.finish(session, job, JobState.SUCCEEDED, reason="done", outcome="certified")


def read(lines: Iterator[str]) -> dict[str, str]:
    """The next event of a stream, comments left out."""
    fields: dict[str, str] = {}
    for line in lines:
        if not line and fields:
            return fields
        name, _, value = line.partition(": ")
        if name:
            fields[name] = value
    raise AssertionError("the stream closed")


def test_events_are_listed_in_order(client: TestClient, database: Database, job_id: str) -> None:
    for number in range(3):
        add(database, job_id, number)
    found = client.get(f"/v1/jobs/{job_id}/events").json()["events"]
    assert [event["seq"] for event in found] == [1, 2, 3, 4]
    rest = client.get(f"/v1/jobs/{job_id}/events?after=2&limit=1").json()["events"]
    assert [event["seq"] for event in rest] == [3]
    last = client.get(f"/v1/jobs/{job_id}/events?before=4&limit=2").json()["events"]
    assert [event["seq"] for event in last] == [2, 3]
    assert client.get(f"/v1/jobs/{job_id}/events?before=1").json()["events"] == []


def test_events_arrive_as_they_happen_and_the_stream_closes_with_the_job(url: str, database: Database, job_id: str) -> None:
    with httpx2.stream("GET", f"{url}/v1/jobs/{job_id}/events/stream", timeout=60) as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        lines = response.iter_lines()
        first = read(lines)
        assert (first["event"], first["id"], json.loads(first["data"])["data"]) == ("job", "1", {"state": "queued"})
        add(database, job_id, 7)
        second = read(lines)
        assert (second["event"], second["id"], json.loads(second["data"])["data"]["iteration"]) == ("pairs", "2", 7)
        finish(database, job_id)
        assert [read(lines)["event"] for _ in range(3)] == ["job", "job", "end"]
        assert list(lines) == []


def test_an_interrupted_stream_goes_on_where_it_was(url: str, database: Database, job_id: str) -> None:
    add(database, job_id, 1)
    finish(database, job_id)
    answer = httpx2.get(f"{url}/v1/jobs/{job_id}/events/stream", headers={"Last-Event-ID": "2"}, timeout=60)
    ids = [line.removeprefix("id: ") for line in answer.text.splitlines() if line.startswith("id: ")]
    assert ids == ["3", "4"]
    nothing_new = httpx2.get(f"{url}/v1/jobs/{job_id}/events/stream", params={"after": 4}, timeout=60)
    assert [line for line in nothing_new.text.splitlines() if line.startswith("event: ")] == ["event: end"]


@pytest.mark.parametrize("path", ["/v1/jobs/{job_id}/events/stream", "/v1/events/stream"])
def test_a_stream_that_is_to_go_on_beyond_the_last_event_tells_the_next_one(url: str, database: Database, job_id: str, path: str) -> None:
    """Such a number is of a database that was put back to a backup, or nobody's."""
    beyond = {"Last-Event-ID": str(2**31 - 1)}
    with httpx2.stream("GET", url + path.format(job_id=job_id), headers=beyond, timeout=20) as response:
        add(database, job_id, 7)
        began = time.monotonic()
        for line in response.iter_lines():
            assert time.monotonic() - began < 10, "only signs of life come"
            if line.startswith("data: ") and json.loads(line.removeprefix("data: "))["seq"] == 2:
                break


def test_a_project_has_a_limited_number_of_streams_which_look_by_turns(
    monkeypatch: pytest.MonkeyPatch, url: str, database: Database, job_id: str
) -> None:
    monkeypatch.setattr(streams, "OF_PROJECT", 2)
    with httpx2.Client(base_url=url, timeout=60) as client, ExitStack() as open_streams:
        listened = []
        for path in ("/v1/events/stream?after=0", f"/v1/jobs/{job_id}/events/stream"):
            lines = open_streams.enter_context(client.stream("GET", path)).iter_lines()
            assert read(lines)["event"] == "job"
            listened.append(lines)  # the stream is closed with it
        for path in ("/v1/events/stream", f"/v1/jobs/{job_id}/events/stream"):
            with client.stream("GET", path) as refused:
                assert refused.status_code == 503
                assert json.loads(refused.read())["code"] == "busy"
        assert client.get(f"/v1/jobs/{job_id}/events").status_code == 200
        open_streams.close()
        eventually(lambda: read_first(client, "/v1/events/stream?after=0") == "job", "a stream that was closed is not counted any more")


def test_streams_look_less_often_where_a_project_has_many() -> None:
    assert streams.Listening(Counter({"many": 100, "few": 3}), "few").pause == streams.POLL_SECONDS
    assert streams.Listening(Counter({"many": 100, "few": 3}), "many").pause == 100 / streams.LOOKS_PER_SECOND


def read_first(client: httpx2.Client, path: str) -> str | None:
    """The kind of the first event of a stream; None where it is refused."""
    with client.stream("GET", path) as response:
        return read(response.iter_lines())["event"] if response.status_code == 200 else None


def test_an_open_stream_does_not_keep_the_server_from_stopping(database: Database, job_id: str, url: str) -> None:
    with httpx2.stream("GET", f"{url}/v1/jobs/{job_id}/events/stream", timeout=60) as response:
        read(response.iter_lines())
