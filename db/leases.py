"""A lease gives a row of work to one holder at a time, for a limited time, however often the row's message is delivered.

A holder renews its lease while it works. A lease ends when its holder is seen to be gone, which only processes of the same host can
see, or else when it runs out by the database's clock.
"""

from __future__ import annotations

import hashlib
import logging
import os
import signal
import socket
import threading
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from functools import cache
from pathlib import Path
from typing import TypeVar
from uuid import uuid4

from sqlalchemy import BindParameter, ColumnElement, Select, bindparam, func, select, update
from sqlalchemy.orm import Session

from db import clock
from db.models import JobRow, PairRow, StepRow
from db.session import Database
from db.states import PairState, transition

log = logging.getLogger(__name__)

Row = TypeVar("Row", PairRow, StepRow)
OPEN, RUNNING = PairState.OPEN.value, PairState.RUNNING.value
"""Pairs and steps share these two states."""

LOOK_SECONDS = 0.5
"""A holder checks each time this many seconds have passed whether its work is still wanted. Two checks in a row that say no end it."""


def this_worker() -> str:
    """Returns the name of this process, ``host:pid:start``. The start time tells it from a later process with the same number."""
    return name_of(os.getpid())


def parent_worker() -> str:
    """Returns the name of the process that has forked this one."""
    return name_of(os.getppid())


def is_alive(worker: str | None) -> bool | None:
    """Says whether that worker lives; None when it is on another host, where this process cannot look."""
    host, pid, started = (worker or "::").rsplit(":", 2)
    return _started(int(pid)) == started if host == _host() else None


def died_alone(worker: str | None, parent: str | None) -> bool:
    """Says whether that worker has died while the process that had forked it lives, as far as this host can tell."""
    return is_alive(worker) is False and is_alive(parent) is True


def name_of(pid: int) -> str:
    """Returns the name of a process of this host."""
    return f"{_host()}:{pid}:{_started(pid)}"


@cache
def _host() -> str:
    """Returns this host's name with a mark of the place where its process numbers are valid.

    Containers and clones of a machine may share the host's name, but not the mark.
    """
    try:
        place = Path("/proc/sys/kernel/random/boot_id").read_text() + os.readlink("/proc/self/ns/pid")
    except OSError:
        return socket.gethostname()
    return f"{socket.gethostname()}.{hashlib.sha256(place.encode()).hexdigest()[:8]}"


def _started(pid: int) -> str | None:
    """Returns when the process began, in the kernel's ticks ("alive" where there is no /proc); None when it is gone."""
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


def take(session: Session, model: type[PairRow] | type[StepRow], ids: Sequence[int], *, seconds: float) -> str:
    """Claims open rows, counts the attempt, and returns the lease's token. The caller holds the lock of their job."""
    token, now = str(uuid4()), clock.now(session)
    transition(
        session,
        model,
        RUNNING,
        model.id.in_(ids),
        attempts=model.attempts + 1,
        worker=this_worker(),
        parent=parent_worker(),
        lease_token=token,
        lease_since=now,
        lease_until=now + timedelta(seconds=seconds),
    )
    return token


def held(model: type[Row], token: str | BindParameter[str]) -> ColumnElement[bool]:
    """Returns the condition that a row is still held under this token."""
    return (model.lease_token == token) & (model.state == RUNNING)


@contextmanager
def kept(database: Database, model: type[Row], token: str, seconds: float, job_states: Collection[str]) -> Iterator[None]:
    """Renews the lease while the block runs. It kills this process when the work is not wanted any more.

    The work is wanted while some row is held under the token and the job is in one of ``job_states``. The block may be deep in native
    code, which only a signal that cannot be caught can end. The killed process could not have saved its results anyway.
    """
    done = threading.Event()

    def keep() -> None:
        looks, refused = 0, 0
        while not done.wait(LOOK_SECONDS):
            looks += 1
            try:
                refused = 0 if _is_wanted(database, model, token, job_states) else refused + 1
                if looks * LOOK_SECONDS >= seconds / 4:
                    _renew(database, model, token, seconds)
                    looks = 0
            except Exception:
                log.exception("the lease could not be looked after; trying again")
            if refused > 1 and not done.is_set():
                log.warning("what this process works on is not wanted any more: it ends itself")
                os.kill(os.getpid(), signal.SIGKILL)

    thread = threading.Thread(target=keep, name="lease", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def _is_wanted(database: Database, model: type[Row], token: str, job_states: Collection[str]) -> bool:
    with database.read() as session:
        return session.scalar(_wanted(model), {"token": token, "job_states": list(job_states)}) is not None


@cache
def _wanted(model: type[Row]) -> Select[int]:
    """Returns the query for rows held under a token, of a job in one of some states. It is built once, because it runs so often."""
    in_time = JobRow.state.in_(bindparam("job_states", expanding=True))
    return select(model.id).join(JobRow, JobRow.id == model.job_id).where(held(model, bindparam("token")), in_time).limit(1)


def _renew(database: Database, model: type[Row], token: str, seconds: float) -> None:
    with database.write() as session:
        until = clock.now(session) + timedelta(seconds=seconds)
        session.execute(update(model).where(held(model, token)).values(lease_until=until))


@dataclass(frozen=True)
class Lost:
    """A lost lease is over before its work was done, and ``reason`` says why.

    Attributes:
        alone: True when the holder died and the process that had forked it lives.
    """

    job_id: str
    token: str
    worker: str
    reason: str
    alone: bool


def lost(session: Session, model: type[Row], *, by_time: bool) -> list[Lost]:
    """Returns the leases whose holder is gone and, with ``by_time``, those that ran out."""
    now = clock.now(session)
    found = {}
    for row in session.scalars(select(model).where(model.state == RUNNING)):
        alone = False
        if is_alive(row.worker) is False:
            alone = died_alone(row.worker, row.parent)
            reason = "its process died" if alone else "its worker ended"
        elif by_time and row.lease_until is not None and row.lease_until < now:
            reason = "its lease ran out"
        else:
            continue
        found[row.lease_token] = Lost(row.job_id, row.lease_token or "", row.worker or "", reason, alone)
    return list(found.values())


def of_job(session: Session, model: type[Row], job_id: str) -> Sequence[Row]:
    """Returns the rows of a job that are held now, in their order."""
    return session.scalars(select(model).where(model.job_id == job_id, model.state == RUNNING).order_by(model.id)).all()


def of_workers(session: Session, model: type[Row], processes: Collection[str]) -> Sequence[Row]:
    """Returns the rows that processes of these workers hold now, as far as the session's project has them, in their order."""
    jobs = select(model).join(JobRow, JobRow.id == model.job_id)  # which leaves out what belongs to other projects
    return session.scalars(jobs.where(model.state == RUNNING, model.parent.in_(processes)).order_by(model.id)).all()


def count_of_workers(session: Session) -> Counter[str]:
    """Returns how many leases the processes of each worker hold, by the worker's process, whatever the project."""
    counts: Counter[str] = Counter()
    for model in (PairRow, StepRow):
        held = select(model.parent, func.count(model.lease_token.distinct())).where(model.state == RUNNING).group_by(model.parent)
        counts.update({parent or "": count for parent, count in session.execute(held)})
    return counts


def count_of_keys(session: Session) -> Counter[tuple[str, str | None]]:
    """Returns how many leases work of each API key is held under, by (project, key)."""
    counts: Counter[tuple[str, str | None]] = Counter()
    for model in (PairRow, StepRow):
        held = select(JobRow.project, JobRow.key_id, func.count(model.lease_token.distinct())).join(JobRow, JobRow.id == model.job_id)
        held = held.where(model.state == RUNNING).group_by(JobRow.project, JobRow.key_id)
        counts.update({(project, key_id): count for project, key_id, count in session.execute(held)})
    return counts


def release(session: Session, model: type[Row], lost: Lost) -> list[Row]:
    """Opens the rows of a lost lease and returns them. Their holder can save nothing any more."""
    ids = list(session.scalars(select(model.id).where(held(model, lost.token))))
    transition(session, model, OPEN, held(model, lost.token), deaths=model.deaths + int(lost.alone))
    return list(session.scalars(select(model).where(model.id.in_(ids), model.state == OPEN)))


def is_poison(deaths: int, attempt: int, limit: int) -> bool:
    """Says whether a row must not be begun for the ``attempt``-th time.

    It must not when it has killed its process ``limit`` times, or when ``attempt`` exceeds 10 ``limit``: then no end is in sight.
    """
    return deaths >= limit or attempt > 10 * limit
