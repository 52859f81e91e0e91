"""What requests give for a scene is checked here: its length, and whether joint positions are within the limits."""

from __future__ import annotations

from collections.abc import Sequence

from certifier.errors import RegionError
from certifier.model import Scene
from certifier.seeding.limits import check_limits


def check_length(scene: Scene, values: Sequence[float], field: str, code: str) -> None:
    """Refuses what has not one number for each joint.

    Raises:
        RegionError: ``code``, at ``field``.
    """
    if len(values) != scene.n:
        message = f"{len(values)} numbers were given; the scene has {scene.n} joints"
        raise RegionError(code, message, field=field, hint=scene.in_order)


def check_positions(scene: Scene, q: Sequence[float], field: str) -> None:
    """Refuses joint positions that are not one for each joint, or not within its limits.

    Raises:
        RegionError: ``seed_wrong_length``; as certifier.seeding.limits.check_limits.
    """
    check_length(scene, q, field, "seed_wrong_length")
    check_limits(scene, q, field)
