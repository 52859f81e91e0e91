"""Slow, silent and forged clients, on a real server and real sockets."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest
import uvicorn
from starlette.types import Message, Receive, Scope, Send

from api import connections
from api.connections import BoundedProtocol
from api.guard import _network
from db.settings import Settings
from tests.workers.service import eventually

REQUEST = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
LARGE = 64 * 2**20


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """All limits are short."""
    for name, value in {"HEAD_SECONDS": 1, "BODY_SECONDS": 1, "BODY_RATE": 1000, "ANSWER_SECONDS": 1, "LOOK_SECONDS": 0.1}.items():
        monkeypatch.setattr(connections, name, value)


async def app(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers with who asked and how long the body was; with megabytes at /large, and never at /stream."""
    size, more = 0, True
    while more:
        message: Message = await receive()
        if message["type"] == "http.disconnect":
            return
        size, more = size + len(message["body"]), message["more_body"]
    body = bytes(LARGE) if scope["path"] == "/large" else json.dumps({"client": _network(scope), "size": size}).encode()
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", str(len(body)).encode())]})
    if scope["path"] == "/stream":
        await receive()
        return
    await send({"type": "http.response.body", "body": body})


class Serving:
    def __init__(self, server: uvicorn.Server, port: int) -> None:
        self.server, self.port = server, port

    def connect(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.port), timeout=20)

    def open_connections(self) -> int:
        return len(self.server.server_state.connections)


@contextmanager
def serving(**options: Any) -> Iterator[Serving]:
    listening = socket.create_server(("127.0.0.1", 0))
    server = uvicorn.Server(uvicorn.Config(app, http=BoundedProtocol, ws="none", lifespan="off", log_config=None, **options))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    try:
        eventually(lambda: server.started, "the server starts")
        yield Serving(server, listening.getsockname()[1])
    finally:
        server.should_exit = server.force_exit = True
        thread.join(20)
        listening.close()


@pytest.fixture
def served() -> Iterator[Serving]:
    with serving() as running:
        yield running


def everything(connection: socket.socket) -> bytes:
    """What comes until the server closes the connection."""
    parts = []
    with suppress(ConnectionResetError):  # what this end has sent meanwhile was not read
        while part := connection.recv(65536):
            parts.append(part)
    return b"".join(parts)


def answered(connection: socket.socket) -> bool:
    """Whether a request is answered, to its end."""
    connection.sendall(REQUEST)
    answer = b""
    while not answer.endswith(b'"size": 0}'):
        part = connection.recv(65536)
        if not part:
            return False
        answer += part
    return answer.startswith(b"HTTP/1.1 200")


def problem(answer: bytes) -> tuple[int, str]:
    head, _, body = answer.partition(b"\r\n\r\n")
    assert b"Connection: close" in head
    assert b"application/problem+json" in head
    return int(head.split()[1]), str(json.loads(body)["code"])


def trickle(connection: socket.socket, *, stop: threading.Event) -> None:
    while not stop.wait(0.05):
        try:
            connection.sendall(b"x")
        except OSError:
            return


@contextmanager
def trickling(connection: socket.socket) -> Iterator[None]:
    stop = threading.Event()
    thread = threading.Thread(target=trickle, args=(connection,), kwargs={"stop": stop})
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def test_who_says_nothing_is_let_go(served: Serving) -> None:
    with served.connect() as silent:
        began = time.monotonic()
        assert everything(silent) == b""
        assert 0.9 < time.monotonic() - began < 10


def test_headers_that_trickle_are_refused(served: Serving) -> None:
    with served.connect() as slow:
        slow.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ")
        with trickling(slow):
            assert problem(everything(slow)) == (408, "too_slow")


def test_headers_that_trickle_are_refused_on_a_kept_connection(served: Serving) -> None:
    with served.connect() as slow:
        assert answered(slow)
        slow.sendall(REQUEST[:-2] + b"X-Slow: ")
        with trickling(slow):
            assert problem(everything(slow)) == (408, "too_slow")


@pytest.mark.parametrize("first", [b"GET /" + b"x" * 1000, b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Long: x"])
def test_an_address_and_headers_without_end_are_refused(served: Serving, first: bytes) -> None:
    with served.connect() as long:
        long.sendall(first)
        for _ in range(3):
            time.sleep(0.05)
            long.sendall(bytes(connections.HEAD_BYTES // 2).replace(b"\0", b"x"))
        assert problem(everything(long)) == (431, "too_large")


def test_a_body_that_trickles_is_refused(served: Serving) -> None:
    with served.connect() as slow:
        slow.sendall(b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\n")
        with trickling(slow):
            assert problem(everything(slow)) == (408, "too_slow")


def test_a_body_may_take_its_time_while_it_comes(served: Serving) -> None:
    """Three times as long as a body that trickles may take, at a bit more than the least rate."""
    with served.connect() as honest:
        honest.sendall(b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 4000\r\nConnection: close\r\n\r\n")
        began = time.monotonic()
        for k in range(40):
            honest.sendall(bytes(100))
            time.sleep(max(0.0, began + 0.08 * (k + 1) - time.monotonic()))
        assert everything(honest).endswith(b'"size": 4000}')


def test_a_kept_connection_may_be_idle(served: Serving) -> None:
    with served.connect() as kept:
        for _ in range(2):
            assert answered(kept)
            time.sleep(1.5)


def test_who_never_takes_an_answer_is_let_go(served: Serving) -> None:
    with served.connect() as deaf:
        deaf.sendall(REQUEST.replace(b"/ ", b"/large ", 1))
        eventually(lambda: served.open_connections() == 1, "the request is answered", 10)
        eventually(lambda: served.open_connections() == 0, "the connection ends", 20)


def test_a_slow_reader_gets_all_of_an_answer(served: Serving) -> None:
    with served.connect() as slow:
        slow.sendall(REQUEST.replace(b"/ ", b"/large ", 1))
        size, began = 0, time.monotonic()
        while size < LARGE:
            part = slow.recv(2**20)
            assert part
            size += len(part)
            if time.monotonic() - began < 3:
                time.sleep(0.05)


def test_who_waits_longest_makes_room(served: Serving, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "CONNECTIONS", 3)
    monkeypatch.setattr(connections, "HEAD_SECONDS", 60)
    with served.connect() as stream, served.connect() as first, served.connect() as second:
        stream.sendall(REQUEST.replace(b"/ ", b"/stream ", 1))
        assert stream.recv(65536).startswith(b"HTTP/1.1 200")
        second.sendall(b"GET / HT")
        eventually(lambda: served.open_connections() == 3, "all are there", 10)
        for _ in range(3):
            with served.connect() as honest:
                assert answered(honest)
        assert first.recv(1) == b""
        stream.setblocking(False)
        with pytest.raises(BlockingIOError):
            stream.recv(1)


def test_a_process_whose_connections_are_all_at_work_says_so(served: Serving, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "CONNECTIONS", 1)
    with served.connect() as stream:
        stream.sendall(REQUEST.replace(b"/ ", b"/stream ", 1))
        assert stream.recv(65536).startswith(b"HTTP/1.1 200")
        with served.connect() as late:
            assert problem(everything(late)) == (503, "busy")


FORGED = [
    ("", "198.51.100.7", "127.0.0.1"),  # nobody is believed
    ("127.0.0.1", "198.51.100.7", "198.51.100.7"),
    ("127.0.0.1", "203.0.113.9, 198.51.100.7", "198.51.100.7"),  # a caller wrote the first, the proxy added the second
    ("127.0.0.1", "127.0.0.1, 198.51.100.7", "198.51.100.7"),
    ("127.0.0.0/8, 10.0.0.0/8", "203.0.113.9, 198.51.100.7, 10.1.2.3", "198.51.100.7"),  # two proxies
    ("127.0.0.1", "198.51.100.7\r\nX-Forwarded-For: 10.1.2.3", "10.1.2.3"),  # two headers are one list
    ("127.0.0.1", "2001:db8:1:2:3::4", "2001:db8:1:2::/64"),
    ("10.0.0.0/8", "198.51.100.7", "127.0.0.1"),
]


@pytest.mark.parametrize(("trusted", "forwarded", "counted"), FORGED)
def test_the_last_address_that_is_no_proxy_of_ours_counts(
    monkeypatch: pytest.MonkeyPatch, trusted: str, forwarded: str, counted: str
) -> None:
    monkeypatch.setenv("CIRIS_TRUSTED_PROXIES", trusted)
    believed = [str(network) for network in Settings().trusted_proxies]
    with serving(forwarded_allow_ips=believed) as running, running.connect() as client:
        client.sendall(f"GET / HTTP/1.1\r\nHost: localhost\r\nX-Forwarded-For: {forwarded}\r\nConnection: close\r\n\r\n".encode())
        assert json.loads(everything(client).partition(b"\r\n\r\n")[2])["client"] == counted
