"""What users give as a motion is checked here."""

from __future__ import annotations

from typing import Any

import numpy as np

from certifier.errors import RegionError
from certifier.model import Scene
from certifier.proof import limits
from certifier.proof.motion import Motion, Space


def given(scene: Scene, waypoints: Any, space: Space, field: str = "waypoints") -> Motion:
    """Returns a motion from what users give: nested lists or an array of numbers, (K, n).

    Waypoints in q may go beyond a joint's window, up to its own limits; the motion goes the way that they say, and is not taken to other
    turns of a joint.

    Args:
        field: where the user gave the waypoints, for errors.

    Raises:
        RegionError: ``motion_shape``, ``motion_not_finite``, ``motion_too_long``, or ``outside_limits`` with the waypoint and the joint.
    """
    try:
        points = np.array(waypoints, dtype=float)
    except (TypeError, ValueError) as error:
        raise RegionError("motion_shape", f"waypoints must be lists of {scene.n} numbers each: {error}", field=field) from None
    if points.ndim != 2 or points.shape[1] != scene.n or len(points) < 2:
        hint = f"give two or more waypoints with {scene.n} numbers each, one for every joint in the scene's order"
        raise RegionError("motion_shape", f"the waypoints are of shape {points.shape}", field=field, hint=hint)
    if len(points) * len(scene.pairs) > limits.INTERVALS:
        most = limits.INTERVALS // len(scene.pairs)
        problem = f"there are {len(points)} waypoints, and a proof about this scene holds at most {most}"
        raise RegionError("motion_too_long", problem, field=field, hint="divide the motion")
    wrong = np.argwhere(~(np.abs(points) <= limits.MAGNITUDE))
    if len(wrong):
        i, j = wrong[0]
        raise RegionError("motion_not_finite", f"{points[i, j]} is no number of at most {limits.MAGNITUDE:g}", field=f"{field}[{i}][{j}]")
    if not scene.pairs:
        raise RegionError("motion_shape", "the scene has no pair of bodies to keep apart", field="scene")
    lower, upper = space.limits(scene)
    outside = np.argwhere((points < lower) | (points > upper))
    if len(outside):
        i, j = outside[0]
        problem = f"waypoint {i} is outside the limits of joint {scene.moving[j].name}: {points[i, j]:.6g} is not in"
        hint = f"joints are counted from 0, {space.value} as in the scene's order"
        raise RegionError("outside_limits", f"{problem} [{lower[j]:.6g}, {upper[j]:.6g}]", field=f"{field}[{i}][{j}]", hint=hint)
    return Motion(space, points)
