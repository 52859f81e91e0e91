"""A changed scene is staged as the next version of a name, and promoted once it has its regions. Until then the name means what it meant.

A staged scene has a name of its own, ``NAME@staged``. So a request that may name a scene may name a staged one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from sqlalchemy import delete
from sqlalchemy.orm import Session

from certifier.errors import CirisError, SceneError
from certifier.model import Scene
from db import regions, scenes
from db.models import SceneNameRow, SceneRow
from db.scenes import STAGED


@dataclass(frozen=True)
class Promotion:
    """Says what a name means since a promotion, and what it meant before.

    Attributes:
        scene: id of the scene that the name means.
        regions: number of its regions.
        before: id of the scene that the name meant; None where that was deleted.
        regions_before: number of its regions.
    """

    scene: str
    regions: int
    before: str | None
    regions_before: int


def stage(session: Session, name: str, scene: Scene) -> SceneRow:
    """Stages a scene as the next version of a name, in the place of one that is staged already. Returns its row.

    Raises:
        SceneError: scene_name, scene_not_found, scene_unchanged.
    """
    scenes.check_name(name, "stage")
    present = scenes.meaning(session, name)
    if present is None:
        hint = "`ciris scene ls` lists the names; `ciris scene add FILE` adds the first scene of a name"
        raise SceneError("scene_not_found", f"no scene has the name {name!r}", field="stage", hint=hint)
    row = scenes.stored(session, replace(scene, name=name))
    if (row.id, scene.configurations) == (present.scene_id, present.configurations):
        raise SceneError("scene_unchanged", f"{name!r} means this scene already", field="stage", hint="stage a scene that differs")
    session.execute(delete(SceneNameRow).where(SceneNameRow.project == row.project, SceneNameRow.name == name + STAGED))
    scenes.mean(session, row.project, name + STAGED, row.id, scene.configurations)
    return row


def promote(session: Session, name: str, *, without_regions: bool) -> Promotion:
    """Makes a name mean the scene that is staged for it.

    Args:
        without_regions: whether the scene may have no regions where the present one has some.

    Raises:
        SceneError: scene_not_found.
        CirisError: scene_without_regions.
    """
    scene_id, present = scenes.find(session, name + STAGED), scenes.meaning(session, name)
    staged = scenes.meaning(session, name + STAGED)
    assert staged is not None, "it was found"
    before = None if present is None else present.scene_id
    numbers = regions.counts(session, [scene_id] if before is None else [scene_id, before])
    done = Promotion(scene_id, numbers[scene_id], before, 0 if before is None else numbers[before])
    if done.regions_before and not done.regions and not without_regions:
        message = f"{name + STAGED} has no regions, and {name} has {done.regions_before}: planners would find no way"
        hint = "make regions of it with `ciris recertify`, or say without_regions=true (--without-regions)"
        raise CirisError("scene_without_regions", message, field="without_regions", hint=hint)
    scenes.mean(session, staged.project, name, scene_id, staged.configurations)
    session.delete(staged)
    return done
