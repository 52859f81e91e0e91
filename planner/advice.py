"""A configuration that is advised as a seed is free of collisions, with some room, and is in no region: there a new region can grow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array, Scene
from planner.library import Library
from planner.membership import locate

Near = Callable[[Array, float], NDArray[np.bool_]]
"""Tells at which of the points s, (k, n), bodies are nearer to each other than a distance in metres; (k,)."""

ROOM = (1e-3, 1e-4)
"""A seed has the first of these distances to contact, in metres, that is found. With less, it would not be free as it is printed."""
SHELLS, EACH = np.geomspace(0.004, 0.3, 10), 40
"""A seed is looked for at these parts of the joints' half ranges from the wanted place, EACH times."""
DECIMALS = 6
"""The positions of a seed that was looked for have this many decimals."""


def seed_near(scene: Scene, library: Library, near: Near, s: Array) -> Array | None:
    """Returns joint positions (n,) at a point s, (n,), or near it where that is no seed; None where none was found.

    What it finds is tested in floating point, and is within the joint limits.
    """
    wanted = scene.to_q(s)
    for room in ROOM:
        if not near(s[None], room)[0]:
            return wanted
        for q in _shells(scene, wanted):
            around = scene.to_s(q)
            fit = np.setdiff1d(np.flatnonzero(~near(around, room)), locate(library, around).point)
            if len(fit):
                return np.asarray(min(q[fit], key=lambda x: float(np.linalg.norm((x - wanted) / (scene.q_upper - scene.q_lower)))))
    return None


def _shells(scene: Scene, q: Array) -> list[Array]:
    """Returns configurations (EACH, n) around q, (n,), for every shell, the nearest shell first."""
    half, rng = (scene.q_upper - scene.q_lower) / 2, np.random.default_rng(0)
    lower, upper = scene.q_lower + 1e-3 * half, scene.q_upper - 1e-3 * half
    directions = rng.normal(size=(len(SHELLS), EACH, scene.n))
    directions *= SHELLS[:, None, None] / np.linalg.norm(directions, axis=2, keepdims=True)
    return [np.round(np.clip(q + one * half, lower, upper), DECIMALS) for one in directions]
