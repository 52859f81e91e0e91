"""Inverse kinematics: configurations that bring a frame of the robot to a pose and are free of collisions.

Newton steps (planner.poses.reach) begin at the start configuration, then at random ones: each on the way from the start to one that is
uniform within the joint limits, so that some are near the start and some are far from it. Drake is not needed: its InverseKinematics gives
each start to a solver for general programs, which takes far longer and is less exact.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from certifier.model import Array, Scene
from planner.poses.frame import Frame, frame_of, pose_of
from planner.poses.reach import TIGHT, reach_all

STARTS, EACH = 512, 32
"""The search begins at most at this many configurations, EACH at a time."""
SAME = 1e-6
"""Solutions are one where no joint differs by more than this, radians or metres."""
APART = 0.1
"""Solutions that are returned differ by more than this in a joint, radians or metres."""
DRY = 4
"""Where something is found, the search ends after this many times EACH starts without anything new."""


@dataclass(frozen=True, eq=False)
class Inverse:
    """The configurations that reach a pose, or why there is none.

    Attributes:
        q: (k, n) free configurations within the joints' own limits, the nearest to the start first, at which the frame is within
            planner.poses.reach.TIGHT of the pose. Joints that do not move the frame are as at the start.
        reason: None where there is one; ``"in_collision"`` where every configuration found that reaches the pose is in collision;
            ``"unreachable"`` where none was found that reaches it.
        solutions: how many configurations were found that reach the pose, free or not. An arm with joints to spare has any number.
        nearest: (n,) the configuration found that is nearest to the pose: of those that reach it, the nearest to the start.
        metres, radians: how far the frame is from the pose there.
    """

    q: Array
    reason: str | None
    solutions: int
    nearest: Array
    metres: float
    radians: float


def inverse(
    scene: Scene,
    frame: str,
    position: ArrayLike,
    rpy: ArrayLike,
    start: ArrayLike,
    is_free: Callable[[Array], bool],
    *,
    wanted: int = 8,
    seconds: float = 1.0,
    seed: int = 0,
) -> Inverse:
    """Returns configurations that bring a frame to a pose in the world.

    Args:
        frame: as for planner.poses.frame.frame_of.
        position, rpy: (3,) metres and (3,) radians, as for planner.poses.frame.pose_of.
        start: (n,) where the robot is, radians or metres.
        is_free: says whether a configuration, (n,), is free of collisions.
        wanted: how many configurations are enough.
        seconds: when to give up; the steps from EACH starts, some milliseconds, are always tried.
        seed: of the random starts. The same question has the same answer, as far as time allows.

    Raises:
        RegionError: ``unknown_frame``, ``ambiguous_frame``, ``fixed_frame``, ``wrong_length`` or ``number_too_large``.
    """
    until = time.monotonic() + seconds
    arm, goal, begin, rng = frame_of(scene, frame), pose_of(position, rpy), np.array(start, dtype=float), np.random.default_rng(seed)
    found, free, errors, closest, dry = np.empty((0, scene.n)), np.empty((0, scene.n)), np.full(2, np.inf), begin, 0
    for number in range(STARTS // EACH):
        ends = _starts(scene, arm, begin, rng, first=number == 0)
        missed = reach_all(arm, goal, ends)
        best = _worst(arm, missed).argmin()
        if _worst(arm, missed[best]) < _worst(arm, errors):
            errors, closest = missed[best], ends[best]
        new = _new(_near(scene, arm, ends[(missed <= TIGHT).all(axis=1)], begin), found)
        found = np.concatenate([found, new])
        free = np.concatenate([free, *(q[None] for q in new if is_free(q))])
        dry = 0 if len(new) else dry + 1
        spread = _spread(free, begin)
        if len(spread) >= wanted or (dry == DRY and len(found)) or time.monotonic() > until:
            break
    if len(found):
        closest = _ordered(found, begin)[0].copy()
        errors = reach_all(arm, goal, closest[None])[0]
    reason = None if len(free) else "in_collision" if len(found) else "unreachable"
    return Inverse(spread[:wanted], reason, len(found), closest, *errors.tolist())


def _starts(scene: Scene, arm: Frame, start: Array, rng: np.random.Generator, first: bool) -> Array:
    """Returns configurations to begin at, (EACH, n)."""
    endless = ~np.isfinite(arm.upper - arm.lower)
    lower, upper = np.where(endless, start - np.pi, arm.lower), np.where(endless, start + np.pi, arm.upper)
    starts = np.tile(start, (EACH, 1))
    part = rng.uniform(size=(EACH, 1)) ** 0.5
    starts[:, arm.joints] += (part * (rng.uniform(lower, upper, (EACH, scene.n)) - start))[:, arm.joints]
    if first:
        starts[0] = start
    return starts


def _near(scene: Scene, arm: Frame, q: Array, start: Array) -> Array:
    """Returns joint positions, (k, n), turned by whole turns to be as near to the start as the limits let them."""
    turns = np.where(scene.revolute, np.round((start - q) / (2 * np.pi)), 0.0)
    for fewer in (0, 1):
        less = np.sign(turns) * np.maximum(np.abs(turns) - fewer, 0.0)
        moved = q + 2 * np.pi * less
        fits = (arm.lower <= moved) & (moved <= arm.upper)
        q, turns = np.where(fits, moved, q), np.where(fits, 0.0, turns)
    return q


def _worst(arm: Frame, errors: Array) -> Array:
    """Returns errors, (..., 2) metres and radians, as one number each, (...)."""
    return np.maximum(errors[..., 0] / arm.size, errors[..., 1])


def _new(q: Array, known: Array) -> Array:
    """Returns the rows of q, (k, n), that are not the same as known ones, (l, n), or as one before."""
    kept: list[Array] = []
    for row in q:
        others = np.concatenate([known, *(other[None] for other in kept)])
        if (np.abs(others - row).max(axis=1) > SAME).all():
            kept.append(row)
    return np.array(kept).reshape(-1, q.shape[1])


def _ordered(q: Array, start: Array) -> Array:
    return q[np.argsort(np.linalg.norm(q - start, axis=1), kind="stable")]


def _spread(q: Array, start: Array) -> Array:
    """Returns the rows of q, (k, n), without those that are nearer than APART to one that is nearer to the start, in that order."""
    kept: list[Array] = []
    for row in _ordered(q, start):
        if all(np.abs(row - other).max() > APART for other in kept):
            kept.append(row)
    return np.array(kept).reshape(-1, q.shape[1])
