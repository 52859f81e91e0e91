"""Scenes never change. Each is stored once for its content hash."""

from __future__ import annotations

from functools import lru_cache

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from certifier.errors import SceneError, close_matches
from certifier.model import Scene
from db import pages
from db.ids import expanded
from db.models import SceneRow
from db.pages import Page
from db.session import Database, insert_new

ID_LENGTH = 16
SUGGESTED_AMONG = 1000
"""Names are suggested among those of so many scenes, the newest."""


def add(session: Session, scene: Scene) -> SceneRow:
    """Returns the row of this scene. It makes the row if no scene has the same content; otherwise the first name stays."""
    for name in (scene.hash[:ID_LENGTH], scene.hash):
        insert_new(session, SceneRow, [{"id": name, "name": scene.name, "hash": scene.hash, "document": scene.to_document()}])
        row = session.scalar(select(SceneRow).where(SceneRow.hash == scene.hash))
        if row is not None:
            return row
    raise AssertionError("a full hash can only be taken by the scene that has it")


def find(session: Session, name: str) -> str:
    """Returns the id of the scene with this id, or else of the newest scene with this name, or else the only id that begins like this.

    It does not read the scene's document, which may be long.

    Raises:
        SceneError: scene_not_found, with the names that are most like it.
        CirisError: ambiguous_id.
    """
    named = select(SceneRow.id).where(or_(SceneRow.id == name, SceneRow.name == name))
    found = session.scalar(named.order_by((SceneRow.id == name).desc(), SceneRow.created_at.desc()).limit(1))
    if found is not None:
        return found
    longer = expanded(session, SceneRow.id, name)
    if longer == name:
        known = session.scalars(select(SceneRow.name).order_by(SceneRow.created_at.desc()).limit(SUGGESTED_AMONG)).all()
        hint = close_matches(name, list(dict.fromkeys(known))) or "`ciris scene ls` lists them"
        raise SceneError("scene_not_found", f"there is no scene {name!r}", field="scene", hint=hint)
    return longer


@lru_cache(maxsize=16)
def load(database: Database, scene_id: str) -> Scene:
    """Returns the scene with this id, ready for use. A scene never changes and takes long to read, so a process keeps the last few.

    Call it outside of any session: it opens its own.

    Raises:
        SceneError: scene_not_found.
    """
    with database.read() as session:
        return Scene.from_document(get(session, scene_id).document)


def get(session: Session, name: str) -> SceneRow:
    """Returns the row of the scene that :func:`find` finds.

    Raises:
        SceneError: scene_not_found.
    """
    return session.get_one(SceneRow, find(session, name))


def page(session: Session, after: str | None = None, limit: int = 100) -> Page[SceneRow]:
    """Returns one page of the scenes.

    Raises:
        CirisError: cursor.
    """
    return pages.page(session, SceneRow, select(SceneRow), after, limit)
