"""The rows of a cover: its regions are grown by jobs that are its children, which the workers serve like any others.

What happens next is decided by :mod:`planner.cover.machine`. Here its actions become rows, and rows its reports.
"""

from __future__ import annotations

from datetime import timedelta
from functools import partial
from typing import Any

from sqlalchemy.orm import Session

from certifier.errors import CirisError
from certifier.growth.actions import Failed
from certifier.growth.options import GrowthOptions
from certifier.outcome import Outcome
from certifier.seeding.options import SeedOptions
from db import events, jobs, steps
from db.models import JobRow
from db.states import JOB, STEP, JobKind, StepKind, StepState, unfinished
from db.types import utcnow
from planner.cover.machine import advance, begin
from planner.cover.options import CoverOptions
from planner.cover.result import said
from planner.cover.state import CoverState, Ended, Finish, Late, Report, Scout, Scouted, Task, Transition, Watch
from workers.app import send_coordinate, send_work
from workers.transaction import Afterwards

ACTIVE = unfinished(JOB)
NEVER = timedelta(days=10_000)


def next_transition(options: dict[str, Any], state: dict[str, Any] | None, report: object) -> Transition:
    """Returns the first transition of a cover, which has no state yet, or the transition that follows a report.

    Raises:
        CirisError: why the look at the scene failed, or as :meth:`CoverOptions.from_document`.
    """
    parsed = CoverOptions.from_document(options)
    if state is None:
        return begin(parsed)
    match report:
        case Failed():
            raise report.error
        case Scouted() | Ended() | Late():
            return advance(CoverState.from_document(state, parsed), report)
        case _:
            raise ValueError("a cover that has begun advances with a report")


def report(session: Session, job: JobRow, state: dict[str, Any]) -> Report | Failed | None:
    """Returns the report on the cover's present action; None while it has no result."""
    if state["closing"] is None and job.deadline_at is not None and job.deadline_at <= utcnow():
        return Late()
    action = job.action or {}
    if action["kind"] == Watch.kind:
        ended = {
            child.number or 0: None if child.region_id else child.reason or f"the job was {child.state}"
            for child in jobs.children(session, job.id)
            if str(child.number) in state["growing"] and child.state not in ACTIVE
        }
        return Ended(ended) if ended else None
    step = steps.of_turn(session, job, StepKind.SCOUT)
    if step is None or step.state in unfinished(STEP):
        return None
    if step.state == StepState.FAILED:
        return Failed(CirisError.from_document(step.report or {}))
    return Scouted.from_document(step.report or {})


def save(session: Session, job: JobRow, transition: Transition, report: object, afterwards: Afterwards) -> bool:
    """Saves what a cover remembers, tells what it knows, and makes the rows of its next action. The caller holds the job's lock.

    It returns True when something may have to be decided before any work is done.
    """
    state = transition.state
    jobs.keep_growth(session, job, state.to_document())
    if isinstance(report, Ended):
        _tell_ended(session, job, report)
    steps.skip(session, job.id)  # a look that the deadline has overtaken
    match transition.action:
        case Scout() as action:
            jobs.next_turn(job, {"kind": action.kind})
            steps.add(session, job, StepKind.SCOUT, {})
            afterwards.append(send_work)
        case Watch() as action:
            jobs.next_turn(job, {"kind": action.kind})
            for number, task in action.begin.items():
                _begin(session, job, state.options, number, task, afterwards)
            if action.stop:
                stop(session, job, afterwards)
        case Finish() as action:
            outcome = Outcome.CERTIFIED if action.reached else Outcome.INCONCLUSIVE
            jobs.next_turn(job, {"kind": action.kind, "outcome": outcome.value, "reason": action.reason})
            if action.fruitless:
                job.error = CirisError(
                    "not_covered", action.reason, field="options", hint="regions that were certified remain"
                ).to_document()
    known = said(state)
    if isinstance(report, Scouted) and known is not None:
        events.emit(session, job, "cover", known)
    return isinstance(transition.action, Finish) or (isinstance(transition.action, Watch) and transition.action.stop)


def stop(session: Session, job: JobRow, afterwards: Afterwards) -> None:
    """Cancels the jobs that grow regions for a cover. Regions that they have certified remain."""
    for child in jobs.children(session, job.id):
        if child.state in ACTIVE:
            jobs.cancel(session, child.id)
            afterwards.append(partial(send_coordinate, child.id))


def grows(session: Session, job: JobRow) -> bool:
    """Says whether a region grows for this job."""
    return any(child.state in ACTIVE for child in jobs.children(session, job.id))


def _begin(session: Session, job: JobRow, options: CoverOptions, number: int, task: Task, afterwards: Afterwards) -> None:
    """Creates the job that grows a region. It ends with the cover, or earlier."""
    ends = [job.deadline_at] if job.deadline_at is not None else []
    if options.region_seconds is not None:
        ends.append(utcnow() + timedelta(seconds=options.region_seconds))
    seed = SeedOptions(q=task.q, contain=task.contain, random_seed=options.random_seed)
    growth = GrowthOptions(seed=seed.to_document(), cells=options.cells, stages=options.stages, random_seed=options.random_seed)
    child, _ = jobs.create(
        session,
        kind=JobKind.GROW,
        scene_id=job.scene_id,
        options=growth.to_document(),
        deadline_at=min(ends, default=None),
        key_id=job.key_id,
        priority=job.priority,
        parent_id=job.id,
        number=number,
    )
    # Its last region is the one that counts; those on the way would only be more to look at.
    child.accept_after = utcnow() + NEVER
    about = {"job": child.id, "number": number, "purpose": task.key, "q": list(task.q), "state": child.state}
    events.emit(session, job, "child", about)
    afterwards.append(partial(send_coordinate, child.id))


def _tell_ended(session: Session, job: JobRow, report: Ended) -> None:
    growths = [child for child in jobs.children(session, job.id) if child.number in report.regions]
    for child in growths:
        about = {"job": child.id, "number": child.number, "state": child.state, "region_id": child.region_id, "reason": child.reason}
        events.emit(session, job, "child", about)
