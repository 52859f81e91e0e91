"""What the page of a job says before the first iteration: what runs, and for how long."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from api.pages.rendering import templates
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
    assert waits.strip() == '<p class="empty">Queued: no worker.</p>', "nobody does any of that"
