"""Collision geometries are counted here at both ends: in the files, in what Drake has read, and in the scene.

A geometry that is lost on the way would be in no pair, and nothing would be proved about it.
"""

from __future__ import annotations

from certifier.errors import SceneError
from certifier.model import Geometry, Scene
from certifier.scene.known import PART


def check_counts(written: int, read: int, scene: Scene) -> None:
    """Refuses a scene that does not have every collision geometry of its models.

    Args:
        written: the number of collision geometries that the model files have.
        read: the number of proximity geometries that Drake has.

    Raises:
        SceneError: ``scene_geometries``.
    """
    parts = {geometry.shape["of"] for geometry in scene.geometries if geometry.shape["kind"] == PART}
    kept = len(parts) + sum(_merged(geometry) for geometry in scene.geometries if geometry.shape["kind"] != PART)
    if written != read:
        message = f"the model files have {written} collision geometries, and Drake has read {read}"
        hint = "find the one that Drake leaves out or makes up, and write it otherwise; docs/scenes.md says what is read of a model"
        raise SceneError("scene_geometries", message, field="directives", hint=hint)
    if kept != read or len({geometry.name for geometry in scene.geometries}) != len(scene.geometries):
        message = f"Drake has read {read} collision geometries, and the scene must have each of them; it has {kept}"
        raise SceneError("scene_geometries", message, field="directives", hint="report this with the models: it is a fault of ciris")


def _merged(geometry: Geometry) -> int:
    """Returns how many geometries of Drake's a geometry of the scene stands for."""
    return len(geometry.shape["of"]) if geometry.shape["kind"] == "hull" else 1
