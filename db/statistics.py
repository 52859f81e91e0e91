"""This module counts the rows of the database, for monitoring."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

from sqlalchemy import func, select
from sqlalchemy.orm import Session

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


@dataclass(frozen=True)
class Statistics:
    """Holds the number of rows by state. A state that no row is in counts zero.

    Attributes:
        ended: (project, how they ended) -> stored jobs. At most ``PROJECTS`` projects have a name of their own here.
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


def _ended(session: Session) -> dict[tuple[str, End], int]:
    oldest = session.scalars(select(ProjectRow.name).order_by(ProjectRow.created_at, ProjectRow.name).limit(PROJECTS)).all()
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
