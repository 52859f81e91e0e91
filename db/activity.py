"""This module says what jobs do at this moment, or what they wait for, in the words that lists, pages and commands show.

A job's state alone does not say whether anybody works on it: a job goes on ``running`` when the last worker ends.

The queries are built once, because building one takes longer than running it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import cache
from typing import Any

from sqlalchemy import Select, bindparam, func, select
from sqlalchemy.orm import Session

from db import clock, jobs, leases, work, workers
from db.models import JobRow, PairRow, StepRow
from db.session import all_projects
from db.states import JOB, STEP, JobState, WorkerState, unfinished
from db.types import utcnow
from db.workers import WorkerKind

WORKING = "working"
QUEUED = "queued"
ENDING = "ending: what it has begun is being stopped"
STALLED = "stalled: its worker gives no sign of life"
STARTING = "workers get ready"
COMPILING = "workers compile, which takes some minutes, once"
MOST_AHEAD = 1000
"""Where more jobs than this come first, their number is not told."""


@dataclass
class Kept:
    """What the database has said about all jobs and workers. Who asks often, keeps it for a moment.

    Attributes:
        clock_ahead: by how much the database's clock is before this machine's.
        parents: those of the jobs asked for that have made jobs that have not ended.
        waiting: those of them that have a step that has not ended.
        held: until when the work of a job is held at the latest, for the jobs of which some is.
        workers: what :func:`db.workers.counts` returns.
        ahead: the first jobs that wait for a worker of a kind.
    """

    clock_ahead: timedelta | None = None
    parents: frozenset[str] = frozenset()
    waiting: frozenset[str] = frozenset()
    held: dict[str, datetime] | None = None
    workers: dict[tuple[str, str], int] | None = None
    queue_silent: bool = False
    ahead: dict[WorkerKind, list[str]] = field(default_factory=dict)


def of_jobs(session: Session, rows: Sequence[JobRow], kept: Kept | None = None) -> dict[str, str]:
    """Returns what these jobs do, by id: the state of a job that has ended or is being cancelled, ``WORKING``, ``STALLED``, or ``queued:``
    with the reason."""
    kept = kept or Kept()
    found = {row.id: row.state for row in rows}
    alive = [row for row in rows if row.state in (JobState.QUEUED, JobState.RUNNING)]
    if not alive:
        return found
    begun = [row for row in alive if row.state == JobState.RUNNING]
    idle = {row.id for row in begun if row.open_pairs == 0 and row.running_pairs == 0}
    new = idle - kept.waiting - kept.parents
    kept.waiting |= set(session.scalars(_waiting(), {"jobs": list(new)})) if new else set()
    parents = new | (idle & kept.parents)
    children = session.scalars(_below(), {"parents": list(parents)}).all() if parents else ()
    kept.parents |= {child.parent_id for child in children if child.parent_id is not None}
    below = of_jobs(session, children, kept) if children else {}
    if kept.held is None or any(row.running_pairs > 0 and row.id not in kept.held for row in alive):
        kept.held = _held(session)
    held = kept.held
    if kept.clock_ahead is None:
        kept.clock_ahead = clock.now(session) - utcnow()
    now = utcnow() + kept.clock_ahead
    queues = _Queues(session, kept)
    for row in alive:
        grown = [below[child.id] for child in children if child.parent_id == row.id]
        if jobs.is_coordinated(row, now) or held.get(row.id, now) > now or WORKING in grown:
            found[row.id] = WORKING
        elif row.id in held:
            found[row.id] = STALLED
        elif row.open_pairs > 0 or row.id in kept.waiting:
            found[row.id] = queues.of_work(row.id)
        elif grown:
            found[row.id] = next((said for said in grown if said != JobState.CANCELLING), ENDING)
        elif row.state == JobState.QUEUED:
            found[row.id] = queues.of_begin(row.id)
        else:
            found[row.id] = queues.of_decisions(row.id)
    return found


class _Queues:
    """Says why a job waits. What it asks the database about all jobs, it asks once, and only what is not kept."""

    def __init__(self, session: Session, kept: Kept) -> None:
        self._session, self._kept = session, kept
        self._asked = set[WorkerKind]()

    def of_work(self, job_id: str) -> str:
        """Returns why the job has work that no solve worker does."""
        return self._why(WorkerKind.SOLVE, job_id)

    def of_decisions(self, job_id: str) -> str:
        """Returns why nobody decides what the job does next."""
        return self._why(WorkerKind.CONTROL, job_id)

    def of_begin(self, job_id: str) -> str:
        """Returns why nobody begins the job, or would work on it afterwards."""
        if (missing := self._missing(WorkerKind.CONTROL) or self._missing(WorkerKind.SOLVE)) is not None:
            return f"{QUEUED}: {missing}"
        return self._why(WorkerKind.CONTROL, job_id)

    def _why(self, kind: WorkerKind, job_id: str) -> str:
        if (missing := self._missing(kind)) is not None:
            return f"{QUEUED}: {missing}"
        ahead = self._kept.ahead.get(kind, [])
        if job_id not in ahead and kind not in self._asked:  # it may have begun to wait since
            order = work.in_order if kind == WorkerKind.SOLVE else jobs.undecided
            with all_projects(self._session):
                ahead = self._kept.ahead[kind] = list(order(self._session, MOST_AHEAD + 1))
            self._asked.add(kind)
        if job_id not in ahead:
            return f"{QUEUED}: behind more than {MOST_AHEAD} others" if len(ahead) > MOST_AHEAD else f"{QUEUED}: next"
        number = ahead.index(job_id)
        return f"{QUEUED}: next" if number == 0 else f"{QUEUED}: behind {number} {'other' if number == 1 else 'others'}"

    def _missing(self, kind: WorkerKind) -> str | None:
        """Returns which worker is missing, or that none hears of work; None where one of this kind takes work."""
        if self._kept.workers is None:
            self._kept.queue_silent = workers.miss_queue(self._session)
            self._kept.workers = workers.counts(self._session)
        return missing(self._kept.workers, kind) or ("the queue does not answer" if self._kept.queue_silent else None)


def missing(counts: dict[tuple[str, str], int], kind: WorkerKind) -> str | None:
    """Returns what is wrong with the workers of a kind; None where one of them takes work.

    Args:
        counts: what :func:`db.workers.counts` returns.
    """
    if counts[kind, WorkerState.RUNNING]:
        return None
    if counts[kind, WorkerState.COMPILING]:
        return COMPILING
    if counts[kind, WorkerState.STARTING]:
        return STARTING
    said = "control worker" if kind == WorkerKind.CONTROL and any(counts.values()) else "worker"
    return f"all {said}s paused" if counts[kind, WorkerState.PAUSED] else f"no {said}"


def _held(session: Session) -> dict[str, datetime]:
    """Returns until when the work of a job is held at the latest, for all jobs of which some is."""
    found: dict[str, datetime] = {}
    for model in (PairRow, StepRow):
        for job_id, latest in session.execute(_held_of(model)):
            found[job_id] = max(latest, found.get(job_id, latest))
    return found


@cache
def _held_of(model: type[PairRow] | type[StepRow]) -> Select[str, Any]:
    """Returns the query for until when pairs, or steps, of a job are held at the latest."""
    held = (model.state == leases.RUNNING, model.lease_until.is_not(None))
    return select(model.job_id, func.max(model.lease_until)).where(*held).group_by(model.job_id)


@cache
def _below() -> Select[JobRow]:
    """Returns the query for the unfinished jobs that some jobs have made."""
    return select(JobRow).where(JobRow.parent_id.in_(bindparam("parents", expanding=True)), JobRow.state.in_(unfinished(JOB)))


@cache
def _waiting() -> Select[str]:
    """Returns the query for which of some jobs have a step that has not ended."""
    return select(StepRow.job_id).where(StepRow.job_id.in_(bindparam("jobs", expanding=True)), StepRow.state.in_(unfinished(STEP)))
