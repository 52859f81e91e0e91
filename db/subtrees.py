"""Subtrees are what searches leave of pairs that they have not certified, for later iterations to go on with.

They stand apart from the proofs, because they prove nothing and must not be served as if they did. A job has those of its open pairs only.
Each has an outline, which has the state of each cell. Outlines stay when the job has ended.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from sqlalchemy import delete, func, insert, select, update
from sqlalchemy.orm import Session

from db.models import IterationRow, PairRow, SubtreesRow
from db.states import PairState


def keep(session: Session, job_id: str, iteration: int, left: Mapping[tuple[int, int], tuple[bytes, bytes | None]]) -> None:
    """Keeps what an iteration has left. The caller holds the job's lock.

    Args:
        left: (pair index, part) -> the subtrees, and their outline.
    """
    rows = [
        {"job_id": job_id, "pair_index": pair, "iteration": iteration, "part": part, "data": data, "outline": outline}
        for (pair, part), (data, outline) in left.items()
    ]
    if rows:
        session.execute(insert(SubtreesRow), rows)


def left_of(session: Session, job_id: str, pair: int, iteration: int) -> list[bytes]:
    """Returns what the iteration has left of the pair, in the order of its parts."""
    mine = (SubtreesRow.job_id == job_id, SubtreesRow.pair_index == pair, SubtreesRow.iteration == iteration)
    return list(session.scalars(select(SubtreesRow.data).where(*mine).order_by(SubtreesRow.part)))


def outlines(session: Session, job_id: str, pair: int, first: int, last: int) -> dict[int, dict[int, bytes | None]]:
    """Returns iteration -> part -> the outline of the pair's subtrees, for the iterations from ``first`` to ``last``, in order."""
    mine = (SubtreesRow.job_id == job_id, SubtreesRow.pair_index == pair, SubtreesRow.iteration.between(first, last))
    columns = (SubtreesRow.iteration, SubtreesRow.part, SubtreesRow.outline)
    found: dict[int, dict[int, bytes | None]] = {}
    for iteration, part, outline in session.execute(select(*columns).where(*mine).order_by(*columns[:2])):
        found.setdefault(iteration, {})[part] = outline
    return found


def drop(session: Session, job_id: str, but: Collection[int] = ()) -> None:
    """Deletes the subtrees of all pairs but these. The caller holds the job's lock."""
    session.execute(delete(SubtreesRow).where(SubtreesRow.job_id == job_id, SubtreesRow.pair_index.not_in(but)))


def end(session: Session, job_id: str) -> None:
    """Deletes what later iterations would go on with, and keeps the outlines of pairs that are not certified.

    The job has ended, and the caller holds its lock.
    """
    mine = SubtreesRow.job_id == job_id
    last = select(func.max(IterationRow.index)).where(IterationRow.job_id == job_id).scalar_subquery()
    open_still = (PairRow.job_id == job_id, PairRow.iteration == last, PairRow.state != PairState.CERTIFIED)
    failed = select(PairRow.pair_index).where(*open_still)
    session.execute(delete(SubtreesRow).where(mine, SubtreesRow.pair_index.not_in(failed) | SubtreesRow.outline.is_(None)))
    session.execute(update(SubtreesRow).where(mine).values(data=b""))
