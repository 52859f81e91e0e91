"""Scenes: immutable, stored once for each content hash."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from certifier.errors import SceneError
from certifier.model import Scene
from db import pages
from db.models import SceneRow
from db.pages import Page
from db.session import insert_new

ID_LENGTH = 16


def add(session: Session, scene: Scene) -> SceneRow:
    """The row of this scene, made now if no scene has the same content. The name of the first one stays."""
    for name in (scene.hash[:ID_LENGTH], scene.hash):
        insert_new(session, SceneRow, [{"id": name, "name": scene.name, "hash": scene.hash, "document": scene.to_document()}])
        row = session.scalar(select(SceneRow).where(SceneRow.hash == scene.hash))
        if row is not None:
            return row
    raise AssertionError("a full hash can only be taken by the scene that has it")


def get(session: Session, name: str) -> SceneRow:
    """The scene with this id, or else the newest one with this name.

    Raises:
        SceneError: scene_not_found.
    """
    row = session.get(SceneRow, name)
    row = row or session.scalar(select(SceneRow).where(SceneRow.name == name).order_by(SceneRow.created_at.desc()).limit(1))
    if row is None:
        raise SceneError("scene_not_found", f"there is no scene {name!r}", field="scene")
    return row


def page(session: Session, after: str | None = None, limit: int = 100) -> Page[SceneRow]:
    """One page of the scenes.

    Raises:
        CirisError: cursor.
    """
    return pages.page(session, SceneRow, select(SceneRow), after, limit)
