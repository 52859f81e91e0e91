"""What a process without a slot (workers.slots) does: pieces of new jobs, while all others do work that may last long.

So a small job gets a process at once although a hundred long ones run. The operating system shares the cores between this process and
the others, which lose no work: each keeps more than half of a core. What a child process does for a new job is given up when it lasts
long and another new job waits. It begins anew when it is its turn. Other work for a new job goes on to its end.
"""

from __future__ import annotations

import time
from contextlib import suppress

from db import leases, pairs, steps, work, workers
from db.session import UNAVAILABLE, database
from db.settings import settings
from db.states import WorkerState
from jobs.kind import GivesWay, giving_way
from workers.app import send_work
from workers.slots import Slots
from workers.solver import Piece, do

WAIT_SECONDS = 10.0
"""A process without a slot waits this long for a new job. Then the next message has it wait again."""
LOOK_SECONDS = 0.25
"""It looks this often whether one is there."""
TRIAL_SECONDS = 1.0
"""A child's work for a new job may last this many seconds. Then it goes on only as long as no other new job comes before it: a newer one,
or one of a key or project for which fewer processes work."""


def work_for_newcomer(slots: Slots) -> Piece | None:
    """Does a piece of a new job, waiting for one while no slot is free. It returns None when there was none."""
    send_work()  # what the message was about is there for others
    until = time.monotonic() + WAIT_SECONDS
    while time.monotonic() < until and not slots.take():
        if (claim := _claim()) is not None:
            with giving_way(_Trial(slots, claim.job_id)):
                return do(claim)
        time.sleep(LOOK_SECONDS)
    return None


def _claim() -> pairs.Claim | steps.Claim | None:
    """Claims a piece of the new job whose turn it is, unless this worker is to pause or to end."""
    if database().disk.trouble():
        return None
    with database().read() as session:
        job_id = work.newcomer(session)
        if job_id is None or workers.wanted(session, leases.parent_worker()) not in (None, WorkerState.RUNNING):
            return None
    limits = settings()
    with database().write() as session:
        return work.claim(session, job_id, lease_seconds=limits.lease_seconds, batch_seconds=limits.batch_seconds, fresh=True)


class _Trial:
    """Gives a step of a job up that has lasted when another new job waits. Once a slot is free, the step is work like any other."""

    def __init__(self, slots: Slots, job_id: str) -> None:
        self._slots, self._job_id, self._until = slots, job_id, time.monotonic() + TRIAL_SECONDS

    def __call__(self) -> None:
        if self._slots.take() or time.monotonic() < self._until:
            return
        waits = False
        with suppress(*UNAVAILABLE), database().read() as session:  # an outage is no reason to give anything up
            waits = work.newcomer(session, instead_of=self._job_id) is not None
        if waits:
            raise GivesWay
