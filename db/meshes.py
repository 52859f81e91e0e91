"""The meshes of a scene's models are kept beside the scene, for people to look at. No proof depends on them."""

from __future__ import annotations

import json
import zlib

from sqlalchemy import exists, select
from sqlalchemy.orm import Session

from db.models import Document, SceneMeshesRow
from db.session import inserting


def keep(session: Session, scene_id: str, document: Document) -> None:
    """Stores the meshes of a scene (:func:`certifier.scene.drawn.document`) in the place of those that it had."""
    _put(session, scene_id, zlib.compress(json.dumps(document, separators=(",", ":")).encode()))


def hand_on(session: Session, scene_id: str, to: str) -> None:
    """Gives the meshes of a scene, if it has any, to another one of the same models."""
    row = session.get(SceneMeshesRow, scene_id)
    if row is not None:
        _put(session, to, row.data)


def has(session: Session, scene_id: str) -> bool:
    """Says whether a scene has meshes."""
    return bool(session.scalar(select(exists().where(SceneMeshesRow.scene_id == scene_id))))


def of(session: Session, scene_id: str) -> Document | None:
    """Returns the meshes of a scene; None where it has none."""
    row = session.get(SceneMeshesRow, scene_id)
    return None if row is None else json.loads(zlib.decompress(row.data))


def _put(session: Session, scene_id: str, data: bytes) -> None:
    insert = inserting(session, SceneMeshesRow).values(scene_id=scene_id, data=data)
    session.execute(insert.on_conflict_do_update(index_elements=[SceneMeshesRow.scene_id], set_={"data": insert.excluded.data}))
