"""Scenes never change. A project has each once for its content hash. A name means the scene that was last added under it.

Named configurations are no part of a scene's content. They belong to the name, so each user of a scene may have others.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from sqlalchemy import Select, and_, exists, func, or_, select
from sqlalchemy.orm import Session

from certifier.configurations import Configurations
from certifier.errors import SceneError, close_matches
from certifier.model import Scene
from certifier.names import SCENE_ALPHABET, is_scene_name, looks_like_id
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


@dataclass(frozen=True)
class Known:
    """What a scene is called, and its named configurations.

    Attributes:
        name: the name that was given, or the one that the scene was last added or staged under.
        of_names: the named configurations by the name of the scene; those of one name, where one was given.
    """

    name: str
    of_names: Mapping[str, Configurations]

    @property
    def agreed(self) -> dict[str, dict[str, float]]:
        """Returns the configurations that mean the same under all names that have them."""
        found: dict[str, list[Mapping[str, float]]] = {}
        for configurations in self.of_names.values():
            for name, positions in configurations.items():
                found.setdefault(name, []).append(positions)
        return {name: dict(meant[0]) for name, meant in found.items() if all(one == meant[0] for one in meant)}


def add(session: Session, scene: Scene) -> SceneRow:
    """Returns the row of this scene in the session's project, or in the default one. Its name means the scene from now on.

    Raises:
        SceneError: scene_name.
    """
    check_name(scene.name, "name")
    row = stored(session, scene)
    mean(session, row.project, scene.name, row.id, scene.configurations)
    return row


def check_name(name: str, field: str) -> None:
    """Refuses what a scene cannot be called.

    Raises:
        SceneError: scene_name.
    """
    if not is_scene_name(name):
        raise SceneError("scene_name", f"{name[:100]!a} is no name of a scene", field=field, hint=f"names have {SCENE_ALPHABET}")
    if name.endswith(STAGED):
        hint = f"leave {STAGED} out: `ciris scene stage NAME FILE` gives such a name"
        raise SceneError("scene_name", f"{name!r} is the name of a staged scene only", field=field, hint=hint)


def stored(session: Session, scene: Scene) -> SceneRow:
    """Returns the row of this scene in the session's project, or in the default one. What its name means stays as it is.

    It makes the row if no scene of the project has the same content.
    """
    project = project_of(session) or DEFAULT_PROJECT
    whole = scene.hash if project == DEFAULT_PROJECT else hashlib.sha256(f"{project}:{scene.hash}".encode()).hexdigest()
    document = replace(scene, configurations={}).to_document()
    new = {"project": project, "name": scene.name, "hash": scene.hash, "document": document}
    for scene_id in (whole[:ID_LENGTH], whole):
        insert_new(session, SceneRow, [{"id": scene_id, **new}])
        row = session.scalar(select(SceneRow).where(SceneRow.project == project, SceneRow.hash == scene.hash))
        if row is not None:
            row.name = scene.name
            return row
    raise AssertionError("all of a hash can only be taken by the scene that has it")


def mean(session: Session, project: str, name: str, scene_id: str, configurations: Configurations) -> None:
    """Makes the name mean this scene, with these configurations. An addition that another one under the name overtakes comes after it."""
    given = {one: dict(positions) for one, positions in configurations.items()}
    while True:
        last = meaning(session, name, project)
        if last is not None and (last.scene_id, last.configurations) == (scene_id, given):
            return
        version = {"project": project, "name": name, "version": last.version + 1 if last else 1}
        if insert_new(session, SceneNameRow, [{**version, "scene_id": scene_id, "configurations": given}]):
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


def meaning(session: Session, name: str, project: str | None = None) -> SceneNameRow | None:
    """Returns what a name means, in a project or in that of the session; None where there is no such name."""
    versions = select(SceneNameRow).where(SceneNameRow.name == name)
    versions = versions if project is None else versions.where(SceneNameRow.project == project)
    return session.scalar(versions.order_by(SceneNameRow.version.desc()).limit(1))


def find(session: Session, given: str) -> str:
    """Returns the id of the scene with this id, or else of the one that the name means, or else the only id that begins like this.

    ``NAME@ID`` is the scene with the id as it was added under the name. It does not read the scene's document, which may be long.

    Raises:
        SceneError: scene_not_found, with the names that are most like it.
        CirisError: ambiguous_id.
    """
    found = _exactly(session, given)
    if found is not None:
        return found
    longer = expanded(session, SceneRow.id, given)
    if longer == given and given.endswith(STAGED):
        message = f"nothing is staged as the next version of {given.removesuffix(STAGED)!r}"
        raise SceneError("scene_not_found", message, field="scene", hint="`ciris scene stage NAME FILE` stages a scene")
    if longer == given:
        known = session.scalars(select(SceneNameRow.name).order_by(SceneNameRow.created_at.desc()).limit(SUGGESTED_AMONG)).all()
        hint = close_matches(given, list(dict.fromkeys(known))) or "`ciris scene ls`, or `scenes()` in Python, lists them"
        raise SceneError("scene_not_found", f"there is no scene {given!r}", field="scene", hint=hint)
    return longer


def _exactly(session: Session, given: str) -> str | None:
    """Returns the scene that has this id, that the name means, or that ``NAME@ID`` is; None where there is none."""
    if (version := _version(session, given)) is not None:
        return version.scene_id
    name, _, scene_id = given.rpartition("@")
    wanted = scene_id if name.endswith(STAGED) else given  # it may have been promoted, or something else staged, since
    found = session.scalar(select(SceneRow.id).where(SceneRow.id == wanted))
    if found is None and (named := meaning(session, given)) is not None:
        return named.scene_id
    return found


def _version(session: Session, given: str) -> SceneNameRow | None:
    """Returns the last version of a name that meant the scene with an id, for ``NAME@ID``; None for anything else."""
    name, _, scene_id = given.rpartition("@")
    if not name or not looks_like_id(scene_id):
        return None
    versions = select(SceneNameRow).where(SceneNameRow.name == name, SceneNameRow.scene_id == scene_id)
    return session.scalar(versions.order_by(SceneNameRow.version.desc()).limit(1))


def known(session: Session, given: str) -> Known:
    """Returns the named configurations of a scene: those of its name, where a name is given, and of all of its names for an id.

    Raises:
        SceneError, CirisError: as :func:`find`.
    """
    scene_id = find(session, given)
    if given != scene_id and (named := _version(session, given) or meaning(session, given)) is not None:
        return Known(named.name, {named.name: named.configurations})
    versions = select(SceneNameRow).where(SceneNameRow.scene_id == scene_id).order_by(SceneNameRow.version)
    of_names = {row.name: row.configurations for row in session.scalars(versions)}  # the last version of each name
    return Known(session.get_one(SceneRow, scene_id).name, of_names)


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
