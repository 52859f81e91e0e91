"""This module says how many pairs of the last iteration of jobs are settled, out of all pairs of the scene that it is about.

A pair is settled when all of its parts have their outcome, when the proof of an earlier iteration serves here too, or when it belongs to
the group of such a pair. A pair that was skipped is not.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple, cast

from sqlalchemy import ColumnElement, func, select, tuple_
from sqlalchemy.orm import Session

from db.models import IterationRow, JobRow, PairRow
from db.states import IterationState, PairState

_UNSETTLED = (PairState.OPEN, PairState.RUNNING, PairState.SKIPPED)
_KEYS = {"sqlite": "json_each", "postgresql": "json_object_keys"}
"""The database's function that lists what an object of JSON has."""


class Version(NamedTuple):
    """Says which state of a job its progress is that of: every move of a pair changes the counts, and every iteration the turn."""

    job_id: str
    turn: int
    event_seq: int
    pieces: int | None
    open_pairs: int
    running_pairs: int


def version(row: JobRow) -> Version:
    """Returns what changes whenever the progress of the job does."""
    return Version(row.id, row.turn, row.event_seq, row.pieces, row.open_pairs, row.running_pairs)


def of_jobs(session: Session, rows: Iterable[JobRow]) -> dict[Version, tuple[int, int]]:
    """Returns (settled pairs, pairs) of the last iteration of these jobs; nothing of a job without iterations."""
    known = {row.id: row for row in rows if row.pieces is not None}
    if not known:
        return {}
    last = select(IterationRow.job_id, func.max(IterationRow.index).label("index")).where(IterationRow.job_id.in_(known))
    newest = last.group_by(IterationRow.job_id).subquery()
    is_last = (IterationRow.job_id == newest.c.job_id) & (IterationRow.index == newest.c.index)
    columns = (
        IterationRow.job_id,
        IterationRow.index.label("number"),
        IterationRow.state,
        IterationRow.together,
        IterationRow.parts,
        _size(session),
    )
    iterations = session.execute(select(*columns).join(newest, is_last)).all()
    # Where every row is a pair, the job counts those that are open or running, of which there may be 100 000.
    counted = {one.job_id for one in iterations if one.state == IterationState.RUNNING and not one.parts and not one.together}
    left: dict[str, list[int]] = {}
    for states, some in (((PairState.SKIPPED,), counted), (_UNSETTLED, known.keys() - counted)):
        left |= in_states(session, states, [(one.job_id, one.number) for one in iterations if one.job_id in some])
    found = {}
    for job_id, _, _, together, parts, reused in iterations:
        row, groups = known[job_id], {int(first): len(others) for first, others in together.items()}
        total = (row.pieces or 0) - sum(number - 1 for number in parts.values()) + sum(groups.values()) + reused
        unsettled = sum(1 + groups.get(pair, 0) for pair in left.get(job_id, ()))
        if job_id in counted:
            unsettled += row.open_pairs + row.running_pairs
        found[version(row)] = total - unsettled, total
    return found


def in_states(session: Session, states: Collection[PairState], iterations: Sequence[tuple[str, int]]) -> dict[str, list[int]]:
    """Returns the indices of the pairs of which a part is in one of the states in these iterations (job, index), by the job."""
    of_these = tuple_(PairRow.job_id, PairRow.iteration).in_(iterations)
    query = select(PairRow.job_id, PairRow.pair_index).where(of_these, PairRow.state.in_(states)).distinct()
    found: dict[str, list[int]] = {}
    for job_id, pair in session.execute(query) if iterations else ():
        found.setdefault(job_id, []).append(pair)
    return found


def _size(session: Session) -> ColumnElement[int]:
    """Returns how many pairs an iteration reuses, which the database counts: the object may be as long as the scene has pairs."""
    keys = getattr(func, _KEYS[session.get_bind().dialect.name])(IterationRow.reuse).table_valued("key")
    return cast("ColumnElement[int]", select(func.count()).select_from(keys).correlate(IterationRow).scalar_subquery())
