"""Coordinating a job means: load what is known, let its kind decide, save the decision, send the work.

Any number of coordinations of one job may be asked for at once. One of them computes (``jobs.coordinator`` names it), and its decision
is saved only onto the turn from which it started. The others find nothing to do.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import partial
from typing import Any

from sqlalchemy.orm import Session

from certifier.errors import CirisError
from certifier.growth.actions import Finish
from certifier.jobs.driver import drive
from certifier.outcome import Outcome
from db import clock, jobs, maps, pairs, steps, subtrees, traces, work
from db.models import JobRow
from db.settings import settings
from db.states import ACCEPT, JOB, STEP, JobState, StepState, unfinished
from db.transaction import Afterwards, persistently, writing
from db.types import utcnow
from jobs.failures import IN_LOG, not_begun
from jobs.kind import Kind, Turn
from jobs.registry import KINDS
from workers.app import send_coordinate, send_work

log = logging.getLogger(__name__)

COORDINATION_SECONDS = 60.0
"""A coordinator that has not answered after this many seconds is believed dead."""


def coordinate(job_id: str) -> None:
    """Takes the job as far as it goes without waiting for a worker. It does no harm to call it too often or at any time."""
    drive(_Rows(job_id))


@dataclass(frozen=True)
class _Rows:
    """The rows of a job: a store of :mod:`certifier.jobs.driver`."""

    job_id: str

    def turn(self) -> Turn | None:
        """Ends the job if it is to end, or else claims its next turn."""
        with writing() as (session, afterwards):
            job = jobs.locked(session, self.job_id)
            if job is None or job.state not in unfinished(JOB):
                return None
            kind, now = KINDS[job.kind], clock.now(session)
            if job.state == JobState.CANCELLING:
                _wind_up(session, kind, job, Finish(Outcome.INCONCLUSIVE, "cancelled"), afterwards)
            elif kind.is_late(session, job, now):
                _wind_up(session, kind, job, _late(session, kind, job), afterwards)
            elif jobs.kills_coordinators(job, now, settings().max_attempts):
                problem = "the coordinator died or hung each time it decided about this job"
                job.error = CirisError("coordination_failed", problem, hint=IN_LOG).to_document()
                _wind_up(session, kind, job, Finish(Outcome.ERROR, "the coordinator failed"), afterwards)
            if (finish := jobs.finish_of(job)) is not None:
                _finish(session, kind, job, Finish(*finish), afterwards)
                return None
            state = jobs.growth(session, job.id)
            report = None if job.action is None else kind.report(session, job, state)
            if jobs.is_coordinated(job, now) or (job.action is not None and report is None):
                return None
            jobs.coordinate(job, now, COORDINATION_SECONDS)
            return Turn(job.id, job.traceparent, kind, job.turn, job.scene_id, job.options, job.deadline_at, state, report)

    def decide(self, turn: Turn) -> Any:
        with traces.span("coordinate", turn.traceparent, job=turn.job_id, turn=turn.number):
            try:
                return turn.kind.decide(turn)
            except CirisError:
                raise
            except Exception as error:
                log.exception("the next step could not be decided")
                problem = "deciding what is next went wrong in the service"
                raise CirisError("internal_error", problem, hint=IN_LOG) from error

    def save(self, turn: Turn, decision: Any | CirisError) -> bool:
        return persistently(partial(_save, turn, decision))


def _save(turn: Turn, decision: Any | CirisError) -> bool:
    """Saves a decision with the work that it asks for, or the end of a job without one, unless the job has moved on."""
    with writing() as (session, afterwards):
        job = jobs.locked(session, turn.job_id)
        if job is None or job.turn != turn.number or job.state not in (JobState.QUEUED, JobState.RUNNING):
            return True
        if isinstance(decision, CirisError):
            job.error = decision.to_document()
            _wind_up(session, turn.kind, job, Finish(Outcome.ERROR, decision.message), afterwards)
            return True
        if job.state == JobState.QUEUED:
            jobs.start(session, job, work.served_by_now(session))
        return turn.kind.save(session, job, turn, decision, afterwards)


def _late(session: Session, kind: Kind, job: JobRow) -> Finish:
    """Returns the end of a job that is late. Where no worker has begun with it, that is an error."""
    if not jobs.untouched(job):
        return kind.late(session, job)
    error = not_begun()
    job.error = error.to_document()
    return Finish(Outcome.ERROR, error.message)


def _wind_up(session: Session, kind: Kind, job: JobRow, finish: Finish, afterwards: Afterwards) -> None:
    """Stops the job's work, but lets certified regions still be accepted. It does nothing when the job winds up already."""
    if jobs.finish_of(job) is not None:
        return
    jobs.start(session, job)
    pairs.skip(session, job)
    steps.skip(session, job.id)
    pairs.skip_iterations(session, job.id)
    kind.stop(session, job, afterwards)
    jobs.next_turn(job, jobs.finishing(finish.outcome, finish.reason))


def _finish(session: Session, kind: Kind, job: JobRow, finish: Finish, afterwards: Afterwards) -> None:
    """Ends the job once its last region has been accepted or refused, and nothing that it has begun goes on."""
    if kind.waits(session, job):
        return
    rows = steps.of_job(session, job.id)
    if any(step.state in unfinished(STEP) for step in rows):
        if job.accept_after > utcnow():
            job.accept_after = utcnow()
            afterwards.append(send_work)
        return
    refused = next((step.report for step in rows if step.kind == ACCEPT and step.state == StepState.FAILED), None)
    failed = next((step.report for step in reversed(rows) if step.state == StepState.FAILED), None)
    subtrees.end(session, job.id)
    maps.end(session, job.id)
    if job.parent_id is not None:
        afterwards.append(partial(send_coordinate, job.parent_id))
    if job.state == JobState.CANCELLING:
        jobs.finish(session, job, JobState.CANCELLED, reason=finish.reason)
    elif refused is not None:
        why = "the verifier refused the proof" if refused["code"].startswith("proof") else "the proof could not be stored"
        jobs.finish(session, job, JobState.FAILED, outcome=Outcome.ERROR, reason=why, error=refused)
    else:
        error = kind.failure(finish, job.error or failed)
        state = JobState.SUCCEEDED if error is None else JobState.FAILED
        jobs.finish(session, job, state, outcome=finish.outcome, reason=finish.reason, error=error)
    whole = partial(traces.past, f"job {job.kind}", job.traceparent, job.created_at, job.finished_at or utcnow())
    afterwards.append(partial(whole, job=job.id, state=job.state, reason=job.reason or ""))
