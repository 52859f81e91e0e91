"""Scenes as the routes use them: reading one anew takes longer than most of what is done with it."""

from __future__ import annotations

from functools import lru_cache

from certifier.model import Scene
from db import scenes
from db.session import Database


@lru_cache(maxsize=16)
def scene_of(db: Database, scene_id: str) -> Scene:
    """The scene with this id; a scene never changes, so the last few are kept. Not to be called in a session: it takes its own.

    Raises:
        SceneError: scene_not_found.
    """
    with db.read() as session:
        return Scene.from_document(scenes.get(session, scene_id).document)
