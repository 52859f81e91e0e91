"""This module loads scenes for the workers."""

from __future__ import annotations

from certifier.model import Scene
from db import scenes
from db.session import database
from db.transaction import persistently


def load_scene(scene_id: str) -> Scene:
    """Returns the scene with this id. It waits while the database is away."""
    return persistently(lambda: scenes.load(database(), scene_id))
