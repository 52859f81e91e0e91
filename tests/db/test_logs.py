"""Log lines: JSON, with what is bound to the work at hand, and blotted where a secret got in."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from structlog.contextvars import bound_contextvars

from db import logs

log = logging.getLogger("room.module")


@contextmanager
def logging_as(process: str) -> Iterator[None]:
    root = logging.getLogger()
    before, level = root.handlers[:], root.level
    root.handlers[:] = []
    logs.configure(process)
    try:
        yield
    finally:
        root.handlers[:], root.level = before, level


def test_a_line_says_what_it_is_about(capsys: pytest.CaptureFixture[str]) -> None:
    with logging_as("solve"):
        with bound_contextvars(job="j", iteration=2, pair=7):
            log.warning("it took %d s", 3)
        log.info("afterwards")
    first, second = map(json.loads, capsys.readouterr().err.splitlines())
    assert (
        first.items()
        >= {
            "message": "it took 3 s",
            "level": "warning",
            "logger": "room.module",
            "process": "solve",
            "job": "j",
            "iteration": 2,
            "pair": 7,
        }.items()
    )
    assert first["timestamp"].endswith("Z")
    assert "job" not in second


def test_an_exception_stays_on_its_line_without_local_variables(capsys: pytest.CaptureFixture[str]) -> None:
    hidden = "a local secret"
    with logging_as("solve"):
        try:
            raise ValueError("no good")
        except ValueError:
            log.exception("failed")
    (line,) = map(json.loads, capsys.readouterr().err.splitlines())
    assert "ValueError: no good" in line["exception"]
    assert hidden not in json.dumps(line["exception"])


@pytest.mark.parametrize(
    ("secret", "text"),
    [
        ("c2VjcmV0" * 5, "ciris_0123456789ab_{}"),
        ("c2VjcmV0" * 5 + "==", "whsec_{}"),
        ("pa55w0rd", "postgresql+psycopg://ciris:{}@postgres/ciris"),
        ("pa55w0rd", "redis://:{}@valkey:6379/0"),
    ],
)
def test_what_got_in_is_blotted(capsys: pytest.CaptureFixture[str], secret: str, text: str) -> None:
    with logging_as("solve"):
        log.warning("cannot use %s", text.format(secret))
        try:
            raise ValueError(text.format(secret))
        except ValueError:
            log.exception("failed")
    said = capsys.readouterr().err
    assert secret not in said
    assert said.count("***") >= 2
    for line in said.splitlines():
        json.loads(line)
