"""Motions that were planned in a scene and proved are kept, so that they answer later questions. The oldest ones go."""

from __future__ import annotations

from collections.abc import Sequence
from uuid import uuid4

from sqlalchemy import delete, func, select, update
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from certifier.model import Array
from db import proofs
from db.ids import found
from db.models import LibraryRow, MotionRow, SceneRow
from db.session import insert_new

SLACK = 10
"""A scene may have this part more motions than are kept, before the oldest ones go."""


def add(session: Session, scene_id: str, arrays: dict[str, Array], tube: float, proof: bytes, most: int) -> MotionRow:
    """Stores a motion whose proof has been verified. Where a scene has far more than ``most``, the oldest ones go, together.

    Args:
        arrays: as in :class:`db.models.MotionRow`.
    """
    number = _changed(session, scene_id)
    motion = MotionRow(
        id=str(uuid4()),
        project=session.get_one(SceneRow, scene_id).project,
        scene_id=scene_id,
        number=number,
        arrays=arrays,
        tube=tube,
        proof_digest=proofs.put(session, [proof])[proof],
    )
    session.add(motion)
    session.flush()
    mine = MotionRow.scene_id == scene_id
    if (session.scalar(select(func.count()).select_from(MotionRow).where(mine)) or 0) > most + most // SLACK:
        latest = select(MotionRow.id).where(mine).order_by(MotionRow.number.desc())
        _delete(session, session.scalars(latest.offset(most)).all())
    return motion


def get(session: Session, motion_id: str) -> MotionRow:
    """Returns the motion with this id, or with the only id that begins like this.

    Raises:
        CirisError: motion_not_found, or ambiguous_id.
    """
    row = found(session, MotionRow, motion_id)
    if row is None:
        hint = "the service keeps the latest motions of a scene; plan again, or keep the proof (`ciris plan --out FILE`)"
        raise CirisError("motion_not_found", f"there is no motion {motion_id!r}", field="motion", hint=hint)
    return row


def version(session: Session, scene_id: str) -> int:
    """Returns how often a motion of this scene was added or deleted."""
    return session.scalar(select(LibraryRow.motions).where(LibraryRow.scene_id == scene_id)) or 0


def oldest(session: Session, scene_id: str) -> int:
    """Returns the number of the oldest motion that a scene has; the oldest ones go first. Without any, it is beyond all numbers so far."""
    first = session.scalar(select(func.min(MotionRow.number)).where(MotionRow.scene_id == scene_id))
    return version(session, scene_id) + 1 if first is None else first


def since(session: Session, scene_id: str, number: int) -> list[MotionRow]:
    """Returns the motions of a scene with larger numbers, by their numbers."""
    mine = select(MotionRow).where(MotionRow.scene_id == scene_id, MotionRow.number > number)
    return list(session.scalars(mine.order_by(MotionRow.number)))


def delete_all(session: Session, scene_id: str) -> None:
    """Deletes the motions of a scene, and their proofs unless somebody else has them."""
    _delete(session, session.scalars(select(MotionRow.id).where(MotionRow.scene_id == scene_id)).all())


def _delete(session: Session, ids: Sequence[str]) -> None:
    if not ids:
        return
    digests = session.scalars(select(MotionRow.proof_digest).where(MotionRow.id.in_(ids))).all()
    session.execute(delete(MotionRow).where(MotionRow.id.in_(ids)))
    proofs.drop_unused(session, digests)


def _changed(session: Session, scene_id: str) -> int:
    """Counts a change of the scene's motions and returns their version. Changes of one scene wait for each other until they commit."""
    insert_new(session, LibraryRow, [{"scene_id": scene_id, "version": 0, "motions": 0}])
    counted = update(LibraryRow).where(LibraryRow.scene_id == scene_id).values(motions=LibraryRow.motions + 1)
    return session.scalars(counted.returning(LibraryRow.motions)).one()
