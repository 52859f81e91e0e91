"""Configurations are compared with the limits of the joints here, and with the windows that a scene covers of their turns."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from certifier.errors import RegionError
from certifier.model import Scene


def check_limits(scene: Scene, q: ArrayLike, field: str = "seed") -> None:
    """Refuses a configuration with a joint outside of its limits, or of the window that the scene covers of its turn.

    Raises:
        RegionError: ``seed_outside_limits`` (the limits themselves are outside) or ``seed_outside_window``; the error names the joint.
    """
    values, shifted = np.asarray(q, dtype=float), scene.in_windows(q)
    for i, (joint, value, own_lower, own_upper) in enumerate(zip(scene.moving, values, *scene.own_limits, strict=True)):
        if not own_lower < value < own_upper:
            message = f"joint {joint.name} is at {value:g}, not between its limits {own_lower:g} and {own_upper:g}"
            raise RegionError("seed_outside_limits", message, field=f"{field}[{i}]")
        if not scene.q_lower[i] < shifted[i] < scene.q_upper[i]:
            message = (
                f"joint {joint.name} is at {value:g}, outside of the window from {joint.lower:g} to {joint.upper:g} that the scene covers"
            )
            raise RegionError("seed_outside_window", message, field=f"{field}[{i}]", hint=f"set q_star of this joint to about {value:.3g}")
