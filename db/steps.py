"""Steps: the pieces of a job that are not pairs (seeding, the polytope step, accepting a region)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db import events, jobs, leases
from db.models import JobRow, StepRow
from db.states import JOB, STEP, StepKind, StepState, transition, unfinished
from db.types import utcnow

UNFINISHED = unfinished(STEP)


@dataclass(frozen=True)
class Claim:
    """A step held under a token, with what is needed to do it; ``attempt`` counts from 1."""

    token: str
    step_id: int
    job_id: str
    scene_id: str
    options: dict[str, Any]
    kind: StepKind
    input: dict[str, Any]
    attempt: int


def add(session: Session, job: JobRow, kind: StepKind, input: dict[str, Any]) -> StepRow:
    """Adds a step of the job's present turn; the caller holds the job's lock."""
    step = StepRow(job_id=job.id, turn=job.turn, kind=kind, input=input, sent_at=utcnow())
    session.add(step)
    session.flush()
    events.emit(session, job, "step", {"kind": kind, "state": StepState.OPEN})
    return step


def claim(session: Session, step_id: int, *, task_id: str | None, lease_seconds: float) -> Claim | None:
    """Claims the step; None when it is done, skipped or held by someone else, or when the job has ended."""
    step = session.get(StepRow, step_id)
    if step is None:
        return None
    job = jobs.lock(session, step.job_id)
    session.refresh(step)
    if job.state not in unfinished(JOB) or not leases.is_free(step, utcnow()):
        return None
    attempt = step.attempts + 1
    token = leases.take(session, StepRow, [step], task_id=task_id, seconds=lease_seconds)
    return Claim(token, step_id, job.id, job.scene_id, job.options, StepKind(step.kind), step.input, attempt)


def save(session: Session, claim: Claim, state: StepState, report: dict[str, Any], seconds: float) -> bool:
    """Ends the step with its report, if it is still held; the caller holds the job's lock."""
    held = (StepRow.id == claim.step_id, leases.held(StepRow, claim.token))
    if not transition(session, StepRow, state, *held, report=report, seconds=seconds, lease_until=None):
        return False
    events.emit(session, jobs.get(session, claim.job_id), "step", {"kind": claim.kind, "state": state, "seconds": seconds})
    return True


def skip(session: Session, job_id: str) -> tuple[str, ...]:
    """Skips the job's unfinished steps, except that certified polytopes are still accepted; returns the messages that hold some."""
    where = (StepRow.job_id == job_id, StepRow.kind != StepKind.ACCEPT, StepRow.state.in_(UNFINISHED))
    holding = session.scalars(select(StepRow.task_id).where(*where, StepRow.state == StepState.RUNNING)).all()
    transition(session, StepRow, StepState.SKIPPED, *where)
    return tuple(task_id for task_id in holding if task_id)


def supersede(session: Session, job: JobRow) -> None:
    """Skips the regions that nobody has begun to accept: a later one has been reached."""
    transition(
        session, StepRow, StepState.SKIPPED, StepRow.job_id == job.id, StepRow.kind == StepKind.ACCEPT, StepRow.state == StepState.OPEN
    )


def of_turn(session: Session, job: JobRow, kind: StepKind) -> StepRow | None:
    """The step of this kind that the job's present turn asked for."""
    return session.scalar(select(StepRow).where(StepRow.job_id == job.id, StepRow.turn == job.turn, StepRow.kind == kind))


def of_job(session: Session, job_id: str) -> Sequence[StepRow]:
    """The job's steps, in order."""
    return session.scalars(select(StepRow).where(StepRow.job_id == job_id).order_by(StepRow.turn, StepRow.id)).all()


def accepted(session: Session, job_id: str) -> list[StepRow]:
    """The job's steps that accept a region, in order, whatever came of them."""
    return [step for step in of_job(session, job_id) if step.kind == StepKind.ACCEPT]
