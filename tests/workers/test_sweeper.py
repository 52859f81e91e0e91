"""The sweeper takes back what lost workers held, and sends lost messages again, on both databases."""

from __future__ import annotations

from datetime import timedelta
from functools import partial
from operator import add

import pytest
from sqlalchemy import update
from sqlalchemy.exc import OperationalError

from db import jobs, pairs
from db.models import JobRow, PairRow
from db.session import database
from db.types import utcnow
from tests.scenes import slider
from tests.services import Queue
from tests.workers.options import box_around
from tests.workers.service import events_of, job_of, pairs_of, submit
from tests.workers.turning import ELSEWHERE, Away, raise_, work_all
from workers import sweeper
from workers.app import CONTROL, SOLVE, send_coordinate, waiting
from workers.troubles import Troubles

pytestmark = pytest.mark.usefixtures("here")


def test_the_sweeper_sends_lost_messages_again(job_id: str, own_queue: Queue) -> None:
    own_queue.flush()
    sweeper.sweep()
    assert waiting(SOLVE) == 1
    sweeper.sweep()
    assert waiting(SOLVE) == 1
    work_all()
    own_queue.flush()
    sweeper.sweep()
    assert (waiting(SOLVE), waiting(CONTROL)) == (0, 1)


def test_a_paused_control_worker_is_asked_so_often_and_no_more(own_queue: Queue, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweeper, "ASKED", 3)
    for _ in range(5):
        submit(slider(), box_around([0.0], 0.1))
    own_queue.flush()
    for _ in range(4):
        sweeper.sweep()
        assert waiting(CONTROL) == 3


def test_the_sweeper_frees_what_a_lost_worker_held_and_says_why(job_id: str) -> None:
    with database().write() as session:
        pairs.claim(session, jobs.lock(session, job_id), lease_seconds=60, batch_seconds=60)
        gone = {"worker": ELSEWHERE, "lease_until": utcnow() - timedelta(seconds=1), "lease_token": "gone"}
        session.execute(update(PairRow).where(PairRow.pair_index == 0).values(gone))
    sweeper.sweep(by_time=False)
    assert [row.state for row in pairs_of(job_id)] == ["running"] * 3
    sweeper.sweep()
    assert [row.state for row in pairs_of(job_id)] == ["open", "running", "running"]
    assert waiting(SOLVE) == 2
    lost = events_of(job_id)[-1]
    assert (lost.kind, lost.data) == ("lost", {"worker": ELSEWHERE, "reason": "its lease ran out", "iteration": 0, "pairs": [0]})


def test_leases_are_not_ended_by_time_right_after_nobody_could_renew_them() -> None:
    holders, now = sweeper.Holders(), utcnow()

    def could_renew(*after: float) -> list[bool]:
        return [holders.could_renew(now + timedelta(seconds=seconds)) for seconds in after]

    assert could_renew(20, 40, 61) == [False, False, True]
    assert could_renew(200, 220, 240, 261) == [False, False, False, True]
    holders.could_not_write()
    assert could_renew(262) == [False]


def lose_a_lease(job_id: str) -> None:
    """A worker of another machine holds all pairs, and its leases have run out."""
    with database().write() as session:
        pairs.claim(session, jobs.lock(session, job_id), lease_seconds=60, batch_seconds=60)
        session.execute(update(PairRow).values(worker=ELSEWHERE, lease_until=utcnow() - timedelta(seconds=1)))


@pytest.mark.parametrize("chore", ["forget_gone", "forget_keys", "forget_sessions", "forget_audit", "expire", "shrink"])
def test_tidying_up_that_fails_keeps_nothing_from_being_taken_back(job_id: str, monkeypatch: pytest.MonkeyPatch, chore: str) -> None:
    done = []

    def fails() -> None:
        done.append(chore)
        raise OverflowError

    for name in ("forget_gone", "forget_keys", "forget_sessions", "forget_audit", "expire", "shrink"):
        monkeypatch.setattr(sweeper, name, fails if name == chore else partial(done.append, name))
    holders, troubles, now = sweeper.Holders(), Troubles(), utcnow()
    lose_a_lease(job_id)
    for seconds in range(0, 61, 20):
        assert {row.state for row in pairs_of(job_id)} == {"running"}, "their holders may renew them"
        monkeypatch.setattr(sweeper, "utcnow", partial(add, now, timedelta(seconds=seconds)))
        sweeper.do_round(holders, troubles)
    assert {row.state for row in pairs_of(job_id)} == {"open"}
    assert sorted(done) == sorted(["forget_gone", "forget_keys", "forget_sessions", "forget_audit", "expire", "shrink"] * 4)
    assert (troubles.said() or "").endswith("failed: OverflowError")
    monkeypatch.setattr(sweeper, chore, list)
    sweeper.do_round(holders, troubles)
    assert troubles.said() is None


def test_a_database_that_is_away_for_the_sweep_takes_no_lease_back(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    holders, troubles, now = sweeper.Holders(), Troubles(), utcnow()
    lose_a_lease(job_id)
    for seconds in range(0, 61, 20):
        with monkeypatch.context() as away:
            away.setattr(sweeper, "utcnow", partial(add, now, timedelta(seconds=seconds)))
            if seconds == 40:
                away.setattr(sweeper, "release_lost", partial(raise_, OperationalError("SELECT 1", {}, Away())))
            sweeper.do_round(holders, troubles)
        assert (troubles.said() is not None) == (seconds == 40)
    assert {row.state for row in pairs_of(job_id)} == {"running"}


def test_without_redis_a_job_is_kept_and_sent_by_the_sweeper(own_queue: Queue) -> None:
    own_queue.stop()
    try:
        job_id = submit(slider(), box_around([0.0], 0.1))
        assert not send_coordinate(job_id)
        assert job_of(job_id).state == "queued"
    finally:
        own_queue.start()
    own_queue.flush()
    sweeper.sweep()
    assert waiting(CONTROL) == 1
    with database().read() as session:
        assert session.get(JobRow, job_id) is not None
