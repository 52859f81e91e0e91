"""Configurations are compared with the limits of the joints here, and with the windows that a scene covers of their turns."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from certifier.errors import RegionError
from certifier.model import Array, JointKind, Scene
from certifier.seeding.proposal import TOO_LONG

ON = 1e-9
"""A position so near to a limit, in radians or metres, is on it: nobody types such a distance."""
HAIR = 1e-4
"""A position on a limit is moved inside by so much, in radians or metres."""
LONG = 100.0
"""A slide is too long for the scene if it goes this many times as far as the largest body is wide."""


def check_limits(scene: Scene, q: ArrayLike, field: str = "seed") -> None:
    """Refuses a configuration with a joint outside of its limits, or of the window that the scene covers of its turn.

    Raises:
        RegionError: ``number_too_large``; ``seed_outside_limits`` (limits themselves are not outside) or ``seed_outside_window``; the error
            names the joint.
    """
    values, shifted = np.asarray(q, dtype=float), scene.in_windows(q, field)
    for i, (joint, value, own_lower, own_upper) in enumerate(zip(scene.moving, values, *scene.own_limits, strict=True)):
        if not own_lower - ON <= value <= own_upper + ON:
            ends = f"{own_lower:.9g} and {own_upper:.9g} {joint.unit}"
            message = f"joint {joint.name} is at {value:.9g} {joint.unit}, not between its limits {ends}"
            raise RegionError("seed_outside_limits", message, field=f"{field}[{i}]", hint="move it between them")
        if not scene.q_lower[i] - ON <= shifted[i] <= scene.q_upper[i] + ON:
            window = f"the window from {joint.lower:.9g} to {joint.upper:.9g} rad"
            message = f"joint {joint.name} is at {value:.9g} rad, outside of {window} that the scene covers"
            raise RegionError(
                "seed_outside_window", message, field=f"{field}[{i}]", hint=f"set q_star of this joint to about {value:.3g} rad"
            )


def check_in_windows(scene: Scene, q: ArrayLike, field: str) -> None:
    """Refuses a configuration that is whole turns away from where the scene has it: a straight motion to it would go elsewhere.

    Raises:
        RegionError: ``seed_outside_window``; the error names the joint.
    """
    values, shifted = np.asarray(q, dtype=float), scene.in_windows(q, field)
    for i in np.flatnonzero(np.abs(values - shifted) > ON)[:1]:
        message = f"joint {scene.moving[i].name} is at {values[i]:.9g} rad, whole turns away from where the scene has it"
        raise RegionError("seed_outside_window", message, field=f"{field}[{i}]", hint=f"write {shifted[i]:.9g}")


def off_limits(scene: Scene, q: ArrayLike) -> Array:
    """Returns configurations, (..., n), that have passed :func:`check_limits`, with positions on a limit moved inside by a hair.

    A region has an interior around its seed, and a limit has nothing of the region on its other side.
    """
    values, shifted = np.asarray(q, dtype=float), scene.in_windows(q)
    hair = np.minimum(HAIR, (scene.q_upper - scene.q_lower) / 4)
    low, high = shifted <= scene.q_lower + ON, shifted >= scene.q_upper - ON
    return np.where(low, scene.q_lower + hair, np.where(high, scene.q_upper - hair, values))


def too_long(scene: Scene) -> str:
    """Returns which slide is far longer than the robot; "" where none is."""
    size = max((float(np.ptp(g.vertices, axis=0).max()) + 2 * g.radius for g in scene.geometries), default=0.0)
    for joint, length in zip(scene.moving, scene.q_upper - scene.q_lower, strict=True):
        if joint.kind is JointKind.PRISMATIC and length > LONG * size:
            return f"joint {joint.name} slides {length:.3g} m, and the largest body is {size:.3g} m wide{TOO_LONG}"
    return ""
