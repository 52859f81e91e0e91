"""This module makes iterations with their pairs, claims pairs in batches, and saves them with their proofs.

Pairs are claimed in the order in which they were added to their iteration. The first failures in this order, not the first in time,
end the iteration early. So the result of a job depends neither on the number of workers nor on what happens to them.

Claiming and saving read as many rows as they change, however many pairs there are. For this the job's row counts its open and running
pairs, and says where the open ones begin. A job has one iteration at a time with such pairs.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Row, Select, exists, func, insert, select, tuple_, update
from sqlalchemy.orm import Session, defer

from certifier import stored
from certifier.conditions import condition_named
from certifier.outcome import Outcome, combine
from certifier.pair.result import PairResult
from db import events, jobs, leases, proofs, solver_time, subtrees
from db.models import IterationRow, JobRow, PairRow
from db.session import without_sorting
from db.states import PAIR, IterationState, PairState, transition, transition_each, unfinished
from db.types import utcnow

UNFINISHED = unfinished(PAIR)
_OF_RESULTS = (
    PairRow.iteration,
    PairRow.pair_index,
    PairRow.state,
    PairRow.stage,
    PairRow.margin,
    PairRow.seconds,
    PairRow.open_cells,
    PairRow.detail,
    PairRow.worker,
    PairRow.witness_s,
    PairRow.proof_digest,
)
FAILED = frozenset(PairState) - UNFINISHED - {PairState.CERTIFIED, PairState.SKIPPED}
MOST_TOGETHER = 100
"""At most this many pairs are claimed together, however short they are."""
FEW, LONGER = 500, 10.0
"""With more open pairs than this, batches are longer in proportion, up to LONGER times."""


@dataclass(frozen=True)
class NewPair:
    """Describes a pair to certify, or a part of it: its position in Scene.pairs, the names of its geometries, and the seconds expected."""

    index: int
    a: str
    b: str
    forecast_seconds: float
    part: int = 0


@dataclass(frozen=True)
class Claimed:
    """Names a part of a pair to certify now. ``attempt`` counts from 1; ``deaths`` is how often it may have killed its process."""

    index: int
    part: int
    attempt: int
    deaths: int


@dataclass(frozen=True)
class Claim:
    """A claim holds pairs of one iteration under one token."""

    token: str
    job_id: str
    scene_id: str
    traceparent: str | None
    iteration: int
    pairs: tuple[Claimed, ...]


@dataclass(frozen=True)
class Saved:
    """Says what saving changed.

    Attributes:
        held: False when no pair of the claim is held any more. Results of pairs that were not held were dropped.
        finished: True for the one saving after which the iteration has no open or running pair.
    """

    held: bool
    finished: bool


def add_iteration(session: Session, job: JobRow, action: dict[str, Any], pairs: Sequence[NewPair]) -> None:
    """Adds an iteration and its pairs. An iteration without pairs is certified at once. The caller holds the job's lock.

    Args:
        action: the document of the certifier.growth.actions.Certify that asks for it.
    """
    index, label, reuse = action["iteration"], action["label"], action["reuse"]
    certified = {} if pairs else {"state": IterationState.CERTIFIED, "finished_at": utcnow()}
    known = {name: action[name] for name in ("reuse", "failures", "parts", "together")}
    faces = len(action["polytope"]["d"])
    session.add(IterationRow(job_id=job.id, index=index, label=label, faces=faces, action=action, **known, **certified))
    if pairs:
        session.connection().execute(  # the session would take twice as long
            insert(PairRow),
            [
                {
                    "job_id": job.id,
                    "iteration": index,
                    "pair_index": p.index,
                    "part": p.part,
                    "a": p.a,
                    "b": p.b,
                    "forecast_seconds": p.forecast_seconds,
                }
                for p in pairs
            ],
        )
        job.open_pairs += len(pairs)
    job.pieces = len(pairs)
    together = sum(map(len, action["together"].values()))
    counts = {"pairs": len({pair.index for pair in pairs}) + together, "parts": len(pairs), "together": together, "reused": len(reuse)}
    events.emit(session, job, "iteration", {"index": index, "label": label, "state": "running", **counts})


def batch(pairs: Iterable[tuple[int, float]], seconds: float) -> list[int]:
    """Returns the indices of the first pairs, in the order given, whose forecasts sum to at most ``seconds``; at least one.

    Args:
        pairs: (pair index, forecast in seconds).
    """
    chosen: list[int] = []
    filled = 0.0
    for index, forecast in pairs:
        filled += forecast
        if chosen and filled > seconds:
            break
        chosen.append(index)
    return chosen


def claim(session: Session, job: JobRow, *, lease_seconds: float, batch_seconds: float) -> Claim | None:
    """Claims the next batch of the job's open pairs. A pair that may have killed its process is claimed alone, after the others.

    A batch takes ``batch_seconds``, and the longer, the more pairs are open: then many workers ask, and it is long until one of them would
    wait for another at the end. It returns None when no pair is open. The caller holds the job's lock.
    """
    if job.open_pairs == 0:
        return None
    work = (PairRow.id, PairRow.iteration, PairRow.pair_index, PairRow.part)
    columns = (*work, PairRow.forecast_seconds, PairRow.attempts, PairRow.deaths)
    is_open = (PairRow.job_id == job.id, PairRow.state == PairState.OPEN)
    ahead = tuple_(PairRow.deaths, PairRow.id) >= tuple_(0, job.next_pair)
    first = select(*columns).where(*is_open, ahead).order_by(PairRow.deaths, PairRow.id).limit(MOST_TOGETHER)
    without_sorting(session)
    rows = session.execute(first).all()
    fresh = [row for row in rows if row.deaths == 0]
    seconds = batch_length(job.open_pairs, batch_seconds)
    chosen = fresh[: len(batch(((row.pair_index, row.forecast_seconds) for row in fresh), seconds))] or rows[:1]
    pairs = tuple(Claimed(row.pair_index, row.part, row.attempts + 1, row.deaths) for row in chosen)
    jobs.charge(session, job, sum(row.forecast_seconds for row in chosen))
    token = leases.take(session, PairRow, [row.id for row in chosen], seconds=lease_seconds)
    jobs.claimed(job)
    job.open_pairs -= len(chosen)
    job.running_pairs += len(chosen)
    if fresh:
        job.next_pair = chosen[-1].id + 1
    return Claim(token, job.id, job.scene_id, job.traceparent, chosen[0].iteration, pairs)


def batch_length(open_pairs: int, batch_seconds: float) -> float:
    """Returns the seconds of a batch of a job with this many open pairs."""
    return batch_seconds * min(max(open_pairs / FEW, 1.0), LONGER)


def release(session: Session, job: JobRow, lost: leases.Lost) -> list[PairRow]:
    """Opens the pairs of a lost lease and returns them. The caller holds the job's lock."""
    rows = leases.release(session, PairRow, lost)
    _opened(job, rows)
    return rows


def give_back(session: Session, claim: Claim) -> None:
    """Opens the pairs of a claim that its holder has not begun, as if they had not been claimed."""
    job = jobs.lock(session, claim.job_id)
    rows = session.scalars(select(PairRow).where(leases.held(PairRow, claim.token))).all()
    transition(session, PairRow, PairState.OPEN, leases.held(PairRow, claim.token), attempts=PairRow.attempts - 1)
    _opened(job, rows)
    jobs.charge(session, job, -sum(row.forecast_seconds for row in rows))


def _opened(job: JobRow, rows: Sequence[PairRow]) -> None:
    """Counts pairs of the job as open that were running."""
    job.open_pairs += len(rows)
    job.running_pairs -= len(rows)
    job.next_pair = min([job.next_pair, *(row.id for row in rows if row.deaths == 0)])


def save(session: Session, claim: Claim, results: Mapping[tuple[int, int], PairResult]) -> Saved:
    """Saves the results of pairs that are still held, with their proofs and subtrees, in one transaction.

    When enough pairs have failed, it skips the unfinished pairs after them. A worker that holds one of those is stopped (leases.kept).

    Args:
        results: (pair index, part) -> result.
    """
    job = jobs.lock(session, claim.job_id)
    columns = (PairRow.pair_index, PairRow.part, PairRow.id, PairRow.forecast_seconds, PairRow.a, PairRow.b, PairRow.worker)
    rows = session.execute(select(*columns).where(leases.held(PairRow, claim.token))).all()
    held = {(row.pair_index, row.part): row.id for row in rows}
    saved = {work: result for work, result in results.items() if work in held}
    if not saved:
        return Saved(held=False, finished=False)
    digests = proofs.put(session, [result.proof for result in saved.values() if result.proof is not None])
    moves = {held[work]: (state_of(result), _columns(result, digests)) for work, result in saved.items()}
    transition_each(session, PairRow, PairState.RUNNING, moves)
    left = {work: (r.subtrees, r.outline) for work, r in saved.items() if r.subtrees is not None}
    subtrees.keep(session, job.id, claim.iteration, left)
    job.running_pairs -= len(saved)
    charged = sum(row.forecast_seconds for row in rows if (row.pair_index, row.part) in saved)
    jobs.charge(session, job, sum(result.seconds for result in saved.values()) - charged)
    job.error = next((result.error for result in saved.values() if result.error is not None), job.error)
    of_conditions = {row.pair_index for row in rows if condition_named(row.a, row.b) is not None}
    public = [_public(*work, result, work[0] in of_conditions) for work, result in saved.items()]
    events.emit(session, job, "pairs", {"iteration": claim.iteration, "worker": rows[0].worker, "pairs": public})
    rest = [pair for work, pair in held.items() if work not in saved]
    if FAILED.intersection(map(state_of, saved.values())) and (last := _last_failure(session, job.id, claim.iteration)) is not None:
        skip(session, job, PairRow.iteration == claim.iteration, PairRow.id > last)
        rest = [pair for pair in rest if pair <= last]
    finished = job.open_pairs == job.running_pairs == 0 and _finish_iteration(session, job, claim.iteration)
    solver_time.add(session, job.project, sum(result.seconds for result in saved.values()), job.key_id)
    return Saved(bool(rest), finished)


def skip(session: Session, job: JobRow, *which: ColumnElement[bool]) -> None:
    """Skips the job's unfinished pairs: all of them, or those that match the conditions. The caller holds the job's lock."""
    mine = (PairRow.job_id == job.id, *which)
    job.open_pairs -= transition(session, PairRow, PairState.SKIPPED, *mine, PairRow.state == PairState.OPEN)
    job.running_pairs -= transition(session, PairRow, PairState.SKIPPED, *mine, PairRow.state == PairState.RUNNING)


def _last_failure(session: Session, job_id: str, iteration: int) -> int | None:
    """Returns the id of the failed pair that ends the iteration early; None as long as more failures are needed or none ends it."""
    enough = session.scalar(select(IterationRow.failures).where(*_iteration(job_id, iteration)))
    if enough is None:
        return None
    # One query a state, in the order of the index: so the databases use it even when they know nothing about the table yet.
    without_sorting(session)
    mine = select(PairRow.id).where(PairRow.job_id == job_id, PairRow.iteration == iteration).order_by(PairRow.deaths, PairRow.id)
    failed = sorted(pair for state in FAILED for pair in session.scalars(mine.where(PairRow.state == state)))
    return failed[enough - 1] if len(failed) >= enough else None


def _finish_iteration(session: Session, job: JobRow, index: int) -> bool:
    """Settles an iteration that has no unfinished pair. Returns True for the one call that does it."""
    failed = exists().where(PairRow.job_id == job.id, PairRow.iteration == index, PairRow.state != PairState.CERTIFIED)
    state = IterationState.FAILED if session.scalar(select(failed)) else IterationState.CERTIFIED
    if not transition(session, IterationRow, state, *_iteration(job.id, index), finished_at=utcnow()):
        return False
    label = session.scalar(select(IterationRow.label).where(*_iteration(job.id, index)))
    events.emit(session, job, "iteration", {"index": index, "label": label, "state": state})
    return True


def skip_iterations(session: Session, job_id: str) -> None:
    """Ends the job's running iterations as skipped. :func:`skip` takes care of their pairs."""
    transition(session, IterationRow, IterationState.SKIPPED, IterationRow.job_id == job_id, finished_at=utcnow())


def reached(session: Session, iteration: IterationRow) -> Sequence[PairRow]:
    """Returns the settled pairs of an iteration, in the order of claiming, up to the failure that ended it.

    Pairs after that failure are left out, even if they were settled too.
    """
    rows = session.scalars(_pairs(iteration.job_id, iteration.index).where(PairRow.state != PairState.SKIPPED).order_by(PairRow.id)).all()
    places = [place for place, row in enumerate(rows, start=1) if row.state != PairState.CERTIFIED]
    if iteration.failures is not None and len(places) >= iteration.failures:
        rows = rows[: places[iteration.failures - 1]]
    return rows


def forget_weaknesses(session: Session, job_id: str, iteration: int) -> None:
    """Deletes where the pairs of an iteration failed. Nobody asks once the next action is decided, and it is up to 50 kB a pair."""
    mine = (PairRow.job_id == job_id, PairRow.iteration == iteration, PairRow.weakness.is_not(None))
    session.execute(update(PairRow).where(*mine).values(weakness=None))


def of_iteration(session: Session, job_id: str, iteration: int, pair: int) -> Sequence[PairRow]:
    """Returns the parts of a pair in one iteration, in order, or of the pair that it is certified with as one; none where it has none."""
    found = session.get(IterationRow, (job_id, iteration))
    return [] if found is None else _parts(session, found, leader(found, pair))


def _parts(session: Session, iteration: IterationRow, pair: int) -> Sequence[PairRow]:
    query = _pairs(iteration.job_id, iteration.index).where(PairRow.pair_index == pair).order_by(PairRow.part)
    return session.scalars(query).all()


def lately_failed(session: Session, job_id: str) -> dict[int, list[PairRow]]:
    """Returns pair index -> the parts of the pair where it failed last, in the last iteration or the one before, unless it is certified.

    While an iteration runs, most of what is known of its pairs is from the one before.
    """
    last = session.scalar(select(func.max(IterationRow.index)).where(IterationRow.job_id == job_id))
    if last is None:
        return {}
    reuse = session.get_one(IterationRow, (job_id, last)).reuse
    found: dict[int, list[PairRow]] = {}
    for iteration in (last - 1, last):
        settled: dict[int, list[PairRow]] = {}
        for row in session.scalars(_pairs(job_id, iteration).where(PairRow.state.not_in(UNFINISHED)).order_by(PairRow.part)):
            settled.setdefault(row.pair_index, []).append(row)
        for index, parts in settled.items():
            failed = [row for row in parts if row.state in FAILED]
            if failed:
                found[index] = failed
            elif iteration == last and all(row.state == PairState.CERTIFIED for row in parts):
                found.pop(index, None)
    return {index: parts for index, parts in found.items() if str(index) not in reuse}


def leader(iteration: IterationRow, pair: int) -> int:
    """Returns the pair that has the rows of this pair's group; the pair itself where it has rows of its own."""
    return next((int(first) for first, others in iteration.together.items() if pair in others), pair)


def with_pair(session: Session, job_id: str, pair: int, iteration: int | None) -> tuple[IterationRow, Sequence[PairRow]] | None:
    """Returns the iteration that a pair's result is from, and the parts of the pair in it, in order.

    Args:
        iteration: the iteration that is asked about, in which a proof of an earlier one may serve; None for the last one.

    Returns:
        None where there is no such iteration, or where it does not have the pair.
    """
    last = select(func.max(IterationRow.index)).where(IterationRow.job_id == job_id)
    found = session.get(IterationRow, (job_id, session.scalar(last) if iteration is None else iteration))
    if found is None:
        return None
    pair = leader(found, pair)
    if (source := found.reuse.get(str(pair))) is not None:
        found = session.get_one(IterationRow, (job_id, source))
    rows = _parts(session, found, pair)
    return (found, rows) if rows else None


def parts_of(session: Session, job_id: str, pair: int, iterations: Iterable[int]) -> dict[int, int]:
    """Returns iteration -> how many parts the pair has in it, for these iterations."""
    mine = (IterationRow.job_id == job_id, IterationRow.index.in_(list(iterations)))
    return {index: parts.get(str(pair), 1) for index, parts in session.execute(select(IterationRow.index, IterationRow.parts).where(*mine))}


def page(
    session: Session,
    job_id: str,
    *,
    iteration: int | None = None,
    only: Collection[int] | None = None,
    after: tuple[int, int] | None = None,
    limit: int,
) -> tuple[Sequence[Row[*tuple[Any, ...]]], tuple[int, int] | None]:
    """Returns one page of the job's pair matrix, in order: in every iteration every pair, with all of its parts.

    Args:
        iteration, only: leave out other iterations, and pairs with other indices.
        after: the page begins after this pair in this iteration, (iteration, pair index).
        limit: at most this many pairs.

    Returns:
        The columns of ``_OF_RESULTS``, and what is ``after`` for the next page; None on the last page. They are no rows of PairRow,
        of which 5000 take a tenth of a second.
    """
    place = (PairRow.iteration, PairRow.pair_index)
    query = select(*_OF_RESULTS).where(PairRow.job_id == job_id)
    if iteration is not None:
        query = query.where(PairRow.iteration == iteration)
    if only is not None:
        query = query.where(PairRow.pair_index.in_(only))
    if after is not None:
        query = query.where(tuple_(*place) > tuple_(*after))
    firsts = query.with_only_columns(*place).where(PairRow.part == 0).order_by(*place)
    last_and_next = session.execute(firsts.offset(limit - 1).limit(2)).all()
    end = (last_and_next[0].iteration, last_and_next[0].pair_index) if len(last_and_next) == 2 else None
    if end is not None:
        query = query.where(tuple_(*place) <= tuple_(*end))
    return session.execute(query.order_by(*place, PairRow.part)).all(), end


def states(session: Session, job_id: str, since: int) -> dict[int, dict[int, PairState]]:
    """Returns iteration -> pair index -> the pair's state, for the iterations from ``since`` on.

    It reads columns and makes no rows, because a job may have 100 000 of them.
    """
    columns = (PairRow.iteration, PairRow.pair_index, PairRow.state)
    query = select(*columns).where(PairRow.job_id == job_id, PairRow.iteration >= since)
    found: dict[int, dict[int, PairState]] = {}
    parts: dict[tuple[int, int], list[PairState]] = {}
    for iteration, pair, value in session.execute(query):
        known, state = found.setdefault(iteration, {}), PairState(value)
        if pair in known:
            parts.setdefault((iteration, pair), [known[pair]]).append(state)
        else:
            known[pair] = state
    for (iteration, pair), states in parts.items():
        found[iteration][pair] = state_of_parts(states)
    return found


def iterations(session: Session, job_id: str) -> Sequence[IterationRow]:
    """Returns the job's iterations, in order, without their actions."""
    query = select(IterationRow).where(IterationRow.job_id == job_id).order_by(IterationRow.index)
    return session.scalars(query.options(defer(IterationRow.action, raiseload=True))).all()


def begun(session: Session, job_id: str) -> int:
    """Returns how many iterations the job has begun."""
    return session.scalar(select(func.count()).select_from(IterationRow).where(IterationRow.job_id == job_id)) or 0


def seconds(session: Session, job_id: str) -> float:
    """Returns the seconds that all pairs of the job took together."""
    return session.scalar(select(func.sum(PairRow.seconds)).where(PairRow.job_id == job_id)) or 0.0


@dataclass(frozen=True)
class Pace:
    """Says how fast the pieces of an iteration, which are pairs or parts of pairs, are settled.

    Attributes:
        settled, left: number of pieces that are settled, and of those that are not.
        spent: seconds that the settled ones took together.
        expected, error: seconds that the others will take together, if they are to their forecasts as the settled ones are to theirs; and
            the standard error of this.
    """

    settled: int
    left: int
    spent: float
    expected: float
    error: float


def pace(session: Session, job_id: str, iteration: int) -> Pace | None:
    """Returns the pace of an iteration; None before two of its pieces are settled."""
    mine = (PairRow.job_id == job_id, PairRow.iteration == iteration)
    took, forecast = PairRow.seconds, PairRow.forecast_seconds
    squares = (func.sum(took * took), func.sum(took * forecast), func.sum(forecast * forecast))
    sums = select(func.count(), func.sum(took), func.sum(forecast), *squares)
    n, s, f, ss, sf, ff = session.execute(sums.where(*mine, took.is_not(None))).one()
    left, waiting = session.execute(select(func.count(), func.sum(forecast)).where(*mine, PairRow.state.in_(UNFINISHED))).one()
    if n < 2 or not f or not s:
        return None
    ratio, ahead = s / f, waiting or 0.0
    variance = max((ss or 0.0) - 2 * ratio * (sf or 0.0) + ratio**2 * (ff or 0.0), 0.0) / (n - 1)
    return Pace(n, left, s, ratio * ahead, math.sqrt(variance * (left + n * (ahead / f) ** 2)))


def expected_seconds(session: Session, job_id: str, iteration: int) -> dict[int, float]:
    """Returns pair index -> seconds: what a part of the pair took in that iteration, or its forecast where it was not settled.

    The result is empty when there is no such iteration.
    """
    expected = func.avg(func.coalesce(PairRow.seconds, PairRow.forecast_seconds)).label("expected")
    mine = (PairRow.job_id == job_id, PairRow.iteration == iteration)
    query = select(PairRow.pair_index, expected).where(*mine).group_by(PairRow.pair_index)
    return {row.pair_index: row.expected for row in session.execute(query)}


def proving(session: Session, job_id: str, iteration_of: Mapping[int, int]) -> dict[int, PairRow]:
    """Returns pair index -> the certified row of the iteration that holds the pair's proof. Missing rows are left out.

    The first part of a pair has the proof. The caller knows that the other parts are certified as well.
    """
    rows = session.scalars(
        select(PairRow).where(
            PairRow.job_id == job_id,
            PairRow.iteration.in_(set(iteration_of.values())),
            PairRow.state == PairState.CERTIFIED,
            PairRow.part == 0,
        )
    )
    return {row.pair_index: row for row in rows if iteration_of.get(row.pair_index) == row.iteration}


def _iteration(job_id: str, index: int) -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    return IterationRow.job_id == job_id, IterationRow.index == index


def _pairs(job_id: str, iteration: int) -> Select[PairRow]:
    return select(PairRow).where(PairRow.job_id == job_id, PairRow.iteration == iteration)


def state_of(result: PairResult) -> PairState:
    """Returns the state of a settled pair, which is its outcome."""
    return PairState(result.outcome.value)


def state_of_parts(states: Sequence[PairState]) -> PairState:
    """Returns the state of a pair from those of its parts: unfinished while one of them is, then the worst."""
    if set(states) == {PairState.OPEN}:
        return PairState.OPEN
    if UNFINISHED.intersection(states):
        return PairState.RUNNING
    if PairState.SKIPPED in states:
        return PairState.SKIPPED
    return PairState(combine([Outcome(state) for state in states]))


def _columns(result: PairResult, digests: Mapping[bytes, str]) -> dict[str, Any]:
    return {
        "lease_until": None,
        "proof_digest": None if result.proof is None else digests[result.proof],
        "stage": result.stage,
        "margin": result.margin,
        "seconds": result.seconds,
        "detail": result.detail,
        "open_cells": result.open_cells,
        "witness_s": None if result.witness_s is None else result.witness_s.tolist(),
        "weakness": None if result.weakness is None else stored.document(result.weakness),
    }


def _public(index: int, part: int, result: PairResult, of_condition: bool) -> dict[str, Any]:
    distance = None if of_condition else result.margin  # What stands for a condition has no distance in metres.
    return {
        "index": index,
        "part": part,
        "state": state_of(result),
        "stage": result.stage,
        "proved_distance": distance,
        "margin": distance,
        "seconds": result.seconds,
        "cells": result.looked,
    }
