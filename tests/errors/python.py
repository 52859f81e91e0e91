"""Errors of the Python client."""

from __future__ import annotations

import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
import pytest

from ciris import Space, connect
from ciris.asynchronous import client as asynchronous
from ciris.synchronous import client as synchronous
from tests.errors.rows import Provoke, Row, Trial, rows

NOBODY = "http://127.0.0.1:9"
TELLS = "`ciris job show {...}`, or `obstacles` of the job in Python, tells more"
ADDRESS = "write it as http://HOST:PORT"


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
        for module in (synchronous, asynchronous):
            patch.setattr(module, "ABSENCE_S", 0.1)
        connect(NOBODY).client.job_after_all("1f9b2a7c")


def half_turn(t: Trial) -> None:
    Space(("hinge",), np.zeros(1), -np.ones(1), np.ones(1), np.array([True])).to_s([3.5])


def damaged_stack(t: Trial) -> str:
    t.write(stack__json="{")
    return t.ciris("scene", "ls", CIRIS_DATA_DIR=str(t.directory))


CLIENT: list[tuple[str, str, str, str, Provoke | str]] = [
    (
        "unreachable",
        "",
        "{message}; the job {job_id} goes on",
        "wait for it again with job({job_id}) of the service, or with `ciris job follow {...}`",
        lambda t: waited(),
    ),
    (
        "argument",
        "",
        "the request holds something that cannot be sent, such as a number that is not finite or a name of many pages",
        "give texts, finite numbers, and lists of them",
        lambda t: connect(NOBODY).grow("cell", [0.0], deadline=float("nan")),
    ),
    ("closed", "", "the connections to the service are closed", "connect again", lambda t: closed()),
]
"""Of the client in both kinds."""

PYTHON: list[Row] = [
    *(row for twin in ("asynchronous", "synchronous") for row in rows(f"ciris/{twin}/client.py", *CLIENT)),
    *rows(
        "ciris/requests.py",
        (
            "unknown_option",
            "{name}",
            "there is no option {name}",
            "options: {...}",
            lambda t: connect(NOBODY).grow("cell", [0.0], haste=60),  # type: ignore[call-arg]
        ),
        (
            "argument",
            "{field}",
            "{__name__} is no {field}",
            "give {what}",
            lambda t: connect(NOBODY).contains(3, [0.0]),  # type: ignore[arg-type]
        ),
        ("argument", "timeout", "{timeout} is no timeout", "give seconds, a number above 0", lambda t: connect(NOBODY, timeout=0)),
        (
            "argument",
            "paths",
            "{__name__} is no paths",
            "give a list of (k, n) arrays",
            lambda t: connect(NOBODY).cover("cell", paths=3),  # type: ignore[arg-type]
        ),
        ("unknown_option", "{name}", "there is no option {name}", "give it in {...}", "a member of a group that stands beside it"),
        ("argument", "{name}", "{__name__} is no options", "give a dict of options", "a group of options that is no dict"),
    ),
    *rows(
        "ciris/space.py",
        (
            "points",
            "{field}",
            "these are not finite numbers, as many in every row",
            "give real numbers, such as joint positions",
            lambda t: connect(NOBODY).grow("cell", [[0.0], [1.0, 2.0]]),  # type: ignore[list-item]
        ),
        (
            "outside_window",
            "q",
            "{...} is {value} rad, which is half a turn or more from q* = {centre} rad",
            "its limits are {...} and {...} rad",
            half_turn,
        ),
    ),
    *rows(
        "ciris/problems.py",
        ("url", "", "{url} is no address", ADDRESS, lambda t: connect("http://127.0.0.1:port")),
        ("url", "", "{url} is no address of a service", ADDRESS, lambda t: connect("localhost:8643")),
        (
            "timeout",
            "",
            "the service at {url} has not answered in time",
            "ask for less, or connect with a longer timeout",
            lambda t: answered(200, pause=0.5),
        ),
        (
            "unreachable",
            "",
            "{url} answered {status}: who answers there cannot reach the service now",
            "try again soon",
            lambda t: answered(502),
        ),
        (
            "too_many_requests",
            "",
            "{url} answered that it was asked too often",
            "ask less often, or try again later",
            lambda t: answered(429, **{"retry-after": "86400"}),
        ),
        (
            "not_ciris",
            "",
            "{url} answered with what cannot be decoded",
            "is that the address of a ciris service?",
            lambda t: answered(200, b"no gzip", **{"content-encoding": "gzip"}),
        ),
        (
            "not_ciris",
            "",
            "the answer lacks {name}",
            "is it a ciris service of this version that answers?",
            lambda t: answered(200, b"{}"),
        ),
        (
            "not_ciris",
            "",
            "{url} sends you on to {...}",
            "give the address that it leads to",
            lambda t: answered(302, location="http://127.0.0.1:9/"),
        ),
        ("not_ciris", "", "{url} answered {status}", "is that the address of a ciris service?", lambda t: answered(404)),
        (
            "not_ciris",
            "",
            "{url} answered {status_code} with something that is not a JSON object",
            "is that the address of a ciris service?",
            lambda t: answered(200, b"<html>"),
        ),
    ),
    *rows(
        "ciris/find.py",
        (
            "no_service",
            "",
            "{...} does not say where the service is",
            "start it again with `ciris up`, or name its address",
            damaged_stack,
        ),
        (
            "api_key",
            "CIRIS_API_KEY_FILE",
            "{value}: {...}",
            "name the file that holds the key",
            lambda t: t.ciris("scene", "ls", CIRIS_URL=NOBODY, CIRIS_API_KEY_FILE=str(t.directory / "none")),
        ),
    ),
    *rows(
        "ciris/job.py",
        (
            "no_region",
            "",
            "a job that certifies a motion has no region",
            "`motion` of the job returns its verdict",
            "`result` of a job of the kind certify-path",
        ),
        (
            "no_region",
            "",
            "the job has ended without a region; its outcome is {...}",
            TELLS,
            "`result` of a job that certified a polytope, and found it refuted",
        ),
        ("job_{...}", "", "{...}", TELLS, "a job that was cancelled while `ciris grow` followed it"),
        ("job_{...}", "", "the job is {...}", TELLS, "a job that ended without a word"),
    ),
]
