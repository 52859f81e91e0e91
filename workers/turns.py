"""Coordinating a job: load what is known, let the coordinator decide, save the decision, send the work.

Any number of coordinations of one job may be asked for at once. One computes (it stands in ``jobs.coordinator``), its decision is
saved only onto the turn that it started from, and the others find nothing to do.
"""

from __future__ import annotations

import logging
from dataclasses import asdict, dataclass
from datetime import timedelta
from functools import lru_cache, partial
from typing import Any

from sqlalchemy.orm import Session

from certifier.errors import CirisError
from certifier.forecast import forecast
from certifier.growth import Certify, Finish, Propose, Report, Step, Transition, action_from_document, action_to_document
from certifier.outcome import Outcome
from db import jobs, leases, pairs, steps
from db.models import IterationRow, JobRow
from db.settings import settings
from db.states import JOB, STEP, IterationState, JobState, StepKind, StepState, unfinished
from db.types import utcnow
from workers.app import send_pairs, send_step, stop_messages
from workers.coordinator import batches, certification_report, ending, next_transition, step_report
from workers.scenes import load_scene
from workers.transaction import Afterwards, writing

log = logging.getLogger(__name__)

COORDINATION_SECONDS = 60.0
"""A coordinator that has not answered after this time is believed dead."""


@dataclass(frozen=True)
class Turn:
    """What a coordinator starts from."""

    job_id: str
    number: int
    scene_id: str
    options: dict[str, Any]
    growth: dict[str, Any] | None
    report: Report | None


def coordinate(job_id: str) -> None:
    """Takes the job as far as it goes without waiting for a worker. Harmless however often and whenever it is called."""
    while (turn := _begin(job_id)) is not None:
        try:
            transition = next_transition(load_scene(turn.scene_id), turn.options, turn.growth, turn.report)
        except CirisError as error:
            _give_up(turn, error)
        except Exception as error:
            log.exception("job %s: the next step could not be decided", job_id)
            _give_up(turn, CirisError("internal_error", f"the next step could not be decided: {type(error).__name__}: {error}"))
        else:
            _save(turn, transition)


@lru_cache(maxsize=8)
def _forecast(scene_id: str) -> list[float]:
    return [cost.seconds for cost in forecast(load_scene(scene_id))]


def _begin(job_id: str) -> Turn | None:
    """Ends the job if it is to end; else claims its next turn. None when there is nothing to decide."""
    with writing() as (session, afterwards):
        job = jobs.lock(session, job_id)
        if job.state not in unfinished(JOB):
            return None
        now = utcnow()
        if job.state == JobState.CANCELLING:
            _finish_growth(session, job, Finish(Outcome.INCONCLUSIVE, "cancelled"), afterwards)
        elif job.deadline_at is not None and job.deadline_at <= now:
            outcome = Outcome.CERTIFIED if steps.accepted(session, job_id) else Outcome.INCONCLUSIVE
            _finish_growth(session, job, Finish(outcome, "the deadline was reached"), afterwards)
        if job.coordinator_attempts >= settings().max_attempts:
            job.error = CirisError("coordination_failed", "the coordinator died or hung each time it decided about this job").to_document()
            _finish_growth(session, job, Finish(Outcome.ERROR, "the coordinator failed"), afterwards)
        if job.action is not None and job.action["kind"] == "finish":
            _finish(session, job)
            return None
        report = None if job.action is None else _report(session, job)
        if jobs.is_coordinated(job, now) or (job.action is not None and report is None):
            return None
        job.coordinator, job.coordinator_until = leases.this_worker(), now + timedelta(seconds=COORDINATION_SECONDS)
        job.coordinator_attempts += 1
        return Turn(job_id, job.turn, job.scene_id, job.options, job.growth, report)


def _report(session: Session, job: JobRow) -> Report | None:
    """The report on the job's present action; None while that is unfinished."""
    action = action_from_document(job.action or {})
    if isinstance(action, Certify):
        iteration = session.get_one(IterationRow, (job.id, action.iteration))
        if iteration.state == IterationState.RUNNING:
            return None
        rows = pairs.of_iteration(session, job.id, action.iteration)
        weak = {row.pair_index: row.weak_points for row in rows if row.weak_points is not None}
        return certification_report(action.iteration, {row.pair_index: row.state for row in rows}, weak)
    step = steps.of_turn(session, job, StepKind(action.kind))
    if step is None or step.state in unfinished(STEP):
        return None
    return step_report(StepKind(step.kind), StepState(step.state), step.report or {})


def _save(turn: Turn, transition: Transition) -> None:
    """Saves a transition and the work it asks for, unless the job has moved on."""
    with writing() as (session, afterwards):
        job = jobs.lock(session, turn.job_id)
        if job.turn != turn.number or job.state not in (JobState.QUEUED, JobState.RUNNING):
            return
        jobs.start(session, job)
        _advance(job, transition.action)
        job.growth = transition.state
        match transition.action:
            case Propose() | Step() as action:
                _add_step(session, job, StepKind(action.kind), action_to_document(action), afterwards)
            case Certify() as action:
                _add_iteration(session, job, action, afterwards)
        if transition.accepted is not None:
            # After the work that the growth waits for: a region that is overtaken before anybody began to accept it is left out.
            steps.supersede(session, job)
            _add_step(session, job, StepKind.ACCEPT, asdict(transition.accepted), afterwards)


def _advance(job: JobRow, action: Propose | Certify | Step | Finish) -> None:
    job.turn += 1
    job.action = action_to_document(action)
    job.coordinator = job.coordinator_until = None
    job.coordinator_attempts = 0


def _add_step(session: Session, job: JobRow, kind: StepKind, document: dict[str, Any], afterwards: Afterwards) -> None:
    step = steps.add(session, job, kind, document)
    afterwards.append(partial(send_step, step.id))


def _add_iteration(session: Session, job: JobRow, action: Certify, afterwards: Afterwards) -> None:
    scene, seconds = load_scene(job.scene_id), _forecast(job.scene_id)
    new = [pairs.NewPair(i, scene.pairs[i].a, scene.pairs[i].b, seconds[i]) for i in action.pairs]
    pairs.add_iteration(
        session,
        job,
        index=action.iteration,
        label=action.label,
        C=action.C,
        d=action.d,
        center=action.center,
        pairs=new,
        reuse=action.reuse,
        stop_at_first_failure=action.stop_at_first_failure,
    )
    groups = batches([(pair.index, pair.forecast_seconds) for pair in new], settings().batch_seconds)
    afterwards.append(partial(send_pairs, job.id, action.iteration, groups))


def _give_up(turn: Turn, error: CirisError) -> None:
    """Lets the job end with this error."""
    with writing() as (session, afterwards):
        job = jobs.lock(session, turn.job_id)
        if job.turn == turn.number and job.state in (JobState.QUEUED, JobState.RUNNING):
            job.error = error.to_document()
            _finish_growth(session, job, Finish(Outcome.ERROR, error.message), afterwards)


def _finish_growth(session: Session, job: JobRow, finish: Finish, afterwards: Afterwards) -> None:
    """Stops the job's work, except that regions reached are still accepted; does nothing when the growth has finished already."""
    if job.action is not None and job.action["kind"] == "finish":
        return
    jobs.start(session, job)
    running = pairs.skip(session, job.id, worth_stopping=settings().batch_seconds) + steps.skip(session, job.id)
    pairs.skip_iterations(session, job.id)
    afterwards.append(partial(stop_messages, running))
    _advance(job, finish)


def _finish(session: Session, job: JobRow) -> None:
    """Ends the job once its last region has been accepted or refused."""
    rows = steps.of_job(session, job.id)
    if any(step.state in unfinished(STEP) for step in rows):
        return
    refused = next((step.report for step in rows if step.kind == StepKind.ACCEPT and step.state == StepState.FAILED), None)
    failed = next((step.report for step in reversed(rows) if step.state == StepState.FAILED), None)
    finish = action_from_document(job.action or {})
    assert isinstance(finish, Finish)
    if job.state == JobState.CANCELLING:
        jobs.finish(session, job, JobState.CANCELLED, reason=finish.reason)
    elif refused is not None:
        jobs.finish(session, job, JobState.FAILED, outcome=Outcome.ERROR, reason="the proof of a region was refused", error=refused)
    else:
        end = ending(job.kind, finish.outcome, finish.reason, job.error or failed)
        jobs.finish(session, job, end.state, outcome=end.outcome, reason=end.reason, error=end.error)
