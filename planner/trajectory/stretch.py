"""How much slower a trajectory has to be for its differences to keep the limits of speed and acceleration."""

from __future__ import annotations

import numpy as np

from certifier.model import Array

UP = 1 + 1e-6
"""Times are multiplied by this, so that rounding leads over no limit."""


def stretched(q: Array, t: Array, speed: Array, acceleration: Array) -> Array:
    """Returns times t, (k,), multiplied by one factor, 1 or more, so that the differences of q, (k, n), are within the limits.

    Args:
        t: ascending, in seconds.
        speed, acceleration: (n,) limits of every joint. At the two ends the robot rests, half a step before the middle of the next step.
    """
    while len(t) > 1 and t[-1] > t[0] and (over := _over(q, t, speed, acceleration)) > 1:
        t = t * (over * UP)  # what times and their differences round may be more than UP where steps are short
    return t


def _over(q: Array, t: Array, speed: Array, acceleration: Array) -> float:
    """Returns by what factor the differences of a trajectory are too fast."""
    step = np.diff(t)[:, None]
    at_rest = np.zeros((1, q.shape[1]))
    velocity = np.concatenate([at_rest, np.diff(q, axis=0) / step, at_rest])
    between = np.concatenate([step[:1] / 2, (step[:-1] + step[1:]) / 2, step[-1:] / 2])
    change = np.diff(velocity, axis=0) / between
    return max(float((np.abs(velocity) / speed).max()), float(np.sqrt(np.abs(change) / acceleration).max()))
