"""This module says what jobs do at this moment, or what they wait for, in the words that lists, pages and commands show.

A job's state alone does not say whether anybody works on it: a job goes on ``running`` when the last worker ends.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db import clock, jobs, work, workers
from db.models import JobRow, PairRow, StepRow
from db.session import all_projects
from db.states import JOB, STEP, JobState, PairState, StepState, WorkerState, unfinished
from db.workers import WorkerKind

WORKING = "working"
QUEUED = "queued"
STALLED = "stalled: its worker gives no sign of life"
STARTING = "workers get ready"
COMPILING = "workers compile, which takes some minutes, once"
MOST_AHEAD = 1000
"""Where more jobs than this come first, their number is not told."""


def of_jobs(session: Session, rows: Sequence[JobRow]) -> dict[str, str]:
    """Returns what these jobs do, by id: the state of a job that has ended or is being cancelled, ``WORKING``, ``STALLED``, or ``queued:``
    with the reason."""
    found = {row.id: row.state for row in rows}
    alive = [row for row in rows if row.state in (JobState.QUEUED, JobState.RUNNING)]
    if not alive:
        return found
    children = session.scalars(select(JobRow).where(JobRow.parent_id.in_(_ids(alive)), JobRow.state.in_(unfinished(JOB)))).all()
    below = of_jobs(session, children)
    now, held, waiting = clock.now(session), _held(session, alive), _waiting_steps(session, alive)
    queues = _Queues(session)
    for row in alive:
        grown = [below[child.id] for child in children if child.parent_id == row.id]
        if jobs.is_coordinated(row, now) or held.get(row.id, now) > now or WORKING in grown:
            found[row.id] = WORKING
        elif row.id in held:
            found[row.id] = STALLED
        elif row.open_pairs > 0 or row.id in waiting:
            found[row.id] = queues.of_work(row.id)
        elif grown:
            found[row.id] = grown[0]
        elif row.state == JobState.QUEUED:
            found[row.id] = queues.of_begin(row.id)
        else:
            found[row.id] = queues.of_decisions(row.id)
    return found


class _Queues:
    """Says why a job waits. What it asks the database about all jobs, it asks once."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._workers: dict[tuple[str, str], int] | None = None
        self._queue_silent = False
        self._ahead: dict[WorkerKind, list[str]] = {}

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
        if kind not in self._ahead:
            order = work.in_order if kind == WorkerKind.SOLVE else jobs.undecided
            with all_projects(self._session):
                self._ahead[kind] = list(order(self._session, MOST_AHEAD + 1))
        ahead = self._ahead[kind]
        if job_id not in ahead:
            return f"{QUEUED}: behind more than {MOST_AHEAD} others" if len(ahead) > MOST_AHEAD else f"{QUEUED}: next"
        number = ahead.index(job_id)
        return f"{QUEUED}: next" if number == 0 else f"{QUEUED}: behind {number} {'other' if number == 1 else 'others'}"

    def _missing(self, kind: WorkerKind) -> str | None:
        """Returns which worker is missing, or that none hears of work; None where one of this kind takes work."""
        if self._workers is None:
            self._workers = workers.counts(self._session)
            self._queue_silent = workers.miss_queue(self._session)
        return missing(self._workers, kind) or ("the queue does not answer" if self._queue_silent else None)


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


def _ids(rows: Sequence[JobRow]) -> list[str]:
    return [row.id for row in rows]


def _held(session: Session, rows: Sequence[JobRow]) -> dict[str, datetime]:
    """Returns until when a job's work is held at the latest, for the jobs of which some is."""
    found: dict[str, datetime] = {}
    for model, state, some in (
        (PairRow, PairState.RUNNING, [row for row in rows if row.running_pairs > 0]),
        (StepRow, StepState.RUNNING, rows),
    ):
        latest = func.max(model.lease_until)
        query = select(model.job_id, latest).where(model.state == state, model.job_id.in_(_ids(some)))
        for job_id, until in session.execute(query.group_by(model.job_id)) if some else ():
            if until is not None:
                found[job_id] = max(until, found.get(job_id, until))
    return found


def _waiting_steps(session: Session, rows: Sequence[JobRow]) -> Collection[str]:
    """Returns the jobs that have a step which nobody does."""
    open_steps = select(StepRow.job_id).where(StepRow.job_id.in_(_ids(rows)), StepRow.state.in_(unfinished(STEP))).distinct()
    return set(session.scalars(open_steps))
