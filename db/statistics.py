"""This module counts the rows of the database, for monitoring."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum

from sqlalchemy import func, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from certifier.outcome import DEADLINE
from db import clock, jobs, work, workers
from db.models import IterationRow, JobRow, PairRow, ProjectRow, RegionRow, StepRow, WebhookRow
from db.settings import settings
from db.states import ACCEPT, JOB, JobState, PairState, WebhookState, unfinished


class End(StrEnum):
    """Says how a job ended."""

    SUCCEEDED = "succeeded"
    CANCELLED = "cancelled"
    DEADLINE = "deadline"
    """It failed because its deadline came first."""
    REFUSED = "refused"
    """It failed because what it asked for cannot be done or was not found; its error says why."""
    ERROR = "error"
    """It failed by a fault: of the program, or of a process that died."""


FAULTS = frozenset(
    {
        "child_died",
        "child_memory",
        "child_timeout",
        "coordination_failed",
        "internal_error",
        "other_version",
        "solver_unavailable",
        "worker_lost",
    }
)
"""Errors with these codes are no fault of the caller."""
PROJECTS, OTHER = 50, "(others)"
"""This many projects are counted by themselves, the oldest ones. The others are counted together, so that their number is no burden."""

RECENT, MOST = timedelta(minutes=15), 10_000
"""Times of jobs are those of the last RECENT, of MOST jobs at most."""


@dataclass(frozen=True)
class Statistics:
    """Holds the number of rows by state. A state that no row is in counts zero.

    Attributes:
        ended: (project, how they ended) -> stored jobs. At most ``PROJECTS`` projects have a name of their own here.
        waited: project -> the seconds from submission until a solver began, of jobs that it began in the last RECENT, in order.
        took: project -> the seconds from submission to the end, of jobs that ended in the last RECENT, in order.
        pair_seconds: seconds spent on pairs, summed by the state that resulted.
        step_seconds: seconds spent on steps, summed by kind.
        decisions_due: jobs for which a decision of a control worker is due that nobody makes.
        waiting: seconds since an iteration began -> how many of its pieces are open, for iterations that run.
        workers: the workers that live, by kind and state.
        workers_in_trouble: how many workers say that something of what they do again and again fails.
        workers_wanted: how many solving processes would be busy now if there were enough.
        jobs_without_solver: how many jobs have work of which no solver does any.
    """

    jobs: dict[str, int]
    ended: dict[tuple[str, End], int]
    waited: dict[str, list[float]]
    took: dict[str, list[float]]
    pairs: dict[str, int]
    pair_seconds: dict[str, float]
    step_seconds: dict[str, float]
    webhooks: dict[str, int]
    regions: int
    decisions_due: int
    waiting: dict[float, int]
    workers: dict[tuple[str, str], int]
    workers_in_trouble: int
    workers_wanted: int
    jobs_without_solver: int


def collect(session: Session) -> Statistics:
    """Returns the statistics as of now."""
    states = dict(session.execute(select(JobRow.state, func.count()).group_by(JobRow.state)).all())
    pairs = session.execute(select(PairRow.state, func.count(), func.sum(PairRow.seconds)).group_by(PairRow.state)).all()
    steps = dict(session.execute(select(StepRow.kind, func.sum(StepRow.seconds)).group_by(StepRow.kind)).all())
    webhooks = dict(session.execute(select(WebhookRow.state, func.count()).group_by(WebhookRow.state)).all())
    begun = func.max(IterationRow.started_at)
    open_jobs = select(JobRow.open_pairs, begun).join(IterationRow, IterationRow.job_id == JobRow.id).where(JobRow.open_pairs > 0)
    waiting: dict[float, int] = {}
    now = clock.now(session)
    for pieces, at in session.execute(open_jobs.group_by(JobRow.id)):
        age = max((now - at).total_seconds(), 0.0)
        waiting[age] = waiting.get(age, 0) + pieces
    counted = {state: count for state, count, _ in pairs}
    seconds = {state: total for state, _, total in pairs}
    return Statistics(
        jobs={state: states.get(state, 0) for state in JobState},
        ended=_ended(session),
        waited=_seconds(session, JobRow.claimed_at, now),
        took=_seconds(session, JobRow.finished_at, now),
        pairs={state: counted.get(state, 0) for state in PairState},
        pair_seconds={state: seconds.get(state) or 0.0 for state in PairState},
        step_seconds={kind: total or 0.0 for kind, total in sorted(({ACCEPT: 0.0} | steps).items())},
        webhooks={state: webhooks.get(state, 0) for state in WebhookState},
        regions=session.scalar(select(func.count()).select_from(RegionRow)) or 0,
        decisions_due=len(jobs.awaiting_coordination(session, now)),
        waiting=waiting,
        workers=workers.counts(session),
        workers_in_trouble=workers.in_trouble(session),
        workers_wanted=work.busy_solvers(session, batch_seconds=settings().batch_seconds),
        jobs_without_solver=work.jobs_without_solver(session),
    )


def _seconds(session: Session, until: InstrumentedAttribute[datetime | None], now: datetime) -> dict[str, list[float]]:
    """Returns project -> the seconds from submission until a time that was lately, in order."""
    oldest = _oldest(session)
    found: dict[str, list[float]] = {}
    recent = select(JobRow.project, JobRow.created_at, until).where(until >= now - RECENT).order_by(until.desc()).limit(MOST)
    for project, begin, end in session.execute(recent):
        assert end is not None
        found.setdefault(project if project in oldest else OTHER, []).append(max((end - begin).total_seconds(), 0.0))
    return {project: sorted(seconds) for project, seconds in sorted(found.items())}


def _oldest(session: Session) -> Sequence[str]:
    """Returns the projects that are counted by themselves."""
    return session.scalars(select(ProjectRow.name).order_by(ProjectRow.created_at, ProjectRow.name).limit(PROJECTS)).all()


def _ended(session: Session) -> dict[tuple[str, End], int]:
    oldest = _oldest(session)
    counts = Counter({(project, end): 0 for project in oldest for end in End})
    columns = (JobRow.project, JobRow.state, JobRow.reason.startswith(DEADLINE), JobRow.error["code"].as_string())
    ended = select(*columns, func.count()).where(JobRow.state.not_in(unfinished(JOB))).group_by(*columns)
    for project, state, late, code, number in session.execute(ended):
        counts[project if project in oldest else OTHER, _end(state, late, code or "")] += number
    return dict(counts)


def _end(state: str, late: bool | None, code: str) -> End:
    if state != JobState.FAILED:
        return End(state)
    if code in FAULTS or code.startswith("proof"):
        return End.ERROR
    return End.DEADLINE if late else End.REFUSED
