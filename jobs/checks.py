"""What requests give for a scene is checked here: its length, and whether joint positions are within the limits."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from certifier.broken import trouble
from certifier.conditioned import contact_refutes
from certifier.errors import RegionError
from certifier.model import Scene
from certifier.pair.collisions import contacts
from certifier.seeding.limits import check_limits
from certifier.words import counted, joint_positions

SAMPLES, LOOKED_AT = 100, 10_000
"""Lines are looked at in at most SAMPLES configurations altogether, and at most LOOKED_AT pairs in all of these together."""


def check_length(scene: Scene, values: Sequence[float], field: str, code: str) -> None:
    """Refuses what has not one number for each joint.

    Raises:
        RegionError: ``code``, at ``field``.
    """
    if len(values) != scene.n:
        given = f"{counted(len(values), 'number')} {'was' if len(values) == 1 else 'were'}"
        message = f"{given} given; the scene has {counted(scene.n, 'joint')}"
        raise RegionError(code, message, field=field, hint=scene.in_order)


def check_positions(scene: Scene, q: Sequence[float], field: str) -> None:
    """Refuses joint positions that are not one for each joint, or not within its limits.

    Raises:
        RegionError: ``seed_wrong_length``; as certifier.seeding.limits.check_limits.
    """
    check_length(scene, q, field, "seed_wrong_length")
    check_limits(scene, q, field)


def blocked(scene: Scene, points: dict[str, Sequence[float]]) -> list[str]:
    """Says what a region that holds all of these configurations would have to go through: the first contact at samples, in a sentence.

    A region is convex in s, so it holds the straight lines between its points. This takes milliseconds, and floating point may see a
    contact where bodies are as good as touching. So it is a warning. The job looks at all of each line (:mod:`certifier.seeding.lines`).

    Args:
        points: field of the request -> joint positions.

    Returns:
        one sentence, or none where nothing was found, which proves nothing.
    """
    s = dict(zip(points, scene.to_s(scene.in_windows(np.array([*points.values()]))), strict=True))
    samples = [(s[field], field) for field in points]
    lines, most = [*combinations(points, 2)], min(SAMPLES, LOOKED_AT // max(len(scene.pairs), 1))
    parts = np.linspace(0, 1, max((most - len(points)) // max(len(lines), 1), 0) + 2)[1:-1]
    samples += [(s[a] + part * (s[b] - s[a]), f"the straight line in s from {a} to {b}") for a, b in lines for part in parts]
    for (at, where), found in zip(samples, contacts(scene, np.array([at for at, _ in samples])), strict=True):
        if pair := next((scene.pairs[i] for i in found if contact_refutes(scene, scene.pairs[i])), None):
            q = scene.to_q(at)
            here = f"at q = {joint_positions(q, scene.units)}"
            return [f"a region cannot hold {where}: {trouble(scene, pair, q)} {here}, as computed; the job will probably end at once"]
    return []
