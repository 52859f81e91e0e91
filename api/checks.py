"""These checks compare the numbers of a question with its scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from certifier.errors import RegionError
from certifier.model import Array, Scene
from certifier.positions import check_magnitude
from jobs.checks import check_length
from planner.membership import to_s


def points(scene: Scene, rows: Sequence[Sequence[float]], field: str) -> Array:
    """Returns the points of a request as an array (k, n).

    Raises:
        RegionError: wrong_length, number_too_large.
    """
    for i, row in enumerate(rows):
        check_length(scene, row, f"{field}[{i}]", "wrong_length")
    found = np.array(rows, dtype=float)
    check_magnitude(found, field)
    return found


def point(scene: Scene, row: Sequence[float], field: str) -> Array:
    """Returns a configuration of a request as an array (n,).

    Raises:
        RegionError: wrong_length, number_too_large.
    """
    _configuration(scene, row, field, "wrong_length")
    return np.array(row, dtype=float)


def of_each_joint(scene: Scene, value: float | Sequence[float], field: str) -> Array:
    """Returns a number for each joint, (n,): the one that was given for all of them, or those that were given.

    Raises:
        RegionError: wrong_length.
    """
    return np.full(scene.n, float(value)) if isinstance(value, int | float) else point(scene, value, field)


def in_s(scene: Scene, q: Array, field: str) -> Array:
    """Returns waypoints q, (k, n), in s.

    Raises:
        RegionError: waypoint_outside_limits.
    """
    s = to_s(scene, q)
    for i in np.flatnonzero(~np.isfinite(s).all(axis=1)).tolist():
        message = "a joint of this waypoint is outside of its limits, or of the window that the scene covers, and has no s"
        raise RegionError("waypoint_outside_limits", message, field=f"{field}[{i}]", hint="`ciris scene show` lists the limits")
    return s


def _configuration(scene: Scene, values: Sequence[float], field: str, code: str) -> None:
    check_length(scene, values, field, code)
    check_magnitude(values, field)
