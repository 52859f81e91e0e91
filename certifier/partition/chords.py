"""Points near a polytope's boundary: where ways from a point inside leave it, and the ends of a random walk's chords."""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array

INSIDE = 0.999999
"""A way ends so much before the boundary."""


@njit(cache=True)
def chords(C: Array, d: Array, start: Array, targets: Array, steps: int, seed: int) -> Array:
    """Returns points close to the boundary of {C x <= d}, (len(targets) + 2 steps, n).

    The first ones lie where the ways from ``start`` to the targets leave the polytope, or at the targets themselves. The others are both
    ends of the chords of a hit-and-run walk from ``start``, which must be inside.
    """
    m, n = C.shape
    count = targets.shape[0]
    found = np.empty((count + 2 * steps, n))
    slack = np.maximum(d - C @ start, 0.0)
    for i in range(count):
        way = targets[i] - start
        rate = C @ way
        reach = 1.0
        for j in range(m):
            if rate[j] > 1e-14:
                reach = min(reach, slack[j] / rate[j])
        found[i] = start + INSIDE * reach * way
    widths = np.empty(n)
    for i in range(n):
        low, high = -1e6, 1e6
        for j in range(m):
            if C[j, i] > 1e-14:
                high = min(high, slack[j] / C[j, i])
            elif C[j, i] < -1e-14:
                low = max(low, slack[j] / C[j, i])
        widths[i] = high - low
    np.random.seed(seed)
    x = start.copy()
    for r in range(steps):
        way = np.random.normal(0.0, 1.0, n) * widths
        rate = C @ way
        slack = np.maximum(d - C @ x, 0.0)
        low, high = -1e6, 1e6
        for j in range(m):
            if rate[j] > 1e-14:
                high = min(high, slack[j] / rate[j])
            elif rate[j] < -1e-14:
                low = max(low, slack[j] / rate[j])
        low, high = min(INSIDE * low, 0.0), max(INSIDE * high, 0.0)
        found[count + 2 * r] = x + low * way
        found[count + 2 * r + 1] = x + high * way
        x = x + (low + (high - low) * np.random.random()) * way
    return found


@njit(cache=True)
def within(C: Array, d: Array, start: Array, target: Array) -> Array:
    """Returns the point where the way from ``start``, which must be inside, to a target leaves {C x <= d}, or the target."""
    reach = 1.0
    for j in range(len(d)):
        rate, slack = 0.0, d[j]
        for i in range(len(start)):
            rate += C[j, i] * (target[i] - start[i])
            slack -= C[j, i] * start[i]
        if rate > 1e-14:
            reach = min(reach, max(slack, 0.0) / rate)
    return start + INSIDE * reach * (target - start)
