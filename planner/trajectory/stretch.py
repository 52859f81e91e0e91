"""How much slower a trajectory has to be for its differences to keep the limits of speed and acceleration."""

from __future__ import annotations

import numpy as np

from certifier.model import Array

UP = 1 + 1e-6
"""Times are multiplied by this, so that rounding leads over no limit."""


def stretch(q: Array, t: Array, speed: Array, acceleration: Array) -> float:
    """Returns by what factor, 1 or more, times t, (k,), have to be multiplied for the differences of q, (k, n), to be within the limits.

    Args:
        t: ascending, in seconds.
        speed, acceleration: (n,) limits of every joint. At the two ends the robot rests, half a step before the middle of the next step.
    """
    step = np.diff(t)[:, None]
    at_rest = np.zeros((1, q.shape[1]))
    velocity = np.concatenate([at_rest, np.diff(q, axis=0) / step, at_rest])
    between = np.concatenate([step[:1] / 2, (step[:-1] + step[1:]) / 2, step[-1:] / 2])
    change = np.diff(velocity, axis=0) / between
    over = max(float((np.abs(velocity) / speed).max()), float(np.sqrt(np.abs(change) / acceleration).max()))
    return 1.0 if over <= 1 else over * UP
