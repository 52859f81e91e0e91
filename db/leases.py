"""Leases: one holder at a time for a row of work, for a limited time, however often its message is delivered.

A holder renews its lease while it lives. A lease of another host is over when it ran out; one of this host as soon as its
process is gone, and not before (one long call into native code may keep it from renewing).
"""

from __future__ import annotations

import logging
import os
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime, timedelta
from pathlib import Path
from typing import TypeVar
from uuid import uuid4

from sqlalchemy import ColumnElement, select, update
from sqlalchemy.orm import Session

from db.models import PairRow, StepRow
from db.session import Database
from db.states import PairState, transition
from db.types import utcnow

log = logging.getLogger(__name__)

Row = TypeVar("Row", PairRow, StepRow)
OPEN, RUNNING = PairState.OPEN.value, PairState.RUNNING.value
"""Pairs and steps share these two states."""


def this_worker() -> str:
    """This process, as ``host:pid:start``; the start tells it from a later process with the same number."""
    return f"{socket.gethostname()}:{os.getpid()}:{_started(os.getpid())}"


def is_alive(worker: str | None) -> bool | None:
    """Whether that worker lives; None when it is not of this host, so that nobody here can tell."""
    host, pid, started = (worker or "::").rsplit(":", 2)
    return _started(int(pid)) == started if host == socket.gethostname() else None


def _started(pid: int) -> str | None:
    """When the process began, in the kernel's ticks ("alive" where there is no /proc); None when it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return None if fields[0] in "ZX" else fields[19]
    except OSError:
        pass
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return None
    except PermissionError:
        pass
    return "alive"


def is_free(row: Row, now: datetime) -> bool:
    """Whether the row may be claimed: open, or held by nobody any more."""
    if row.state != RUNNING:
        return row.state == OPEN
    alive = is_alive(row.worker)
    return alive is False or (alive is None and (row.lease_until is None or row.lease_until < now))


def take(session: Session, model: type[Row], rows: Sequence[Row], *, task_id: str | None, seconds: float) -> str:
    """Claims rows that :func:`is_free` (the caller holds their job's lock) and counts the attempt. Returns the lease's token."""
    token, now = str(uuid4()), utcnow()
    if left := [row.id for row in rows if row.state == RUNNING]:
        transition(session, model, OPEN, model.id.in_(left))
    transition(
        session,
        model,
        RUNNING,
        model.id.in_([row.id for row in rows]),
        attempts=model.attempts + 1,
        worker=this_worker(),
        task_id=task_id,
        lease_token=token,
        lease_until=now + timedelta(seconds=seconds),
    )
    return token


def held(model: type[Row], token: str) -> ColumnElement[bool]:
    """Condition: the row is still held under this token."""
    return (model.lease_token == token) & (model.state == RUNNING)


@contextmanager
def renewed(database: Database, model: type[Row], token: str, seconds: float) -> Iterator[None]:
    """Renews the lease four times in its length while the block runs."""
    done = threading.Event()

    def renew() -> None:
        while not done.wait(seconds / 4):
            try:
                with database.write() as session:
                    until = utcnow() + timedelta(seconds=seconds)
                    session.execute(update(model).where(held(model, token)).values(lease_until=until))
            except Exception:
                log.exception("a lease could not be renewed; trying again")

    thread = threading.Thread(target=renew, name="lease", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def lost(session: Session, model: type[Row]) -> list[tuple[str, str]]:
    """The (job, token) of the leases whose holder is gone."""
    now = utcnow()
    running = session.scalars(select(model).where(model.state == RUNNING))
    return sorted({(row.job_id, row.lease_token or "") for row in running if is_free(row, now)})


def release(session: Session, model: type[Row], token: str) -> list[Row]:
    """Opens the rows held under this token and returns them; whoever held them can save nothing any more."""
    ids = list(session.scalars(select(model.id).where(held(model, token))))
    transition(session, model, OPEN, held(model, token), sent_at=utcnow())
    return list(session.scalars(select(model).where(model.id.in_(ids), model.state == OPEN)))


def unclaimed(session: Session, model: type[Row], sent_before: datetime) -> list[str]:
    """The jobs with open rows that were last sent before then."""
    return list(session.scalars(select(model.job_id).distinct().where(model.state == OPEN, model.sent_at < sent_before)))


def resend(session: Session, model: type[Row], job_id: str, sent_before: datetime) -> list[Row]:
    """The job's open rows that were last sent before then, now marked as sent again."""
    where = (model.job_id == job_id, model.state == OPEN, model.sent_at < sent_before)
    rows = list(session.scalars(select(model).where(*where)))
    session.execute(update(model).where(model.id.in_([row.id for row in rows])).values(sent_at=utcnow()))
    return rows
