"""Iterations and their pairs: made together, claimed in batches, saved with their proofs, ended early by the first failure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sqlalchemy import ColumnElement, Select, insert, select
from sqlalchemy.orm import Session

from db import events, jobs, leases, proofs
from db.models import IterationRow, JobRow, PairRow
from db.states import PAIR, IterationState, JobState, PairState, transition, unfinished
from db.types import utcnow

UNFINISHED = unfinished(PAIR)


@dataclass(frozen=True)
class NewPair:
    """A pair to certify: its position in Scene.pairs, the names of its geometries, the seconds it is expected to take."""

    index: int
    a: str
    b: str
    forecast_seconds: float


@dataclass(frozen=True)
class Claimed:
    """A pair to certify now; ``attempt`` counts from 1."""

    index: int
    attempt: int


@dataclass(frozen=True)
class Claim:
    """Pairs of one iteration, held under one token."""

    token: str
    job_id: str
    scene_id: str
    iteration: int
    pairs: tuple[Claimed, ...]


@dataclass(frozen=True)
class Result:
    """What came of one pair; the fields are those of certifier.pair.PairResult, and the CirisError document of an ``error``."""

    index: int
    state: PairState
    seconds: float
    stage: str | None = None
    margin: float | None = None
    detail: str = ""
    witness_s: list[float] | None = None
    weak_points: dict[str, Any] | None = None
    proof: bytes | None = None
    error: dict[str, Any] | None = None


@dataclass(frozen=True)
class Saved:
    """What saving changed.

    Attributes:
        held: False when some of the pairs were not held any more; their results were dropped.
        finished: True for the one saving after which the iteration has no open or running pair.
        stopped: messages under which other workers hold pairs of this iteration that are not needed any more.
    """

    held: bool
    finished: bool
    stopped: tuple[str, ...] = ()


def add_iteration(
    session: Session,
    job: JobRow,
    *,
    index: int,
    label: str,
    C: ArrayLike,
    d: ArrayLike,
    center: ArrayLike | None,
    pairs: Sequence[NewPair],
    reuse: Mapping[int, int],
    stop_at_first_failure: bool,
) -> None:
    """Adds an iteration and its pairs; one without pairs is certified at once. The caller holds the job's lock."""
    now = utcnow()
    certified = {} if pairs else {"state": IterationState.CERTIFIED, "finished_at": now}
    session.add(
        IterationRow(
            job_id=job.id,
            index=index,
            label=label,
            arrays={"C": np.asarray(C), "d": np.asarray(d), **({} if center is None else {"center": np.asarray(center)})},
            reuse={str(pair): iteration for pair, iteration in reuse.items()},
            stop_at_first_failure=stop_at_first_failure,
            **certified,
        )
    )
    if pairs:
        session.execute(
            insert(PairRow),
            [
                {
                    "job_id": job.id,
                    "iteration": index,
                    "pair_index": p.index,
                    "a": p.a,
                    "b": p.b,
                    "forecast_seconds": p.forecast_seconds,
                    "sent_at": now,
                }
                for p in pairs
            ],
        )
    events.emit(session, job, "iteration", {"index": index, "label": label, "state": "running", "pairs": len(pairs), "reused": len(reuse)})


def claim(
    session: Session, job_id: str, iteration: int, indices: Sequence[int], *, task_id: str | None, lease_seconds: float
) -> Claim | None:
    """Claims what is free among these pairs: all that were never begun, or else one that was (its worker died, perhaps because of it).

    None when there is nothing to do: done, skipped, held by someone else, or the job is not running.
    """
    job = jobs.lock(session, job_id)
    if job.state != JobState.RUNNING:
        return None
    now, wanted = utcnow(), {index: place for place, index in enumerate(indices)}
    rows = session.scalars(_pairs(job_id, iteration).where(PairRow.pair_index.in_(indices), PairRow.state.in_(UNFINISHED))).all()
    free = sorted((row for row in rows if leases.is_free(row, now)), key=lambda row: wanted[row.pair_index])
    chosen = [row for row in free if row.attempts == 0] or free[:1]
    if not chosen:
        return None
    pairs = tuple(Claimed(row.pair_index, row.attempts + 1) for row in chosen)
    token = leases.take(session, PairRow, chosen, task_id=task_id, seconds=lease_seconds)
    return Claim(token, job_id, job.scene_id, iteration, pairs)


def save(session: Session, claim: Claim, results: Sequence[Result], *, worth_stopping: float) -> Saved:
    """Saves results with their proofs, in one transaction, if they are still held.

    A first failure skips the iteration's other pairs, where it was asked for. Other workers' messages are named in ``stopped`` when
    the pair that they hold is expected to take more than ``worth_stopping`` seconds.
    """
    job = jobs.lock(session, claim.job_id)
    where = (PairRow.job_id == claim.job_id, PairRow.iteration == claim.iteration, leases.held(PairRow, claim.token))
    held = {row.pair_index: row for row in session.scalars(select(PairRow).where(*where))}
    saved = [result for result in results if result.index in held]
    if not saved:
        return Saved(held=False, finished=False)
    digests = proofs.put(session, [result.proof for result in saved if result.proof is not None])
    for state in {result.state for result in saved}:
        ids = [held[result.index].id for result in saved if result.state == state]
        transition(session, PairRow, state, PairRow.id.in_(ids), lease_until=None)
    for result in saved:
        row = held[result.index]
        row.stage, row.margin, row.seconds, row.detail = result.stage, result.margin, result.seconds, result.detail
        row.witness_s, row.weak_points = result.witness_s, result.weak_points
        row.proof_digest = None if result.proof is None else digests[result.proof]
    job.error = next((result.error for result in saved if result.error is not None), job.error)
    events.emit(session, job, "pairs", {"iteration": claim.iteration, "pairs": [_public(result) for result in saved]})
    label, stop_at_first_failure = session.execute(
        select(IterationRow.label, IterationRow.stop_at_first_failure).where(*_iteration(job.id, claim.iteration))
    ).one()
    stopped: tuple[str, ...] = ()
    if stop_at_first_failure and any(result.state != PairState.CERTIFIED for result in saved):
        stopped = skip(session, claim.job_id, worth_stopping=worth_stopping, but=claim.token)
    finished = _finish_iteration(session, job, claim.iteration, label)
    return Saved(held=len(saved) == len(results), finished=finished, stopped=stopped)


def skip(session: Session, job_id: str, *, worth_stopping: float, but: str | None = None) -> tuple[str, ...]:
    """Skips the job's unfinished pairs; returns the messages, except those held under the token ``but``, that are worth stopping."""
    where = (PairRow.job_id == job_id, PairRow.state.in_(UNFINISHED))
    running = session.scalars(
        select(PairRow).where(*where, PairRow.state == PairState.RUNNING, PairRow.forecast_seconds > worth_stopping)
    ).all()
    stopped = tuple(sorted({row.task_id for row in running if row.task_id and row.lease_token != but}))
    transition(session, PairRow, PairState.SKIPPED, *where)
    return stopped


def _finish_iteration(session: Session, job: JobRow, index: int, label: str) -> bool:
    """Settles the iteration if no pair of it is unfinished; True for the one call that does."""
    states = set(session.scalars(select(PairRow.state).distinct().where(PairRow.job_id == job.id, PairRow.iteration == index)))
    if states & UNFINISHED:
        return False
    state = IterationState.CERTIFIED if states <= {PairState.CERTIFIED} else IterationState.FAILED
    if not transition(session, IterationRow, state, *_iteration(job.id, index), finished_at=utcnow()):
        return False
    events.emit(session, job, "iteration", {"index": index, "label": label, "state": state})
    return True


def skip_iterations(session: Session, job_id: str) -> None:
    """Ends the job's running iterations as skipped; their pairs are seen to by :func:`skip`."""
    transition(session, IterationRow, IterationState.SKIPPED, IterationRow.job_id == job_id, finished_at=utcnow())


def of_iteration(session: Session, job_id: str, iteration: int) -> Sequence[PairRow]:
    """The pairs of one iteration, in the order of the scene's pairs."""
    return session.scalars(_pairs(job_id, iteration).order_by(PairRow.pair_index)).all()


def of_job(session: Session, job_id: str) -> Sequence[PairRow]:
    """The job's pair matrix: every pair of every iteration, in order."""
    return session.scalars(select(PairRow).where(PairRow.job_id == job_id).order_by(PairRow.iteration, PairRow.pair_index)).all()


def iterations(session: Session, job_id: str) -> Sequence[IterationRow]:
    """The job's iterations, in order."""
    return session.scalars(select(IterationRow).where(IterationRow.job_id == job_id).order_by(IterationRow.index)).all()


def proving(session: Session, job_id: str, iteration_of: Mapping[int, int]) -> dict[int, PairRow]:
    """Pair index -> the certified row of the iteration that holds its proof; rows that do not exist are absent."""
    rows = session.scalars(
        select(PairRow).where(
            PairRow.job_id == job_id,
            PairRow.iteration.in_(set(iteration_of.values())),
            PairRow.state == PairState.CERTIFIED,
        )
    )
    return {row.pair_index: row for row in rows if iteration_of.get(row.pair_index) == row.iteration}


def _iteration(job_id: str, index: int) -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    return IterationRow.job_id == job_id, IterationRow.index == index


def _pairs(job_id: str, iteration: int) -> Select[PairRow]:
    return select(PairRow).where(PairRow.job_id == job_id, PairRow.iteration == iteration)


def _public(result: Result) -> dict[str, Any]:
    return {"index": result.index, "state": result.state, "stage": result.stage, "margin": result.margin, "seconds": result.seconds}
