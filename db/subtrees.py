"""Subtrees are what searches leave of pairs that they have not certified, for later iterations to go on with.

They stand apart from the proofs, because they prove nothing and must not be served as if they did. A job has those of its open pairs only.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from sqlalchemy import delete, insert, select
from sqlalchemy.orm import Session

from db.models import SubtreesRow


def keep(session: Session, job_id: str, iteration: int, left: Mapping[tuple[int, int], bytes]) -> None:
    """Keeps what an iteration has left. The caller holds the job's lock.

    Args:
        left: (pair index, part) -> the subtrees.
    """
    rows = [
        {"job_id": job_id, "pair_index": pair, "iteration": iteration, "part": part, "data": data} for (pair, part), data in left.items()
    ]
    if rows:
        session.execute(insert(SubtreesRow), rows)


def left_of(session: Session, job_id: str, pair: int, iteration: int) -> list[bytes]:
    """Returns what the iteration has left of the pair, in the order of its parts."""
    mine = (SubtreesRow.job_id == job_id, SubtreesRow.pair_index == pair, SubtreesRow.iteration == iteration)
    return list(session.scalars(select(SubtreesRow.data).where(*mine).order_by(SubtreesRow.part)))


def drop(session: Session, job_id: str, but: Collection[int] = ()) -> None:
    """Deletes what is left of all pairs but these. The caller holds the job's lock."""
    session.execute(delete(SubtreesRow).where(SubtreesRow.job_id == job_id, SubtreesRow.pair_index.not_in(but)))
