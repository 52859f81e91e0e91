"""Partitions with open cells are what searches leave of pairs that they have not certified, for later iterations to go on with.

They stand apart from the proofs, because they prove nothing and must not be served as if they did. Each result of a pair replaces what
the result before left, so a job has one partition for each pair at most.
"""

from __future__ import annotations

from collections.abc import Mapping

from sqlalchemy import delete, insert, select
from sqlalchemy.orm import Session

from db.models import PartitionRow


def keep(session: Session, job_id: str, iteration: int, left: Mapping[int, bytes | None]) -> None:
    """Replaces what earlier iterations left of these pairs. The caller holds the job's lock.

    Args:
        left: pair index -> what its result in this iteration has left; None where the result is final.
    """
    if not left:
        return
    session.execute(delete(PartitionRow).where(PartitionRow.job_id == job_id, PartitionRow.pair_index.in_(left)))
    rows = [{"job_id": job_id, "pair_index": pair, "iteration": iteration, "data": data} for pair, data in left.items() if data is not None]
    if rows:
        session.execute(insert(PartitionRow), rows)


def left_by(session: Session, job_id: str, pair: int, iteration: int) -> bytes:
    """Returns what this iteration has left of a pair.

    Raises:
        NoResultFound: it has left nothing, or a later iteration has replaced it.
    """
    mine = (PartitionRow.job_id == job_id, PartitionRow.pair_index == pair, PartitionRow.iteration == iteration)
    return session.scalars(select(PartitionRow.data).where(*mine)).one()


def drop(session: Session, job_id: str) -> None:
    """Deletes what is left of a job that has ended. The caller holds its lock."""
    session.execute(delete(PartitionRow).where(PartitionRow.job_id == job_id))
