"""Scenes as the workers use them."""

from __future__ import annotations

from certifier.model import Scene
from db import scenes
from db.session import database
from workers.transaction import persistently


def load_scene(scene_id: str) -> Scene:
    """The scene with this id, waited for while the database is away."""
    return persistently(lambda: scenes.load(database(), scene_id))
