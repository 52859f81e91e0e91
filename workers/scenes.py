"""Scenes as the workers use them."""

from __future__ import annotations

from functools import lru_cache

from certifier.model import Scene
from db import scenes
from db.session import database
from workers.transaction import persistently


@lru_cache(maxsize=8)
def load_scene(scene_id: str) -> Scene:
    """The scene with this id; a scene never changes, so a process keeps the last few."""

    def read() -> Scene:
        with database().read() as session:
            return Scene.from_document(scenes.get(session, scene_id).document)

    return persistently(read)
