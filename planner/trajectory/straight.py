"""A straight line in q is given times here, from rest to rest: it speeds up, keeps its speed and slows down, all joints together."""

from __future__ import annotations

import numpy as np

from certifier.model import Array
from planner.trajectory.stretch import UP, stretched

FEWEST, MOST = 9, 4000
"""Least number of configurations of a line, and largest number of those of any trajectory."""


def straight(a: Array, b: Array, speed: Array, acceleration: Array, spacing: float) -> tuple[Array, Array]:
    """Returns configurations q (k, n) on the line from a to b, (n,) each, and their times t (k,) in seconds.

    Args:
        speed, acceleration: (n,) limits of every joint, also for the differences of q.
        spacing: no joint moves much farther between two configurations, unless there would be more than MOST of them.
    """
    way = np.abs(b - a)
    if not way.any():
        return np.array([a, b]), np.zeros(2)
    fastest, hardest = (float((limit[way > 0] / way[way > 0]).min()) for limit in (speed, acceleration))
    rising = min(fastest / hardest, 1 / np.sqrt(hardest))  # how long it speeds up
    total = rising + 1 / (hardest * rising)
    reached = hardest * rising  # the largest speed, as a part of the way
    count = int(np.clip(np.ceil(reached * total * way.max() / spacing) + 1, FEWEST, MOST))
    t = np.linspace(0.0, total, count)
    up, down = np.minimum(t, rising), np.maximum(t - (total - rising), 0.0)
    part = hardest * (up**2 / 2 + rising * (np.clip(t, rising, total - rising) - rising) + rising * down - down**2 / 2)
    part = np.clip(part / part[-1], 0.0, 1.0)[:, None]
    q = (1 - part) * a + part * b
    q[0], q[-1] = a, b
    return q, stretched(q, t * UP, speed, acceleration)
