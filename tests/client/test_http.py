"""The Python client: problems become errors, streams are taken up where they broke."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator

import httpx2
import pytest

from certifier.errors import CirisError
from certifier.model import Scene
from ciris.synchronous import client as synchronous
from ciris.synchronous.client import Client


def test_a_problem_arrives_as_the_error_it_was(url: str, scene: Scene) -> None:
    with Client(url) as client, pytest.raises(CirisError) as caught:
        client.create_job({"kind": "grow", "scene": "slider", "seed": {"q": [9]}})
    assert (caught.value.code, caught.value.field) == ("seed_outside_limits", "seed.q[0]")


def test_a_job_under_a_key_is_made_once(url: str, scene: Scene) -> None:
    request = {"kind": "grow", "scene": "slider", "seed": {"q": [0]}}
    with Client(url) as client:
        first, new = client.create_job(request, "k")
        again, repeated = client.create_job(request, "k")
    assert (new, repeated, again["id"]) == (True, False, first["id"])


def pretending(answer: Callable[[httpx2.Request], httpx2.Response]) -> Client:
    client = Client("http://service")
    client._connections = httpx2.Client(base_url="http://service", transport=httpx2.MockTransport(answer))
    return client


class Breaking(httpx2.SyncByteStream):
    """A body that breaks off."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __iter__(self) -> Iterator[bytes]:
        yield self._text.encode()
        raise httpx2.ReadError("connection reset")


def sse(seq: int) -> str:
    event = {"seq": seq, "kind": "job", "data": {"state": "running"}}
    return f"event: job\ndata: {json.dumps(event)}\nid: {seq}\n\n: ping\n\n"


def test_a_broken_stream_is_taken_up_after_the_last_event() -> None:
    asked: list[str] = []

    def answer(request: httpx2.Request) -> httpx2.Response:
        if not request.url.path.endswith("/stream"):
            return httpx2.Response(200, json={"id": "j"})
        asked.append(request.headers["Last-Event-ID"])
        if len(asked) == 1:
            return httpx2.Response(200, stream=Breaking(sse(1) + sse(2)))
        return httpx2.Response(200, text=sse(3) + 'event: end\ndata: {"job": "j"}\n\n')

    events = list(pretending(answer).events("j"))
    assert [event["seq"] for event in events] == [1, 2, 3]
    assert asked == ["0", "2"]


def test_a_stream_that_closes_without_an_end_is_taken_up_too() -> None:
    answers = iter([sse(1), sse(2) + "event: end\ndata: {}\n\n"])

    def answer(request: httpx2.Request) -> httpx2.Response:
        streamed = request.url.path.endswith("/stream")
        return httpx2.Response(200, text=next(answers)) if streamed else httpx2.Response(200, json={"id": "j"})

    events = pretending(answer).events("j")
    assert [event["seq"] for event in events] == [1, 2]


def test_a_service_that_goes_away_for_good_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(synchronous, "ABSENCE_S", 0.1)

    def answer(request: httpx2.Request) -> httpx2.Response:
        if request.url.path.endswith("/stream"):
            return httpx2.Response(200, stream=Breaking(sse(1)))
        raise httpx2.ConnectError("refused")

    events = pretending(answer).events("j")
    assert next(events)["seq"] == 1
    with pytest.raises(CirisError, match="does not answer"):
        next(events)


def test_something_else_at_the_address_is_an_error() -> None:
    with pytest.raises(CirisError, match="is that the address of a ciris service"):
        pretending(lambda request: httpx2.Response(404, text="<html>")).scenes()
