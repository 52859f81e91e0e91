"""Events say what happened to a job. Their numbers are 1, 2, 3 ... without gaps, in the order in which they were committed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.models import EventRow, JobRow


def emit(session: Session, job: JobRow, kind: str, data: dict[str, Any]) -> None:
    """Adds the job's next event. The caller holds the job's lock.

    The kinds of event, and what their data holds:

    - ``job``: state, outcome, reason;
    - ``iteration``: index, label, state, pairs, parts;
    - ``pairs``: iteration, and pairs (each with index, part, state, stage, margin, seconds);
    - ``step``: kind, state, seconds;
    - ``region``: region_id, iteration, guarantee, ellipsoid_volume, q_volume and share (as in the manifest);
    - ``cover``: of a cover, what a look at the scene has found, as :func:`planner.cover.result.said` says it;
    - ``child``: of a cover, job (its id), number, purpose, q and state; at its end also region_id and reason;
    - ``lost``: worker, reason, and either iteration and pairs or step, which are open again.
    """
    job.event_seq += 1
    session.add(EventRow(job_id=job.id, seq=job.event_seq, kind=kind, data=data))


def before(session: Session, job_id: str, seq: int, limit: int) -> Sequence[EventRow]:
    """Returns the last ``limit`` of the job's events before number ``seq``, in order."""
    query = select(EventRow).where(EventRow.job_id == job_id, EventRow.seq < seq).order_by(EventRow.seq.desc()).limit(limit)
    return session.scalars(query).all()[::-1]


def since(session: Session, job_id: str, seq: int = 0, limit: int = 500) -> Sequence[EventRow]:
    """Returns the job's events after number ``seq``, in order, at most ``limit`` of them."""
    return session.scalars(select(EventRow).where(EventRow.job_id == job_id, EventRow.seq > seq).order_by(EventRow.seq).limit(limit)).all()
