"""What the page of a job says before the first iteration: what runs, and for how long."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from api.pages.rendering import templates
from db.activity import COMPILING, STALLED, STARTING
from jobs.registry import KINDS


@pytest.mark.parametrize(
    ("kind", "note", "said"),
    [
        ("grow", None, "Looking for a starting region around the seed."),
        ("grow", "proposing, 40 s, 31 faces", "Looking for a starting region around the seed (proposing, 40 s, 31 faces)."),
        ("certify", None, "Getting ready to certify."),
        ("recertify", None, "Getting ready to certify."),
        ("certify-path", None, "Certifying the motion."),
        ("map", None, "Taking samples of the configurations."),
        ("map", "62.1 % of the free configurations proved, 5 cells", "62.1 % of the free configurations proved, 5 cells."),
        ("cover", "region 0: proposing, 40 s", "Region 0: proposing, 40 s."),
        ("cover", None, ""),
    ],
)
def test_a_job_that_runs_says_what_it_does(kind: str, note: str | None, said: str) -> None:
    part = templates.env.get_template(KINDS[kind].template).module
    text = str(part.waits(SimpleNamespace(kind=kind, status="working"), note))
    assert text.strip().removeprefix('<p class="empty">').removesuffix("</p>") == said
    waits = str(part.waits(SimpleNamespace(kind=kind, status="queued: no worker"), note))
    assert '<a href="/workers">' in waits, "nobody does any of that, and the page tells who may be asked"
    assert said not in waits or not said


@pytest.mark.parametrize(
    ("status", "itself"),
    [
        ("queued: no worker", False),
        ("queued: no control worker", False),
        ("queued: all workers paused", False),
        ("queued: all control workers paused", False),
        ("queued: the queue does not answer", False),
        (f"queued: {STARTING}", True),
        (f"queued: {COMPILING}", True),
        ("queued: next", True),
        ("queued: behind 3 others", True),
        (STALLED, True),
    ],
)
def test_a_job_that_waits_says_whether_it_goes_on_by_itself(status: str, itself: bool) -> None:
    """The status stands above; it is not said twice."""
    text = str(templates.env.get_template("macros.html").module.waiting(status))
    assert ("by itself" in text) == itself
    assert status.partition(": ")[2] not in text
