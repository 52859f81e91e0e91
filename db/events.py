"""Events: what happened to a job, numbered 1, 2, 3 ... without gaps, in the order in which it was committed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.models import EventRow, JobRow


def emit(session: Session, job: JobRow, kind: str, data: dict[str, Any]) -> None:
    """Adds the job's next event; the caller holds the job's lock.

    Kinds: ``job`` (state, outcome, reason), ``iteration`` (index, label, state, pairs), ``pairs`` (iteration, pairs: index, state, stage,
    margin, seconds), ``step`` (kind, state, seconds), ``region`` (region_id, iteration, guarantee, ellipsoid_volume), ``lost`` (worker,
    reason, and iteration with pairs, or step: they are open again).
    """
    job.event_seq += 1
    session.add(EventRow(job_id=job.id, seq=job.event_seq, kind=kind, data=data))


def since(session: Session, job_id: str, seq: int = 0, limit: int = 500) -> Sequence[EventRow]:
    """The job's events after number ``seq``, in order."""
    return session.scalars(select(EventRow).where(EventRow.job_id == job_id, EventRow.seq > seq).order_by(EventRow.seq).limit(limit)).all()
