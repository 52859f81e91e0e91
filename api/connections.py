"""Connections of clients that are slow, silent or gone are bounded in time and in number.

A request has to arrive in time, and an answer has to be taken in time. Only the client's time counts: while this process does not read,
nobody is late. When there are more connections than one process holds, those that wait longest for a request make room for new ones. So
a client that opens many connections and says nothing on them loses those, and not the places of others.
"""

from __future__ import annotations

import resource
import socket
import time
from asyncio import BaseTransport, TimerHandle
from contextlib import suppress
from http import HTTPStatus
from typing import Any, cast

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from api.problems import as_json, problem_of
from certifier.errors import CirisError

HEAD_SECONDS = 30.0
"""The first line and the headers of a request must arrive within this many seconds from its first byte, or from the connection's start."""
HEAD_BYTES = 64 * 2**10
"""The first line and the headers of a request have at most about this many bytes."""
BODY_SECONDS, BODY_RATE = 30.0, 4096
"""A body may take BODY_SECONDS, and one second more for each BODY_RATE of its bytes."""
ANSWER_SECONDS, ANSWER_RATE = 60.0, 1024
"""A client that takes less than ANSWER_RATE bytes a second of an answer for ANSWER_SECONDS counts as gone."""
LOOK_SECONDS = 5.0
"""Every connection is looked at this often."""
CONNECTIONS = 1000
"""One process holds at most this many connections."""
FILES = 2 * CONNECTIONS
"""Number of files that a process may need to hold open, for connections and everything else."""

_LATE = CirisError("too_slow", "the request did not arrive in time", field="body", hint="send it faster, or in smaller parts")
_LONG = CirisError("too_large", f"the address and headers have more than {HEAD_BYTES // 2**10} KiB", hint="send less")
_FULL = CirisError("busy", "the service has as many connections as it can hold", hint="try again in a while")


def allow_files() -> None:
    """Lets this process open as many files as its connections need, if the system's hard limit allows that."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = FILES if hard == resource.RLIM_INFINITY else min(FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


class BoundedProtocol(HttpToolsProtocol):
    """uvicorn's protocol of a connection, with limits on how long the client may take."""

    waiting_since: float | None
    """When the connection began to wait for a request; None while one is answered."""

    def connection_made(self, transport: BaseTransport) -> None:
        super().connection_made(cast(Any, transport))
        now = time.monotonic()
        self.waiting_since = now
        self._head_since: float | None = now
        self._head_bytes = 0
        self._body_since: float | None = None
        self._said_something, self._body_bytes = False, 0
        self._left, self._taken_at = 0, now
        self._timer: TimerHandle | None = None
        _find_out_who_is_gone(transport)
        if len(self.connections) > CONNECTIONS and not self._make_room():
            self._refuse(_FULL, HTTPStatus.SERVICE_UNAVAILABLE)
            return
        self._timer = self.loop.call_later(LOOK_SECONDS, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        if self._head_since is None and self._body_since is None:
            self._head_since, self._head_bytes = time.monotonic(), 0
        self._said_something = True
        super().data_received(data)
        if self._head_since is not None:
            self._head_bytes += len(data)
            if self._head_bytes > HEAD_BYTES and not self.transport.is_closing():
                self._refuse(_LONG, HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE)

    def on_headers_complete(self) -> None:
        self.waiting_since, self._head_since = None, None
        self._body_since, self._body_bytes = time.monotonic(), 0
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        self._body_bytes += 0 if self.cycle.response_complete else len(body)
        super().on_body(body)

    def on_message_complete(self) -> None:
        self._body_since, self._said_something = None, False
        super().on_message_complete()

    def on_response_complete(self) -> None:
        self.waiting_since = time.monotonic()
        if self._body_since is not None:  # nobody reads the rest
            self._body_since, self._body_bytes = self.waiting_since, 0
        super().on_response_complete()
        if self.cycle is not None and not self.cycle.response_complete:
            self.waiting_since = None

    def _look(self) -> None:
        """Ends the connection if its client is late, and else looks again later."""
        self._timer = self.loop.call_later(LOOK_SECONDS, self._look)
        now = time.monotonic()
        if self._takes_nothing(now):
            self.transport.abort()
        elif self.flow.read_paused:
            self._head_since = None if self._head_since is None else now
            self._body_since = None if self._body_since is None else self._body_since + LOOK_SECONDS
        elif self._is_late(now) and not self.transport.is_closing():
            if self._said_something:
                self._refuse(_LATE, HTTPStatus.REQUEST_TIMEOUT)
            else:
                self.transport.close()

    def _takes_nothing(self, now: float) -> bool:
        """Says whether the client has taken hardly anything of an answer for too long."""
        left = self.transport.get_write_buffer_size()
        closing = self.transport.is_closing()
        if not (closing or self.flow.write_paused) or self._left - left >= ANSWER_RATE * LOOK_SECONDS or left > self._left:
            self._taken_at = now
        self._left = left
        return now - self._taken_at > ANSWER_SECONDS

    def _is_late(self, now: float) -> bool:
        if self._head_since is not None:
            return now - self._head_since > HEAD_SECONDS
        return self._body_since is not None and now - self._body_since > BODY_SECONDS + self._body_bytes / BODY_RATE

    def _make_room(self) -> bool:
        """Ends the connection that waits longest for a request, other than this one. Returns False when none waits."""
        others = (other for other in self.connections if isinstance(other, BoundedProtocol) and other is not self)
        waiting = [other for other in others if other.waiting_since is not None and not other.transport.is_closing()]
        if waiting:
            min(waiting, key=lambda other: other.waiting_since or 0.0).transport.abort()
        return bool(waiting)

    def _refuse(self, error: CirisError, status: HTTPStatus) -> None:
        """Ends the connection, with a problem unless an answer has begun."""
        if self.cycle is None or not self.cycle.response_started or self.cycle.response_complete:
            body = bytes(as_json(problem_of(error, status)).body)
            head = f"HTTP/1.1 {status} {status.phrase}\r\nContent-Type: application/problem+json\r\nContent-Length: {len(body)}\r\n"
            self.transport.write(f"{head}Connection: close\r\n\r\n".encode() + body)
        self.transport.close()


def _find_out_who_is_gone(transport: BaseTransport) -> None:
    """Makes the kernel end the connection of a machine that does not answer any more."""
    connection = transport.get_extra_info("socket")
    if connection is None or connection.family not in (socket.AF_INET, socket.AF_INET6):
        return
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (("TCP_KEEPIDLE", 30), ("TCP_KEEPINTVL", 10), ("TCP_KEEPCNT", 3), ("TCP_USER_TIMEOUT", int(1000 * ANSWER_SECONDS))):
        if hasattr(socket, name):  # macOS lacks some
            with suppress(OSError):
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
