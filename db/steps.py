"""Steps are the pieces of a job that are not pairs: seeding, the polytope step, accepting a region, a look at what is covered, a motion, a
map and the pieces of its rounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from db import events, jobs, leases, proofs
from db.models import JobRow, StepRow
from db.states import ACCEPT, PIECE, STEP, StepState, transition, unfinished

UNFINISHED = unfinished(STEP)


@dataclass(frozen=True)
class Claim:
    """A claim holds a step under a token, with what is needed to do it. ``attempt`` and ``deaths`` are as in db.pairs.Claimed."""

    token: str
    step_id: int
    job_id: str
    scene_id: str
    traceparent: str | None
    job_kind: str
    kind: str
    input: dict[str, Any]
    attempt: int
    deaths: int


def add(session: Session, job: JobRow, kind: str, input: dict[str, Any]) -> StepRow:
    """Adds a step of the job's present turn. The caller holds the job's lock."""
    step = StepRow(job_id=job.id, turn=job.turn, kind=kind, input=input)
    session.add(step)
    session.flush()
    events.emit(session, job, "step", {"kind": kind, "state": StepState.OPEN})
    return step


def claim(session: Session, job: JobRow, *, accepts: bool, lease_seconds: float, pieces: bool = False, fresh: bool = False) -> Claim | None:
    """Claims the job's latest open step: one that accepts a region, or one that the job waits for. Returns None without one.

    The caller holds the job's lock.

    Args:
        pieces: whether to claim a piece of a map's round only.
        fresh: whether to claim a step only that nobody has begun before.
    """
    query = select(StepRow).where(is_open(StepRow, job.id, accepts=accepts))
    if fresh:
        query = query.where(StepRow.attempts == 0)
    if pieces:
        query = query.where(StepRow.kind == PIECE)
    step = session.scalar(query.order_by(StepRow.turn.desc(), StepRow.id).limit(1))
    if step is None:
        return None
    attempt, deaths = step.attempts + 1, step.deaths
    token = leases.take(session, StepRow, [step.id], seconds=lease_seconds)
    jobs.claimed(job)
    return Claim(token, step.id, job.id, job.scene_id, job.traceparent, job.kind, step.kind, step.input, attempt, deaths)


def save(session: Session, claim: Claim, state: StepState, report: dict[str, Any], seconds: float) -> bool:
    """Ends the step with its report if it is still held, and says whether it was. The caller holds the job's lock.

    A region that was accepted replaces those certified before it that nobody has begun to accept.
    """
    held = (StepRow.id == claim.step_id, leases.held(StepRow, claim.token))
    if not transition(session, StepRow, state, *held, report=report, seconds=seconds, lease_until=None):
        return False
    job = jobs.get(session, claim.job_id)
    jobs.charge(session, job, seconds)
    if claim.kind != PIECE:
        events.emit(session, job, "step", {"kind": claim.kind, "state": state, "seconds": seconds, "worker": leases.this_worker()})
    if claim.kind == ACCEPT and state == StepState.DONE:
        turn = select(StepRow.turn).where(StepRow.id == claim.step_id).scalar_subquery()
        earlier = (StepRow.job_id == job.id, StepRow.kind == ACCEPT, StepRow.turn < turn)
        transition(session, StepRow, StepState.SKIPPED, *earlier, StepRow.state == StepState.OPEN)
    return True


def keep_proof(session: Session, claim: Claim, proof: bytes) -> None:
    """Stores the proof of the motion or the map that the step has certified. The caller holds the job's lock."""
    session.get_one(StepRow, claim.step_id).proof_digest = proofs.put(session, [proof])[proof]


def is_open(step: type[StepRow], job_id: str | InstrumentedAttribute[str], *, accepts: bool) -> ColumnElement[bool]:
    """Returns the condition that the step is an open one of the job: one that accepts a region, or one that the job waits for."""
    return (step.job_id == job_id) & (step.state == StepState.OPEN) & ((step.kind == ACCEPT) == accepts)


def skip(session: Session, job_id: str) -> None:
    """Skips the job's unfinished steps, but not those that accept certified polytopes."""
    where = (StepRow.job_id == job_id, StepRow.kind != ACCEPT, StepRow.state.in_(UNFINISHED))
    transition(session, StepRow, StepState.SKIPPED, *where)


def of_turn(session: Session, job: JobRow, kind: str) -> StepRow | None:
    """Returns the step of this kind that the job's present turn asked for."""
    return session.scalar(select(StepRow).where(StepRow.job_id == job.id, StepRow.turn == job.turn, StepRow.kind == kind))


def of_job(session: Session, job_id: str) -> Sequence[StepRow]:
    """Returns the job's steps, in order."""
    return session.scalars(select(StepRow).where(StepRow.job_id == job_id).order_by(StepRow.turn, StepRow.id)).all()


def found(session: Session, job_id: str, kind: str) -> dict[str, Any] | None:
    """Returns the report of the job's step of this kind; None while there is none, or where the step has failed."""
    done = (StepRow.job_id == job_id, StepRow.kind == kind, StepRow.state == StepState.DONE)
    return session.scalar(select(StepRow.report).where(*done))


def accepted(session: Session, job_id: str) -> list[StepRow]:
    """Returns the job's steps that accept a region, in order, whatever their result."""
    return [step for step in of_job(session, job_id) if step.kind == ACCEPT]
