"""The configurations that a motion has to go through are compared with the scene here: joint limits, collisions, whole turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.broken import not_kept
from certifier.collisions.clearance import Clearance
from certifier.model import Array, Scene
from certifier.seeding.free import ROOM, nearest_free


@dataclass(frozen=True, eq=False)
class OutsideLimits:
    """A joint is outside its limits.

    Attributes:
        joint: its name.
        value, lower, upper: its position and its limits, radians or metres.
    """

    joint: str
    value: float
    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class InCollision:
    """Two bodies touch, or a condition is not kept.

    Attributes:
        a, b: the geometries.
        depth: how deep the padded bodies are in each other, metres.
        free: (n,) the nearest free joint positions that were found; None where none were.
        condition: in words, which condition is not kept, if the two geometries stand for one.
    """

    a: str
    b: str
    depth: float
    free: Array | None
    condition: str | None = None


def outside_limits(scene: Scene, q: Array) -> OutsideLimits | None:
    """Returns the joint that is farthest outside its own limits at q, (n,); None where all are within."""
    lower, upper = scene.own_limits
    beyond = np.maximum(lower - q, q - upper)
    worst = int(beyond.argmax())
    if beyond[worst] <= 0:
        return None
    return OutsideLimits(scene.moving[worst].name, float(q[worst]), float(lower[worst]), float(upper[worst]))


def in_collision(scene: Scene, q: Array) -> InCollision:
    """Returns which pair is deepest in collision at q, (n,), where one is."""
    clearance = Clearance(scene)
    distance, pair = clearance.least(q)
    searched = (nearest_free(scene, clearance, scene.in_windows(q), room) for room in ROOM)
    free = next((found for found in searched if found is not None), None)
    return InCollision(pair.a, pair.b, -distance, free, not_kept(scene, pair, q))


def turned(scene: Scene, start: Array, goal: Array) -> list[Array]:
    """Returns joint positions, (n,) each, with the pose of a goal within the joints' own limits.

    A joint that can turn more than a whole turn has its pose in several turns. First come the positions nearest to the start, then those
    in which one joint takes the other way around.
    """
    nearest, others = goal.copy(), []
    for i, (joint, lower, upper) in enumerate(zip(scene.moving, *scene.own_limits, strict=True)):
        if joint.own_limits is None:
            continue
        turns = np.round((start[i] - goal[i]) / (2 * np.pi)) + np.arange(-1, 2)
        found = sorted((x for x in goal[i] + 2 * np.pi * turns if lower <= x <= upper), key=lambda x: abs(x - start[i]))
        nearest[i] = (found or [goal[i]])[0]
        others += [(i, x) for x in found[1:2]]
    return [nearest, *(np.where(np.arange(scene.n) == i, x, nearest) for i, x in others)]


def box(scene: Scene, points: list[Array]) -> tuple[Array, Array]:
    """Returns the lower and upper joint positions, (n,) each, that a motion between points may use: limits, or a turn beyond the points."""
    lower, upper = scene.own_limits
    return np.maximum(lower, np.min(points, axis=0) - 2 * np.pi), np.minimum(upper, np.max(points, axis=0) + 2 * np.pi)
