"""Deadlines end jobs with what they have, or say that nobody began, by calls in this process, on both databases."""

from __future__ import annotations

import re
from dataclasses import asdict, replace
from functools import partial

import pytest
from kombu.exceptions import OperationalError as QueueError

from certifier.map.options import MapOptions
from certifier.outcome import Outcome
from certifier.seeding.proposal import NO_ROOM
from db import activity, jobs, leases, steps, workers
from db.session import database
from db.states import WorkerState
from db.workers import Made, WorkerKind
from jobs import growing
from tests.scenes import slider
from tests.workers.options import box_around
from tests.workers.service import environment, events_of, job_of, submit
from tests.workers.turning import WHOLE, late, raise_
from workers import sweeper
from workers.solver import Piece, claim_piece, work
from workers.steps import carry_out
from workers.troubles import Troubles
from workers.turns import coordinate

pytestmark = pytest.mark.usefixtures("here")


def check_not_begun(job_id: str) -> None:
    job = job_of(job_id)
    assert (job.state, job.outcome, (job.error or {}).get("code")) == ("failed", Outcome.ERROR, "not_begun")
    assert job.reason == "the deadline was reached before a worker had done anything"


@pytest.mark.parametrize("begun", [False, True], ids=["nobody decided", "nobody worked"])
@pytest.mark.parametrize("asked", ["certify", "grow", "map"])
def test_a_job_that_nobody_began_by_its_deadline_has_failed(asked: str, begun: bool) -> None:
    options = {"certify": box_around([0.0], 0.1), "grow": WHOLE, "map": asdict(MapOptions()) | {"former": None}}[asked]
    job_id = submit(slider(posts=3), options, kind=asked)
    if begun:
        coordinate(job_id)
    late(job_id)
    coordinate(job_id)
    check_not_begun(job_id)


def test_a_map_whose_first_process_comes_after_the_deadline_has_failed() -> None:
    job_id = submit(slider(), asdict(MapOptions()) | {"former": None}, kind="map")
    coordinate(job_id)
    with database().write() as session:
        claim = steps.claim(session, jobs.lock(session, job_id), accepts=False, lease_seconds=60)
    assert claim is not None
    late(job_id)
    carry_out(claim)
    coordinate(job_id)
    check_not_begun(job_id)


def test_without_a_queue_deadlines_hold_and_it_is_said_that_it_is_away(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    cancelled, goes_on, troubles = submit(slider(), WHOLE), submit(slider(), WHOLE), Troubles()
    coordinate(cancelled)
    late(job_id)
    made = Made(leases.this_worker(), WorkerKind.CONTROL, "1", 1, cores=1, memory_bytes=1)
    with database().write() as session:
        jobs.cancel(session, cancelled)
        workers.tell(session, replace(made, process="host:1:1", kind=WorkerKind.SOLVE), WorkerState.RUNNING)

    def said() -> str:
        with database().write() as session:
            workers.tell(session, made, WorkerState.RUNNING, troubles.said())
            return activity.of_jobs(session, [jobs.get(session, goes_on)])[goes_on]

    with monkeypatch.context() as away:
        away.setattr(sweeper, "waiting", partial(raise_, QueueError("Timeout reading from socket")))
        sweeper.do_round(sweeper.Holders(), troubles)
    check_not_begun(job_id)
    assert (job_of(cancelled).state, job_of(goes_on).state) == ("cancelled", "queued")
    assert (troubles.said(), said()) == ("reaching the queue failed: it does not answer", "queued: the queue does not answer")
    sweeper.do_round(sweeper.Holders(), troubles)
    assert (troubles.said(), said()) == (None, "queued: next")


def test_a_deadline_ends_the_job_with_what_it_has(job_id: str) -> None:
    with environment(CIRIS_BATCH_SECONDS="1e-9"):
        assert work() == Piece(job_id, False)
    late(job_id)
    coordinate(job_id)
    job = job_of(job_id)
    assert (job.state, job.outcome, job.reason) == ("succeeded", Outcome.INCONCLUSIVE, "the deadline was reached")


def test_what_hinders_a_proposal_is_told_and_explains_a_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "NOTE_S", 0.0)
    hindrance = f"the seed is 0.03 mm from contact of a and b{NO_ROOM}"
    job_id = submit(slider(), {"kind": "grow", "seed": {"q": [0.0]}})
    tell = growing._noting(job_id)
    tell({})
    assert "note" not in [event.kind for event in events_of(job_id)], "it waits for a worker"
    coordinate(job_id)
    tell({"faces": 31})
    note = events_of(job_id)[-1].data
    assert re.fullmatch(r"proposing, \d+ s, 31 faces", note.pop("text"))
    assert note == {"part": None, "faces": 31}
    tell({"faces": 31, "hindrance": hindrance})
    assert claim_piece()[0] is not None
    late(job_id)
    coordinate(job_id)
    assert (job_of(job_id).error or {})["message"] == f"the deadline was reached; {hindrance}"
    count = len(events_of(job_id))
    tell({})
    assert len(events_of(job_id)) == count, "the job has ended"


def test_a_cover_hears_of_the_proposals_of_its_regions(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "NOTE_S", 0.0)
    child = submit(slider(), {"kind": "grow", "seed": {"q": [0.0]}}, parent_id=job_id, number=2)
    coordinate(child)
    growing._noting(child)({"faces": 1})
    assert events_of(job_id)[-1].data == {"text": "region 2: proposing, 0 s, 1 face", "part": None}
