"""Configurations that somebody asked about and nothing proved, the latest ones of each scene. A map may begin with them."""

from __future__ import annotations

import hashlib
from datetime import datetime

import numpy as np
from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from certifier.model import Array
from db.models import QuestionRow, SceneRow
from db.session import inserting

DIGITS = 6
"""Configurations that are the same to this many digits after the point share one row."""


def note(session: Session, scene_id: str, asked: Array, most: int, now: datetime) -> None:
    """Keeps configurations q, (k, n), of a scene. Of those that it has then, the ``most`` that were asked about last stay."""
    project = session.scalar(select(SceneRow.project).where(SceneRow.id == scene_id).with_for_update(key_share=True))
    if project is None:  # the scene was deleted meanwhile
        return
    digests = {_digest(q): q.tolist() for q in asked[-most:]}
    rows = [{"scene_id": scene_id, "digest": digest, "q": q, "asked_at": now, "project": project} for digest, q in digests.items()]
    insert = inserting(session, QuestionRow).on_conflict_do_update(index_elements=["scene_id", "digest"], set_={"asked_at": now})
    session.execute(insert, rows)
    mine = QuestionRow.scene_id == scene_id
    latest = select(QuestionRow.digest).where(mine).order_by(QuestionRow.asked_at.desc(), QuestionRow.digest)
    session.execute(delete(QuestionRow).where(mine, QuestionRow.digest.in_(session.scalars(latest.offset(most)).all())))


def latest(session: Session, scene_id: str) -> list[list[float]]:
    """Returns the configurations q of a scene, (n,) each, those that were asked about last first."""
    mine = select(QuestionRow.q).where(QuestionRow.scene_id == scene_id)
    return list(session.scalars(mine.order_by(QuestionRow.asked_at.desc(), QuestionRow.digest)))


def _digest(q: Array) -> str:
    return hashlib.sha256((np.round(q, DIGITS) + 0.0).tobytes()).hexdigest()[:32]
