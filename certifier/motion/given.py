"""What users give as a motion is checked here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from certifier.errors import RegionError
from certifier.model import Array, Scene
from certifier.motion.splines import Curve, curve
from certifier.positions import check_magnitude
from certifier.proof import limits
from certifier.proof.motion import Motion, Space
from certifier.words import counted


def motion_of(scene: Scene, document: Mapping[str, Any], space: Space | None = None) -> Motion:
    """Returns a motion from a document that has one of these: waypoints as ``q`` or ``s``; ``bezier``; ``knots`` and ``control_points``.

    Args:
        space: in which coordinates the motion is straight between waypoints, or which ones control points are given in; None for those of
            the waypoints, and for q.

    Raises:
        RegionError: as :func:`given`, :func:`curved` and certifier.motion.splines; the field names the place in the document.
    """
    found = curve(document)
    if found is None:
        coordinates = Space.S if document.get("q") is None else Space.Q
        return given(scene, document.get(coordinates.value), coordinates, space, coordinates.value)
    return curved(scene, found, space or Space.Q, "bezier" if document.get("knots") is None else "control_points")


def given(scene: Scene, waypoints: Any, coordinates: Space, space: Space | None = None, field: str = "waypoints") -> Motion:
    """Returns the motion that is straight between waypoints: nested lists or an array of numbers, (K, n).

    A motion that is straight in q may go beyond a joint's window, up to the joint's own limits. It goes the way that the numbers say; no
    waypoint is taken to another turn of a joint.

    Args:
        coordinates: what the numbers are, q or s.
        space: in which coordinates the motion is straight; None for those.
        field: where the user gave the waypoints, for errors.

    Raises:
        RegionError: ``motion_shape``, ``motion_not_finite``, ``motion_too_long``, or ``outside_limits`` with the waypoint and the joint.
        SceneError: ``no_pairs``.
    """
    points = _numbers(scene, waypoints, field)
    space = space or coordinates
    if coordinates is Space.Q and space is Space.S:
        _check_limits(scene, points, (scene.q_lower, scene.q_upper), Space.Q, field)
        return Motion(space, np.clip(scene.to_s(points), *space.limits(scene)))
    _check_limits(scene, points, coordinates.limits(scene), coordinates, field)
    return Motion(space, points if space is coordinates else np.clip(scene.to_q(points), *space.limits(scene)))


def curved(scene: Scene, found: Curve, space: Space, field: str = "bezier") -> Motion:
    """Returns the motion along a curve, whose control points are in the coordinates of the space.

    All of a piece lies between its control points. So they have to be within the joint limits, which is more than the motion itself needs.

    Raises:
        RegionError: as :func:`given`, with the piece and its control point.
    """
    motion = Motion(space, found.controls, found.degree)
    if found.controls.shape[1] != scene.n:
        hint = f"give {counted(scene.n, 'number')} for each, {scene.in_order}"
        each = counted(found.controls.shape[1], "coordinate")
        raise RegionError("motion_shape", f"the control points have {each} each", field=field, hint=hint)
    _check_scene(scene, motion.pieces + 1, field)
    lower, upper = space.limits(scene)
    outside = np.argwhere((found.controls < lower) | (found.controls > upper))
    if len(outside):
        i, j = outside[0]
        piece = min(int(i) // found.degree, motion.pieces - 1)
        k = int(i) - piece * found.degree
        unit = _unit(scene, space, j)
        place = f"control point {k} of Bezier piece {piece}"
        ends = f"{lower[j]:.9g} and {upper[j]:.9g}{unit}"
        problem = f"joint {scene.moving[j].name} is at {found.controls[i, j]:.9g}{unit} in {place}, not between {ends}"
        hint = "all control points must be within the limits, as then all of the motion is; divide a piece whose own are far out"
        raise RegionError("outside_limits", problem, field=f"bezier[{piece}][{k}][{j}]" if field == "bezier" else field, hint=hint)
    return motion


def _numbers(scene: Scene, waypoints: Any, field: str) -> Array:
    try:
        points = np.array(waypoints, dtype=float)
    except (TypeError, ValueError):
        points = None
    hint = f"give two or more, with {counted(scene.n, 'number')} each, {scene.in_order}"
    if points is None or points.ndim != 2:
        raise RegionError("motion_shape", "the waypoints are no lists of numbers of one length", field=field, hint=hint)
    if points.shape[1] != scene.n:
        message = f"each waypoint has {counted(points.shape[1], 'number')}, and the scene has {counted(scene.n, 'joint')} that can move"
        raise RegionError("motion_shape", message, field=field, hint=hint)
    if len(points) < 2:
        raise RegionError("motion_shape", f"a motion has two waypoints or more, not {len(points)}", field=field, hint=hint)
    _check_scene(scene, len(points), field)
    check_magnitude(points, field, code="motion_not_finite")
    return points


def _check_scene(scene: Scene, waypoints: int, field: str) -> None:
    """Checks that the scene has pairs, and that a proof of them has room for this many waypoints, or for ``waypoints - 1`` pieces."""
    scene.check_pairs()
    if waypoints * len(scene.pairs) > limits.INTERVALS:
        most = limits.INTERVALS // len(scene.pairs)
        problem = f"there are {waypoints} waypoints, and a proof about this scene holds at most {most}"
        raise RegionError("motion_too_long", problem, field=field, hint="divide the motion")


def _check_limits(scene: Scene, points: Array, bounds: tuple[Array, Array], space: Space, field: str) -> None:
    lower, upper = bounds
    outside = np.argwhere((points < lower) | (points > upper))
    if len(outside):
        i, j = outside[0]
        name, unit = scene.moving[j].name, _unit(scene, space, j)
        problem = f"joint {name} is at {points[i, j]:.9g}{unit} in waypoint {i}, not between {lower[j]:.9g} and {upper[j]:.9g}{unit}"
        raise RegionError("outside_limits", problem, field=f"{field}[{i}][{j}]", hint="move it between them; waypoints count from 0")


def _unit(scene: Scene, space: Space, joint: int) -> str:
    """Returns the unit of a joint's coordinate behind a blank; "" for the s of a joint that turns, which has none."""
    unit = scene.units[joint]
    return "" if space is Space.S and unit == "rad" else f" {unit}"
