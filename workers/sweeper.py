"""The sweeper finds work that was lost with a worker, a message or Redis itself, and sends it again. Then it tidies up.

It runs beside the control worker. Several sweepers, or one that is late, do no harm.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from typing import Any

from kombu.exceptions import OperationalError
from sqlalchemy.exc import DBAPIError, TimeoutError
from sqlalchemy.orm import Session

from db import audit, clock, events, jobs, keys, leases, pairs, projects, retention, sessions, work, workers
from db.models import JobRow, PairRow, StepRow
from db.session import database
from db.settings import settings
from db.transaction import writing
from db.types import utcnow
from workers.app import CONTROL, SOLVE, send_coordinate, send_work, waiting
from workers.troubles import Troubles
from workers.turns import coordinate

log = logging.getLogger(__name__)

ASKED = 100
"""While this many messages wait for the control worker, it is asked for nothing more: it may be paused, and what is due stays due."""


def run(stop: threading.Event, troubles: Troubles) -> None:
    """Sweeps and tidies up until ``stop`` is set. What fails (the database or Redis is away) is tried again in the next round."""
    holders = Holders()
    while not stop.wait(settings().sweep_seconds):
        do_round(holders, troubles)


def do_round(holders: Holders, troubles: Troubles) -> None:
    """Does one round. What fails in it keeps nothing else from being done."""
    if database().disk.trouble():
        holders.could_not_write()
    with troubles.noting("the sweep"):
        try:
            sweep(by_time=holders.could_renew(utcnow()))
            troubles.note(workers.REACHING_QUEUE, None)
        except OperationalError as error:
            log.warning("Redis cannot be reached; nothing was sent again: %s", error)
            troubles.note(workers.REACHING_QUEUE, "it does not answer")
            end_late()
        except (DBAPIError, TimeoutError):
            holders.could_not_write()
            raise
    # What tidying up fails at says nothing about the holders of leases.
    chores = {
        "forgetting workers": forget_gone,
        "forgetting keys": forget_keys,
        "forgetting sessions": forget_sessions,
        "forgetting what was done long ago": forget_audit,
        "expiry": expire,
        "giving room back": shrink,
    }
    for what, chore in chores.items():
        with troubles.noting(what):
            chore()


class Holders:
    """Tracks whether the holders of leases could renew them.

    They could not while the database was away or had no room, or while this machine slept.
    """

    def __init__(self) -> None:
        self._since = self._last = utcnow()

    def could_renew(self, now: datetime) -> bool:
        """Says whether a lease that ran out by ``now`` ran out because its holder did not renew it. Every round must ask this."""
        lease = timedelta(seconds=settings().lease_seconds)
        if now - self._last > lease / 2:
            self._since = now
        self._last = now
        return now - self._since >= lease

    def could_not_write(self) -> None:
        self._since = self._last


def sweep(*, by_time: bool = True) -> None:
    """Does one round: it frees what lost workers held, or others need, wakes a solver when work has no message, and asks for due
    coordinations."""
    release_lost(by_time=by_time)
    give_way()
    with database().read() as session:
        due = jobs.awaiting_coordination(session, clock.now(session))
        is_open = work.is_there(session)
    for job_id in due[: max(ASKED - waiting(CONTROL), 0)]:
        send_coordinate(job_id)
    if is_open and waiting(SOLVE) == 0:
        send_work()


def end_late() -> None:
    """Ends jobs that are to end, without a message: they wait for no worker, and their deadline does not wait for Redis."""
    with database().read() as session:
        ids = jobs.to_end(session, clock.now(session))
    for job_id in ids[:ASKED]:
        coordinate(job_id)


def forget_gone() -> None:
    """Deletes the rows of workers that have ended without a word."""
    with database().read() as session:
        ids = workers.gone(session)
    if ids:
        with database().write() as session:
            workers.forget(session, ids)


def forget_keys() -> None:
    """Deletes some of the keys that were revoked long ago."""
    with database().read() as session:
        ids = keys.forgettable(session, utcnow())
    if ids:
        with database().write() as session:
            keys.forget(session, ids)


def forget_sessions() -> None:
    """Deletes some of the sessions that have expired."""
    with database().read() as session:
        ids = sessions.forgettable(session, utcnow())
    if ids:
        with database().write() as session:
            sessions.forget(session, ids)


def forget_audit() -> None:
    """Deletes some of the lines of the audit log that are too old."""
    with database().read() as session:
        old = audit.forgettable(session, utcnow())
    if old:
        with database().write() as session:
            audit.forget(session, utcnow())


def expire() -> None:
    """Deletes some of what has expired."""
    with database().read() as session:
        keeps = projects.some_expires(session)
    if keeps:
        with database().write() as session:
            retention.expire(session, utcnow())


def shrink() -> None:
    """Gives room that the database does not use back to the disk."""
    database().shrink()


def release_lost(*, by_time: bool) -> None:
    """Opens the rows of workers that died or, with ``by_time``, did not renew their leases. The jobs' events say why."""
    with database().read() as session:
        of_pairs = leases.lost(session, PairRow, by_time=by_time)
        of_steps = leases.lost(session, StepRow, by_time=by_time)
    for lease in of_pairs:
        _release(lease, pairs.release)
    for lease in of_steps:
        _release(lease, _release_step)


def give_way() -> None:
    """Opens a step that is to be given up. Its holder notices that within seconds, and ends itself (leases.kept)."""
    with database().read() as session:
        lease = work.to_give_up(session)
    if lease is not None:
        give_up(lease)


def give_up(lease: leases.Lost) -> None:
    """Opens a step that its holder does not do to its end."""
    _release(lease, _release_step)


def _release_step(session: Session, _job: JobRow, lease: leases.Lost) -> Sequence[StepRow]:
    return leases.release(session, StepRow, lease)


def _release(lease: leases.Lost, release: Callable[[Session, JobRow, leases.Lost], Sequence[PairRow] | Sequence[StepRow]]) -> None:
    with writing() as (session, afterwards):
        job = jobs.lock(session, lease.job_id)
        if rows := release(session, job, lease):
            events.emit(session, job, "lost", {"worker": lease.worker, "reason": lease.reason, **_what(rows)})
            afterwards.append(send_work)


def _what(rows: Sequence[PairRow] | Sequence[StepRow]) -> dict[str, Any]:
    first = rows[0]
    if isinstance(first, StepRow):
        return {"step": first.kind}
    return {"iteration": first.iteration, "pairs": [row.pair_index for row in rows if isinstance(row, PairRow)]}
