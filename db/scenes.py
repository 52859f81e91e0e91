"""Scenes never change. A project has each once for its content hash. A name means the scene that was last added under it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import lru_cache

from sqlalchemy import Select, and_, exists, func, or_, select
from sqlalchemy.orm import Session

from certifier.errors import SceneError, close_matches
from certifier.model import Scene
from db import pages
from db.ids import expanded
from db.models import DEFAULT_PROJECT, SceneNameRow, SceneRow
from db.pages import Page
from db.session import Database, insert_new, project_of

ID_LENGTH = 16
SUGGESTED_AMONG = 1000
"""Names are suggested among those of this many scenes, the newest."""
STAGED = "@staged"
"""A name with this behind it means the scene that is staged as the next version of the name (db.staging)."""


def add(session: Session, scene: Scene) -> SceneRow:
    """Returns the row of this scene in the session's project, or in the default one. Its name means the scene from now on.

    Raises:
        SceneError: scene_name.
    """
    check_not_staged(scene.name, "name")
    row = stored(session, scene)
    mean(session, row.project, scene.name, row.id)
    return row


def check_not_staged(name: str, field: str) -> None:
    """Refuses a name that only a staged scene has.

    Raises:
        SceneError: scene_name.
    """
    if name.endswith(STAGED):
        hint = f"leave {STAGED} out: `ciris scene stage NAME FILE` gives such a name"
        raise SceneError("scene_name", f"{name!r} is the name of a staged scene only", field=field, hint=hint)


def stored(session: Session, scene: Scene) -> SceneRow:
    """Returns the row of this scene in the session's project, or in the default one. What its name means stays as it is.

    It makes the row if no scene of the project has the same content. The named configurations are no part of the content, and mean what
    the scene says that was added last.
    """
    project = project_of(session) or DEFAULT_PROJECT
    whole = scene.hash if project == DEFAULT_PROJECT else hashlib.sha256(f"{project}:{scene.hash}".encode()).hexdigest()
    document = scene.to_document()
    new = {"project": project, "name": scene.name, "hash": scene.hash, "document": document}
    for scene_id in (whole[:ID_LENGTH], whole):
        insert_new(session, SceneRow, [{"id": scene_id, **new}])
        row = session.scalar(select(SceneRow).where(SceneRow.project == project, SceneRow.hash == scene.hash))
        if row is not None:
            row.name = scene.name
            named = document.get("configurations", {})
            if row.document.get("configurations", {}) != named:
                row.document = {**row.document, "configurations": named}
            return row
    raise AssertionError("all of a hash can only be taken by the scene that has it")


def mean(session: Session, project: str, name: str, scene_id: str) -> None:
    """Makes the name mean this scene. An addition that is overtaken by another one under the name comes after it."""
    versions = select(SceneNameRow.version, SceneNameRow.scene_id).where(SceneNameRow.project == project, SceneNameRow.name == name)
    while True:
        last = session.execute(versions.order_by(SceneNameRow.version.desc()).limit(1)).first()
        if last is not None and last.scene_id == scene_id:
            return
        version = {"project": project, "name": name, "version": last.version + 1 if last else 1, "scene_id": scene_id}
        if insert_new(session, SceneNameRow, [version]):
            return


def names(session: Session, scene_ids: Sequence[str]) -> dict[str, list[str]]:
    """Returns scene id -> the names that mean the scene now, the last one first, for each of these scenes."""
    named = (SceneNameRow.project, SceneNameRow.name)
    last = select(*named, func.max(SceneNameRow.version).label("version")).group_by(*named).subquery()
    current = and_(*(getattr(SceneNameRow, column.name) == column for column in last.c))
    rows = session.execute(
        select(SceneNameRow.scene_id, SceneNameRow.name)
        .join(last, current)
        .where(SceneNameRow.scene_id.in_(scene_ids))
        .order_by(SceneNameRow.created_at.desc(), SceneNameRow.name)
    )
    found: dict[str, list[str]] = {scene_id: [] for scene_id in scene_ids}
    for scene_id, name in rows:
        found[scene_id].append(name)
    return found


def meaning(session: Session, name: str) -> str | None:
    """Returns the id of the scene that a name means; None where there is no such name."""
    return session.scalar(select(SceneNameRow.scene_id).where(SceneNameRow.name == name).order_by(SceneNameRow.version.desc()).limit(1))


def find(session: Session, name: str) -> str:
    """Returns the id of the scene with this id, or else of the one that the name means, or else the only id that begins like this.

    It does not read the scene's document, which may be long.

    Raises:
        SceneError: scene_not_found, with the names that are most like it.
        CirisError: ambiguous_id.
    """
    found = session.scalar(select(SceneRow.id).where(SceneRow.id == name)) or meaning(session, name)
    if found is not None:
        return found
    longer = expanded(session, SceneRow.id, name)
    if longer == name and name.endswith(STAGED):
        message = f"nothing is staged as the next version of {name.removesuffix(STAGED)!r}"
        raise SceneError("scene_not_found", message, field="scene", hint="`ciris scene stage NAME FILE` stages a scene")
    if longer == name:
        known = session.scalars(select(SceneNameRow.name).order_by(SceneNameRow.created_at.desc()).limit(SUGGESTED_AMONG)).all()
        hint = close_matches(name, list(dict.fromkeys(known))) or "`ciris scene ls`, or `scenes()` in Python, lists them"
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


def page(
    session: Session, after: str | None = None, limit: int = 100, before: str | None = None, search: str | None = None
) -> Page[SceneRow]:
    """Returns one page of the scenes: of all, or of those whose id begins with a text, or that have a name with it.

    Raises:
        CirisError: cursor.
    """
    return pages.page(session, SceneRow, _matching(search), after, limit, before)


def count(session: Session, search: str | None = None) -> int:
    """Returns how many scenes there are on the pages."""
    return session.scalar(select(func.count()).select_from(_matching(search).subquery())) or 0


def _matching(search: str | None) -> Select[SceneRow]:
    if search is None:
        return select(SceneRow)
    named = exists().where(SceneNameRow.scene_id == SceneRow.id, SceneNameRow.name.icontains(search, autoescape=True))
    return select(SceneRow).where(
        or_(SceneRow.id.startswith(search, autoescape=True), SceneRow.name.icontains(search, autoescape=True), named)
    )
