"""What people are told of a job's events."""

from __future__ import annotations

from collections.abc import Iterator
from threading import Event
from typing import Any, cast

import pytest

from ciris.synchronous.client import Client
from client import follow as following
from client.follow import Teller
from client.output import Screen


class Paper(Screen):
    """Keeps what is said."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self.last = ""
        self.part: float | None = None

    def line(self, text: str) -> None:
        self.lines.append(text)

    def status(self, text: str, part: float | None = None) -> None:
        self.last, self.part = text, part


def pair(index: int, state: str) -> dict[str, Any]:
    return {"index": index, "state": state, "stage": "sos", "margin": None, "seconds": 0.25}


SIZE = {"value": 0.25, "stderr": 0.003, "unit": "rad^2", "box_side": 28.6, "least_width": 0.456}
SHARE = {"value": 0.634, "stderr": 0.0052, "collision_free": 0.9, "samples": 10000}
EVENTS: list[tuple[str, dict[str, Any]]] = [
    ("job", {"state": "running"}),
    ("step", {"kind": "propose", "state": "open"}),
    ("step", {"kind": "propose", "state": "done", "seconds": 4.8}),
    ("iteration", {"index": 0, "label": "contract", "state": "running", "pairs": 2, "parts": 2, "reused": 0}),
    ("pairs", {"iteration": 0, "pairs": [pair(0, "certified"), pair(1, "not_certifiable")]}),
    ("iteration", {"index": 0, "label": "contract", "state": "failed"}),
    ("iteration", {"index": 1, "label": "contract", "state": "running", "pairs": 1, "parts": 1, "reused": 1}),
    ("pairs", {"iteration": 1, "pairs": [pair(1, "certified")]}),
    ("iteration", {"index": 1, "label": "contract", "state": "certified"}),
    ("region", {"region_id": "r", "iteration": 1, "guarantee": "exact", "ellipsoid_volume": 0.5, "q_volume": SIZE, "share": SHARE}),
    ("something_new", {}),
]


def told(watch: bool) -> Paper:
    paper = Paper()
    teller = Teller(paper, ["a - b", "a - c"], watch)
    for kind, data in EVENTS:
        teller.tell({"kind": kind, "data": data})
    return paper


def test_the_course_of_a_job_in_a_few_lines() -> None:
    assert told(watch=False).lines == [
        "seeding: done after 4.80 s",
        "iteration 0 (contract): failed, 2 of 2 pairs settled; a - c: not certifiable",
        "iteration 1 (contract): certified, 1 of 1 pairs settled",
        "certified region r of iteration 1: 63.4 +- 0.5 % of the proposal, 0.25 +- 0.003 rad^2, "
        "average width 28.6 deg, 0.456 deg or less where it is thinnest",
    ]


def test_after_a_region_the_status_line_says_what_is_kept() -> None:
    paper = Paper()
    teller = Teller(paper, ["a - b", "a - c"], watch=False)
    for kind, data in [*EVENTS, *EVENTS[3:5]]:
        teller.tell({"kind": kind, "data": data})
    assert paper.last == "iteration 0: 2 of 2 pairs settled, 63 % kept so far, a - c: not certifiable"


def test_watching_tells_of_every_pair() -> None:
    paper = told(watch=True)
    assert "  2/2 a - c: not certifiable (0.25 s)" in paper.lines
    assert paper.last == "iteration 1: 1 of 1 pairs settled, a - c: certified"
    assert paper.part == 1.0


class Silent:
    """A client of a service that says nothing of a job until its status was asked for a few times."""

    def __init__(self, *status: str) -> None:
        self._left, self._asked = list(status), Event()

    def job_pairs(self, _job: str, iteration: int) -> dict[str, Any]:
        return {"pairs": []}

    def job(self, _job: str) -> dict[str, Any]:
        status = self._left.pop(0) if len(self._left) > 1 else self._left[0]
        if len(self._left) == 1:
            self._asked.set()
        return {"status": status}

    def events(self, _job: str) -> Iterator[dict[str, Any]]:
        assert self._asked.wait(10)
        yield {"kind": "job", "data": {"state": "running"}}


def test_what_a_silent_job_waits_for_is_in_the_status_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following, "SILENT_S", 0.0)
    monkeypatch.setattr(following, "LOOK_S", 0.01)
    said: list[str] = []
    paper = Paper()
    monkeypatch.setattr(paper, "status", lambda text, part=None: said.append(text))
    following.follow(
        cast(Client, Silent("queued: no worker", "working", "queued: the queue does not answer", "working")), "j", paper, False
    )
    assert said == ["job queued: no worker", "job queued: the queue does not answer", "job running"]
