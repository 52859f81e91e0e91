"""This module counts the rows of the database, for monitoring."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db import clock, jobs, work, workers
from db.models import IterationRow, JobRow, PairRow, RegionRow, StepRow, WebhookRow
from db.settings import settings
from db.states import ACCEPT, JobState, PairState, WebhookState


@dataclass(frozen=True)
class Statistics:
    """Holds the number of rows by state. A state that no row is in counts zero.

    Attributes:
        pair_seconds: seconds spent on pairs, summed by the state that resulted.
        step_seconds: seconds spent on steps, summed by kind.
        decisions_due: jobs for which a decision of a control worker is due that nobody makes.
        waiting: seconds since an iteration began -> how many of its pieces are open, for iterations that run.
        workers: the workers that live, by kind and state.
        workers_in_trouble: how many workers say that something of what they do again and again fails.
        workers_wanted: how many solving processes would be busy now if there were enough.
    """

    jobs: dict[str, int]
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
    )
