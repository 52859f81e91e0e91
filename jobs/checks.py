"""The length of what requests give for a scene is checked here."""

from __future__ import annotations

from collections.abc import Sequence

from certifier.errors import RegionError
from certifier.model import Scene


def check_length(scene: Scene, values: Sequence[float], field: str, code: str) -> None:
    """Refuses what has not one number for each joint.

    Raises:
        RegionError: ``code``, at ``field``.
    """
    if len(values) != scene.n:
        message = f"{len(values)} numbers were given; {scene.name} has {scene.n} joints"
        raise RegionError(code, message, field=field, hint=scene.in_order)
