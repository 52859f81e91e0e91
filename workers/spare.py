"""What a process without a slot (workers.slots) does: pieces of new jobs, while all others do work that may last long.

So a small job gets a process at once although a hundred long ones run. The operating system shares the cores between this process and
the others, which lose no work: each keeps more than half of a core. What a child process does for a new job is given up when it lasts
long and another new job waits. It begins anew when it is its turn. Other work for a new job goes on to its end.

While no new job waits, the process accepts regions, whatever job they are of. So planners have a region although all others do long
work. This is given up as well when it lasts long and a new job waits, and is left to the others then.
"""

from __future__ import annotations

import logging
import time
from contextlib import nullcontext

from sqlalchemy.orm import Session

from db import leases, pairs, steps, work, workers
from db.session import UNAVAILABLE, database
from db.settings import settings
from db.states import ACCEPT, WorkerState
from jobs.kind import GivesWay, giving_way
from workers.app import send_work
from workers.slots import Slots
from workers.solver import Piece, do

log = logging.getLogger(__name__)

WAIT_SECONDS = 10.0
"""A process without a slot waits this long for work. Then the next message has it wait again."""
LOOK_SECONDS = 0.25
"""It looks this often whether some is there, and at most this often whether it is to give up what it does."""
TRIAL_SECONDS = 1.0
"""A child's work for a new job may last this many seconds. Then it goes on only as long as no other new job comes before it: a newer one,
or one of a key or project for which fewer processes work. A region that it accepts has as long, and then gives way to any new job."""


def work_for_newcomer(slots: Slots) -> Piece | None:
    """Does a piece of a new job, else accepts a region, waiting for one while no slot is free. It returns None when there was none."""
    send_work()  # what the message was about is there for others
    until = time.monotonic() + WAIT_SECONDS
    while time.monotonic() < until and not slots.take():
        claim, is_new = _claim()
        if claim is not None:
            to_its_end = is_new and isinstance(claim, steps.Claim) and claim.kind == ACCEPT
            with nullcontext() if to_its_end else giving_way(_Trial(slots, claim.job_id, is_new)):
                return do(claim)
        time.sleep(LOOK_SECONDS)
    return None


def _claim() -> tuple[pairs.Claim | steps.Claim | None, bool]:
    """Claims a piece of the new job whose turn it is, else a region to accept, unless this worker is to pause or to end.

    It also says whether it is of a new job.
    """
    with database().read() as session:
        new = work.newcomer(session)
        job_id = new or work.to_accept(session)
        if job_id is None or not _takes_work(session):
            return None, False
    limits = settings()
    with database().write() as session:
        if new is None:
            return work.claim_region(session, job_id, lease_seconds=limits.lease_seconds), False
        return work.claim(session, new, lease_seconds=limits.lease_seconds, batch_seconds=limits.batch_seconds, fresh=True), True


def _takes_work(session: Session) -> bool:
    """Says whether the disk has room for what this process would save, and its worker is neither to pause nor to end."""
    return not database().disk.trouble() and workers.wanted(session, leases.parent_worker()) in (None, WorkerState.RUNNING)


class _Trial:
    """Gives a step up that has lasted when another new job waits. Once a slot is free, the step is work like any other.

    Args:
        is_new: whether the step is of a new job; otherwise it accepts a region.
    """

    def __init__(self, slots: Slots, job_id: str, is_new: bool) -> None:
        self._slots, self._job_id, self._is_new, self._until = slots, job_id, is_new, time.monotonic() + TRIAL_SECONDS

    def __call__(self) -> None:
        if self._slots.take() or time.monotonic() < self._until:
            return
        waits = False
        try:
            with database().read() as session:
                waits = work.newcomer(session, instead_of=self._job_id, accepts=not self._is_new) is not None and _takes_work(session)
        except UNAVAILABLE:
            pass  # an outage is no reason to give anything up
        except Exception:
            log.exception("whether new jobs wait could not be said; the step goes on")
        if waits:
            raise GivesWay
        self._until = time.monotonic() + LOOK_SECONDS
