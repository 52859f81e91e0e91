"""A scene as the service describes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ciris.answers import Document
from ciris.space import InSpace, Space


@dataclass(frozen=True, eq=False, repr=False)
class Scene(InSpace):
    """A robot and what stands around it, as the service knows them."""

    id: str
    name: str
    hash: str
    """SHA-256 of everything in the scene that a proof depends on."""
    space: Space
    """What the coordinates s mean."""
    geometries: int
    pairs: int
    """Number of the pairs of bodies that must not touch."""
    warnings: int
    """Number of the warnings; ``service.warnings(scene)`` returns them."""
    padding: float
    """Metres added around every geometry of every pair."""

    def __repr__(self) -> str:
        return f"Scene({self.name!r}, {self.id}: {len(self.joints)} joints, {self.geometries} geometries, {self.pairs} pairs)"

    @classmethod
    def of(cls, document: Document) -> Scene:
        """Reads the service's description, ``GET /v1/scenes/{scene}``."""
        joints = document["positions"]
        q_star, lower, upper = (np.array([joint[name] for joint in joints], dtype=float) for name in ("q_star", "lower", "upper"))
        revolute = np.array([joint["kind"] == "revolute" for joint in joints])
        space = Space(tuple(joint["name"] for joint in joints), q_star, lower, upper, revolute)
        names = ("id", "name", "hash", "geometries", "pairs", "warnings", "padding")
        return cls(space=space, **{name: document[name] for name in names})


def scene_name(scene: str | Scene) -> str:
    """Returns what the service calls a scene."""
    return scene.id if isinstance(scene, Scene) else scene
