"""A configuration that is advised as a seed is free of collisions, with some room, and is in no region: there a new region can grow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array, Scene
from planner.cover.ground import sees
from planner.cover.routes import FINE
from planner.library import Library
from planner.membership import locate

Near = Callable[[Array, float], NDArray[np.bool_]]
"""Tells at which of the points s, (k, n), bodies are nearer to each other than a distance in metres; (k,)."""

ROOM = (1e-3, 1e-4)
"""A seed has the first of these distances to contact, in metres, that is found. With less, it would not be free as it is printed."""
SHELLS, EACH = np.geomspace(0.004, 0.5, 10), 20
"""A seed is looked for at these parts of the joints' half ranges from the wanted place, EACH times."""
DECIMALS = 6
"""The positions of a seed that was looked for have this many decimals."""


def seed_near(scene: Scene, library: Library, near: Near, ends: Array) -> Array | None:
    """Returns joint positions (n,) midway between two points s, (2, n), or near there where that is no seed; None where none was found.

    A place with free straight lines to both ends comes before a nearer one without: a region there can hold both. What this function
    finds is tested in floating point, and is within the joint limits.
    """
    wanted = scene.to_q(ends.mean(axis=0))
    for room in ROOM:
        if not near(ends.mean(axis=0, keepdims=True), room)[0]:
            return wanted
        around = _around(scene, wanted)
        s = scene.to_s(around)
        fit = np.setdiff1d(np.flatnonzero(~near(s, room)), locate(library, s).point)
        if len(fit):
            seen = [sees(lambda points: near(points, 0.0), s[fit], np.broadcast_to(end, s[fit].shape), FINE) for end in ends]
            return np.asarray(around[fit[np.logical_and(*seen).argmax()]])
    return None


def _around(scene: Scene, q: Array) -> Array:
    """Returns configurations (k, n) around q, (n,), the nearest shell first."""
    half, rng = (scene.q_upper - scene.q_lower) / 2, np.random.default_rng(0)
    lower, upper = scene.q_lower + 1e-3 * half, scene.q_upper - 1e-3 * half
    directions = rng.normal(size=(len(SHELLS), EACH, scene.n))
    directions *= SHELLS[:, None, None] / np.linalg.norm(directions, axis=2, keepdims=True)
    return np.round(np.clip(q + directions.reshape(-1, scene.n) * half, lower, upper), DECIMALS)
