"""Errors of the Python client."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Coroutine
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
import pytest

from ciris import AsyncService, Space, connect, connect_async
from ciris.asynchronous import client as asynchronous
from ciris.synchronous import client as synchronous
from tests.errors.trial import Table, Trial

NOBODY = "http://127.0.0.1:9"


def answered(status: int, body: bytes = b"", pause: float = 0.0, **headers: str) -> None:
    """Asks for the scenes of somebody who answers like this."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            time.sleep(pause)
            self.send_response(status)
            for name, value in {**headers, "content-length": str(len(body))}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: Any) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            with connect(f"http://127.0.0.1:{server.server_port}", timeout=pause / 5 or 5.0) as service:
                service.scenes()
        finally:
            server.shutdown()
            thread.join()


def closed() -> None:
    service = connect(NOBODY)
    service.close()
    service.scenes()


def waited() -> None:
    """Waits for a job of a service that has gone, with less patience than people have."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(synchronous, "ABSENCE_S", 0.1)
        connect(NOBODY).client.job_after_all("1f9b2a7c")


def asynchronously(ask: Callable[[AsyncService], Coroutine[Any, Any, object]]) -> None:
    """Asks a service that is not there, with the client that does not block."""

    async def asked() -> None:
        async with connect_async(NOBODY) as service:
            await ask(service)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(asynchronous, "ABSENCE_S", 0.1)
        asyncio.run(asked())


async def closed_before(service: AsyncService) -> None:
    await service.aclose()
    await service.scenes()


def half_turn(t: Trial) -> None:
    Space(("hinge",), np.zeros(1), -np.ones(1), np.ones(1), np.array([True])).to_s([3.5])


def damaged_stack(t: Trial) -> None:
    t.write(stack__json="{")
    t.ciris("scene", "ls", CIRIS_DATA_DIR=str(t.directory))


PYTHON: Table = {
    ("unreachable", ""): [
        lambda t: waited(),
        lambda t: asynchronously(lambda service: service.client.job_after_all("1f9b2a7c")),
        lambda t: answered(502),
    ],
    ("argument", ""): [
        lambda t: connect(NOBODY).grow("cell", [0.0], deadline=float("nan")),
        lambda t: asynchronously(lambda service: service.grow("cell", [0.0], deadline=float("nan"))),
    ],
    ("closed", ""): [lambda t: closed(), lambda t: asynchronously(closed_before)],
    ("unknown_option", "haste"): [lambda t: connect(NOBODY).grow("cell", [0.0], haste=60)],
    ("unknown_option", "xyz"): [lambda t: connect(NOBODY).grow("cell", [0.0], xyz=1)],
    ("unknown_option", "pushes"): [lambda t: connect(NOBODY).grow("cell", [0.0], pushes=1)],
    ("argument", "paper"): [lambda t: connect(NOBODY).grow("cell", [0.0], paper=3)],
    ("argument", "scene"): [lambda t: connect(NOBODY).contains(3, [0.0])],
    ("argument", "timeout"): [lambda t: connect(NOBODY, timeout=0)],
    ("argument", "paths"): [lambda t: connect(NOBODY).cover("cell", paths=3)],
    ("points", "q"): [lambda t: connect(NOBODY).grow("cell", [[0.0], [1.0, 2.0]]), lambda t: connect(NOBODY).certify_path("cell")],
    ("points", "bezier"): [lambda t: connect(NOBODY).path("cell", [[0.0], [1.0]], bezier=[[[0.0], [1.0]]])],
    ("points", "knots"): [lambda t: connect(NOBODY).path("cell", knots=[[0.0, 1.0]], control_points=[[0.0], [1.0]])],
    ("outside_window", "q"): [half_turn],
    ("url", ""): [lambda t: connect("http://127.0.0.1:port"), lambda t: connect("localhost:8643")],
    ("timeout", ""): [lambda t: answered(200, pause=0.5)],
    ("too_many_requests", ""): [lambda t: answered(429, **{"retry-after": "86400"})],
    ("not_ciris", ""): [
        lambda t: answered(200, b"no gzip", **{"content-encoding": "gzip"}),
        lambda t: answered(200, b"{}"),
        lambda t: answered(302, location="http://127.0.0.1:9/"),
        lambda t: answered(404),
        lambda t: answered(200, b"<html>"),
    ],
    ("no_service", ""): [damaged_stack],
    ("api_key", "CIRIS_API_KEY_FILE"): [lambda t: t.ciris("scene", "ls", CIRIS_URL=NOBODY, CIRIS_API_KEY_FILE=str(t.directory / "none"))],
}
