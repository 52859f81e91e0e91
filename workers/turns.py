"""Coordinating a job means: load what is known, let the coordinator decide, save the decision, send the work.

Any number of coordinations of one job may be asked for at once. One of them computes (``jobs.coordinator`` names it), and its decision
is saved only onto the turn from which it started. The others find nothing to do.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import lru_cache, partial
from typing import Any

from sqlalchemy.orm import Session

from certifier.errors import CirisError
from certifier.growth.actions import Candidate, Certify, Finish, Outcomes, Propose, Report, Step, Transition
from certifier.growth.options import GrowthOptions
from certifier.growth.refusal import DEADLINE, at_deadline
from certifier.outcome import Outcome
from certifier.pair.forecast import PairCost, forecast
from certifier.pair.result import Weakness
from db import clock, jobs, pairs, steps, subtrees, traces, work
from db.models import IterationRow, JobRow
from db.settings import settings
from db.states import JOB, STEP, IterationState, JobKind, JobState, StepKind, StepState, unfinished
from db.types import utcnow
from planner.cover import state as cover
from workers import admission, covers, motions
from workers.actions import certify_action
from workers.app import send_coordinate, send_work
from workers.coordinator import ending, next_transition, step_report
from workers.failures import IN_LOG
from workers.scenes import load_scene
from workers.transaction import Afterwards, persistently, writing

log = logging.getLogger(__name__)

COORDINATION_SECONDS = 60.0
"""A coordinator that has not answered after this many seconds is believed dead."""


@dataclass(frozen=True)
class Turn:
    """Holds what a coordinator starts from."""

    job_id: str
    traceparent: str | None
    kind: str
    number: int
    scene_id: str
    options: dict[str, Any]
    deadline_at: datetime | None
    growth: dict[str, Any] | None
    report: Report | cover.Report | motions.Verdict | None


def coordinate(job_id: str) -> None:
    """Takes the job as far as it goes without waiting for a worker. It does no harm to call it too often or at any time."""
    goes_on = True
    while goes_on and (turn := _begin(job_id)) is not None:
        with traces.span("coordinate", turn.traceparent, job=job_id, turn=turn.number):
            goes_on = _take(turn)


def _take(turn: Turn) -> bool:
    """Decides what is next and saves that. Says whether something may have to be decided before any work is done."""
    try:
        transition = _decide(turn)
    except CirisError as error:
        decision = partial(_give_up, turn, error)
    except Exception:
        log.exception("the next step could not be decided")
        problem = CirisError("internal_error", "deciding what is next went wrong in the service", hint=IN_LOG)
        decision = partial(_give_up, turn, problem)
    else:
        decision = partial(_save, turn, transition)
    return persistently(decision)


def _decide(turn: Turn) -> Transition | cover.Transition | motions.Action:
    if turn.kind == JobKind.COVER:
        return covers.next_transition(turn.options, turn.growth, turn.report)
    if turn.kind == JobKind.CERTIFY_PATH:
        return motions.next_action(turn.report)
    others = "only covers and motions get these reports"
    assert not isinstance(turn.report, cover.Scouted | cover.Ended | cover.Late | motions.Verdict), others
    if turn.growth is None:
        left = None if turn.deadline_at is None else (turn.deadline_at - utcnow()).total_seconds()
        if not GrowthOptions.from_document(turn.options).by_cells:  # the forecast is about the program (11)
            admission.check(_forecast(turn.scene_id), settings(), left)
    return next_transition(load_scene(turn.scene_id), turn.options, turn.growth, turn.report)


@lru_cache(maxsize=8)
def _forecast(scene_id: str) -> list[PairCost]:
    return forecast(load_scene(scene_id))


def _begin(job_id: str) -> Turn | None:
    """Ends the job if it is to end, or else claims its next turn. Returns None when there is nothing to decide."""
    with writing() as (session, afterwards):
        job = jobs.locked(session, job_id)
        if job is None or job.state not in unfinished(JOB):
            return None
        now = clock.now(session)
        if job.state == JobState.CANCELLING:
            _finish_growth(session, job, Finish(Outcome.INCONCLUSIVE, "cancelled"), afterwards)
        elif _is_late(session, job, now):
            _finish_growth(session, job, _at_deadline(session, job), afterwards)
        elif jobs.kills_coordinators(job, now, settings().max_attempts):
            problem = "the coordinator died or hung each time it decided about this job"
            job.error = CirisError("coordination_failed", problem, hint=IN_LOG).to_document()
            _finish_growth(session, job, Finish(Outcome.ERROR, "the coordinator failed"), afterwards)
        if job.action is not None and job.action["kind"] == "finish":
            _finish(session, job, afterwards)
            return None
        growth = jobs.growth(session, job_id)
        report = None if job.action is None else _report(session, job, growth)
        if jobs.is_coordinated(job, now) or (job.action is not None and report is None):
            return None
        jobs.coordinate(job, now + timedelta(seconds=COORDINATION_SECONDS))
        return Turn(job_id, job.traceparent, job.kind, job.turn, job.scene_id, job.options, job.deadline_at, growth, report)


def _is_late(session: Session, job: JobRow, now: datetime) -> bool:
    """Says whether the deadline ends the job. A cover ends itself, and a motion that has its verdict ends with it."""
    passed = job.deadline_at is not None and job.deadline_at <= now
    return passed and job.kind != JobKind.COVER and steps.verdict(session, job.id) is None


def _at_deadline(session: Session, job: JobRow) -> Finish:
    if steps.accepted(session, job.id):
        return Finish(Outcome.CERTIFIED, DEADLINE)
    growth = jobs.growth(session, job.id) if job.kind == JobKind.GROW else None
    start = (growth or {}).get("start") or {}
    return Finish(Outcome.INCONCLUSIVE, at_deadline(start.get("hindrance", "")))


def _report(session: Session, job: JobRow, growth: dict[str, Any] | None) -> Report | cover.Report | motions.Verdict | None:
    """Returns the report on the job's present action; None while the action is unfinished."""
    action = job.action or {}
    if job.kind == JobKind.COVER:
        return covers.report(session, job, growth or {})
    if job.kind == JobKind.CERTIFY_PATH:
        return motions.report(session, job)
    if action["kind"] == Certify.kind:
        iteration = session.get_one(IterationRow, (job.id, action["iteration"]))
        return None if iteration.state == IterationState.RUNNING else _outcomes(session, job, iteration)
    step = steps.of_turn(session, job, StepKind(action["kind"]))
    if step is None or step.state in unfinished(STEP):
        return None
    return step_report(StepKind(step.kind), StepState(step.state), step.report or {})


def _outcomes(session: Session, job: JobRow, iteration: IterationRow) -> Outcomes:
    """Returns the report on a certification that has ended, from its rows."""
    action = certify_action(iteration, pairs.order(session, iteration))
    rows = pairs.reached(session, iteration)
    weaknesses = (None if row.weakness is None else Weakness.from_document(row.weakness) for row in rows)
    reached = ((row.pair_index, Outcome(row.state), weakness, row.open_cells) for row, weakness in zip(rows, weaknesses, strict=True))
    passed = 0.0 if job.deadline_at is None else (utcnow() - job.created_at) / (job.deadline_at - job.created_at)
    return Outcomes.of_parts(action, reached, passed)


def _save(turn: Turn, transition: Transition | cover.Transition | motions.Action) -> bool:
    """Saves a transition and the work it asks for, unless the job has moved on.

    It returns True when something may have to be decided before any work is done.
    """
    with writing() as (session, afterwards):
        job = jobs.locked(session, turn.job_id)
        if job is None or job.turn != turn.number or job.state not in (JobState.QUEUED, JobState.RUNNING):
            return True
        if job.state == JobState.QUEUED:
            jobs.start(session, job, work.served_by_now(session))
        if isinstance(transition, cover.Transition):
            return covers.save(session, job, transition, turn.report, afterwards)
        if not isinstance(transition, Transition):
            return motions.save(session, job, transition, afterwards)
        if isinstance(turn.report, Outcomes):
            pairs.forget_weaknesses(session, job.id, turn.report.action.iteration)
        _advance(job, transition.action)
        jobs.keep_growth(session, job, transition.state.to_document())
        match transition.action:
            case Propose() as action:
                _add_step(session, job, StepKind.PROPOSE, {"seed": action.seed}, afterwards)
            case Step() as action:
                work_on = {"iteration": action.iteration, "contain": action.contain.tolist()}
                _add_step(session, job, StepKind.STEP, work_on, afterwards)
            case Certify() as action:
                _add_iteration(session, job, action, afterwards)
        if transition.candidate is not None:
            _add_acceptance(session, job, transition.candidate)
    return isinstance(transition.action, Finish) or (isinstance(transition.action, Certify) and not transition.action.pairs)


def _advance(job: JobRow, action: Propose | Certify | Step | Finish) -> None:
    document: dict[str, Any] = {"kind": action.kind}
    if isinstance(action, Certify):
        document["iteration"] = action.iteration
    elif isinstance(action, Finish):
        document |= {"outcome": action.outcome.value, "reason": action.reason}
    jobs.next_turn(job, document)


def _add_step(session: Session, job: JobRow, kind: StepKind, work_on: dict[str, Any], afterwards: Afterwards) -> None:
    steps.add(session, job, kind, work_on)
    afterwards.append(send_work)


def _add_acceptance(session: Session, job: JobRow, candidate: Candidate) -> None:
    """Adds the step that accepts a region. Its input is what the candidate's iteration does not hold."""
    work_on = {
        "iteration": candidate.iteration,
        "seed": None if candidate.seed is None else candidate.seed.tolist(),
        "ellipsoid_volume": candidate.ellipsoid_volume,
        "proofs": candidate.proofs,
        "together": candidate.together,
        "obstacles": {index: obstacle.to_document() for index, obstacle in candidate.obstacles.items()},
    }
    steps.add(session, job, StepKind.ACCEPT, work_on)


def _add_iteration(session: Session, job: JobRow, action: Certify, afterwards: Afterwards) -> None:
    costs = _forecast(job.scene_id)
    # A pair takes about as long as the last time. The forecast by its size alone may be far from that.
    expected = pairs.expected_seconds(session, job.id, action.iteration - 1)
    new = [pairs.NewPair(i, costs[i].a, costs[i].b, expected.get(i, costs[i].seconds), part) for i, part in action.work]
    pairs.add_iteration(
        session,
        job,
        index=action.iteration,
        label=action.label,
        C=action.polytope.C,
        d=action.polytope.d,
        center=action.center,
        pairs=new,
        reuse=action.reuse,
        hard=action.hard,
        failures=action.failures,
        cells=action.cells,
        box=None if action.box is None else vars(action.box),
        begun=action.begun,
        parts=action.parts,
        ending=action.ending,
        together=action.together,
    )
    # A certified pair is not asked for again, and partitions that begin anew have nothing to go on with.
    subtrees.drop(session, job.id, [] if action.begun is None else action.pairs)
    # Each solver that finds work wakes the next one. Where there is much work, this many solvers begin at once.
    pieces = math.ceil(sum(pair.forecast_seconds for pair in new) / settings().batch_seconds)
    afterwards.append(partial(send_work, min(max(pieces, 1), settings().solve_processes)))


def _give_up(turn: Turn, error: CirisError) -> bool:
    """Ends the job's growth with this error. It returns True, because the end of the job is to be decided next."""
    with writing() as (session, afterwards):
        job = jobs.locked(session, turn.job_id)
        if job is not None and job.turn == turn.number and job.state in (JobState.QUEUED, JobState.RUNNING):
            job.error = error.to_document()
            _finish_growth(session, job, Finish(Outcome.ERROR, error.message), afterwards)
    return True


def _finish_growth(session: Session, job: JobRow, finish: Finish, afterwards: Afterwards) -> None:
    """Stops the job's work, but lets certified regions still be accepted. It does nothing when the growth has finished already."""
    if job.action is not None and job.action["kind"] == "finish":
        return
    jobs.start(session, job)
    pairs.skip(session, job)
    steps.skip(session, job.id)
    pairs.skip_iterations(session, job.id)
    covers.stop(session, job, afterwards)
    _advance(job, finish)


def _finish(session: Session, job: JobRow, afterwards: Afterwards) -> None:
    """Ends the job once its last region has been accepted or refused, and no region grows for it any more."""
    if covers.grows(session, job):
        return
    rows = steps.of_job(session, job.id)
    if any(step.state in unfinished(STEP) for step in rows):
        if job.accept_after > utcnow():
            job.accept_after = utcnow()
            afterwards.append(send_work)
        return
    refused = next((step.report for step in rows if step.kind == StepKind.ACCEPT and step.state == StepState.FAILED), None)
    failed = next((step.report for step in reversed(rows) if step.state == StepState.FAILED), None)
    subtrees.end(session, job.id)
    if job.parent_id is not None:
        afterwards.append(partial(send_coordinate, job.parent_id))
    assert job.action is not None, "a job that ends has its last action"
    finish = Finish(Outcome(job.action["outcome"]), job.action["reason"])
    if job.state == JobState.CANCELLING:
        jobs.finish(session, job, JobState.CANCELLED, reason=finish.reason)
    elif refused is not None:
        jobs.finish(session, job, JobState.FAILED, outcome=Outcome.ERROR, reason="the proof of a region was refused", error=refused)
    else:
        end = ending(job.kind, finish.outcome, finish.reason, job.error or failed)
        jobs.finish(session, job, end.state, outcome=end.outcome, reason=end.reason, error=end.error)
    whole = partial(traces.past, f"job {job.kind}", job.traceparent, job.created_at, job.finished_at or utcnow())
    afterwards.append(partial(whole, job=job.id, state=job.state, reason=job.reason or ""))
