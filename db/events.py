"""Events say what happened to a job. Their numbers are 1, 2, 3 ... without gaps, in the order in which they were committed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Row, select
from sqlalchemy.orm import Session

from db.models import EventRow, JobRow

NOTE = "note"
"""The kind of an event that only says how far something is."""


def emit(session: Session, job: JobRow, kind: str, data: dict[str, Any]) -> None:
    """Adds the job's next event. The caller holds the job's lock.

    The kinds of event, and what their data holds:

    - ``job``: state, outcome, reason;
    - ``iteration``: index, label, state; where it begins also pairs (how many are to be proved), together (how many of these share the
      proof of another one), parts (into how many pieces of work they are divided), reused (how many more keep their proofs);
    - ``pairs``: iteration, worker, and pairs, as the worker did them one after the other (each with index, part, state, stage,
      proved_distance, margin (the same), seconds); a pair that stands for a condition has no distance;
    - ``step``: kind, state; at its end also seconds and worker;
    - ``region``: region_id, iteration, guarantee, ellipsoid_volume, and what lists show of the manifest: q_volume and share;
    - ``cover``: of a cover, what a look at the scene has found, as :func:`planner.cover.result.said` says it;
    - ``child``: of a cover, job (its id), number, purpose, q and state; at its end also region_id and reason;
    - ``note``: text and part: how far a step is, in words and from 0 to 1 or None; of a proposal also faces and hindrance, where known; of
      a map also cells, how many were looked at, and work: process -> its seconds since the note before, without those of leading;
    - ``lost``: worker, reason, and either iteration and pairs or step, which are open again.
    """
    job.event_seq += 1
    session.add(EventRow(job_id=job.id, seq=job.event_seq, kind=kind, data=data))


def last(session: Session, job_id: str, kind: str) -> dict[str, Any] | None:
    """Returns the data of the job's last event, if it is of this kind; None otherwise."""
    query = select(EventRow).where(EventRow.job_id == job_id).order_by(EventRow.seq.desc()).limit(1)
    event = session.scalar(query)
    return event.data if event is not None and event.kind == kind else None


def before(session: Session, job_id: str, seq: int, limit: int) -> Sequence[EventRow]:
    """Returns the last ``limit`` of the job's events before number ``seq``, in order."""
    query = select(EventRow).where(EventRow.job_id == job_id, EventRow.seq < seq).order_by(EventRow.seq.desc()).limit(limit)
    return session.scalars(query).all()[::-1]


def since(session: Session, job_id: str, seq: int = 0, limit: int = 500) -> Sequence[EventRow]:
    """Returns the job's events after number ``seq``, in order, at most ``limit`` of them."""
    return session.scalars(select(EventRow).where(EventRow.job_id == job_id, EventRow.seq > seq).order_by(EventRow.seq).limit(limit)).all()


def work(session: Session, job_id: str) -> Sequence[Row[str, dict[str, Any], datetime]]:
    """Returns kind, data and time of the job's events that tell of work that was done or lost, in order."""
    told = (EventRow.job_id == job_id, EventRow.kind.in_(("pairs", "step", NOTE, "lost")))
    return session.execute(select(EventRow.kind, EventRow.data, EventRow.created_at).where(*told).order_by(EventRow.seq)).all()


def told(session: Session, job_id: str, kind: str) -> Sequence[Row[dict[str, Any], datetime]]:
    """Returns data and time of the job's events of one kind, in order."""
    of_kind = (EventRow.job_id == job_id, EventRow.kind == kind)
    return session.execute(select(EventRow.data, EventRow.created_at).where(*of_kind).order_by(EventRow.seq)).all()


def of_all(session: Session, after: int, limit: int, known: Collection[int] = ()) -> Sequence[EventRow]:
    """Returns the events of all jobs of the session's project whose ids are larger than a number, in the order of their ids.

    Ids are not in the order of commits: a smaller one may appear later.

    Args:
        known: ids that are left out.
    """
    query = select(EventRow).join(JobRow, JobRow.id == EventRow.job_id).where(EventRow.id > after)
    if known:
        query = query.where(EventRow.id.not_in(known))
    return session.scalars(query.order_by(EventRow.id).limit(limit)).all()


def last_id(session: Session) -> int:
    """Returns the largest id of an event of the session's project; 0 without events."""
    query = select(EventRow.id).join(JobRow, JobRow.id == EventRow.job_id).order_by(EventRow.id.desc()).limit(1)
    return session.scalar(query) or 0
