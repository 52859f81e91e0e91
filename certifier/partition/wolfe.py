"""Wolfe's algorithm finds the point of a hull that is nearest to 0; its inner loop runs here, for planes, for multipliers and for gaps.

P. Wolfe, Finding the nearest point in a polytope, Mathematical Programming 11 (1976).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array

NOTHING = 1e-12
"""A weight below this counts as 0."""


@njit(cache=True, inline="always")
def _solve(A: Array, x: Array, m: int) -> None:
    """Fills in A^-1 times ones for a positive definite matrix of m rows, by Cholesky's method; the lower half of A is overwritten."""
    for j in range(m):
        for i in range(j, m):
            t = A[i, j]
            for a in range(j):
                t -= A[i, a] * A[j, a]
            A[i, j] = np.sqrt(max(t, 1e-300)) if i == j else t / A[j, j]
        t = 1.0
        for a in range(j):
            t -= A[j, a] * x[a]
        x[j] = t / A[j, j]
    for j in range(m - 1, -1, -1):
        t = x[j]
        for a in range(j + 1, m):
            t -= A[a, j] * x[a]
        x[j] = t / A[j, j]


@njit(cache=True)
def weigh(G: Array, w: Array, rows: Array, m: int) -> int:
    """Moves the weights w of m points to the point of their hull that is nearest to 0, and drops points that get none.

    This is the minor cycle of Wolfe's algorithm (1976). ``rows`` is rearranged in the same way as the points that are kept.

    Args:
        G: the Gram matrix of the points; its rows and columns are rearranged as well.

    Returns:
        How many points are left.
    """
    A, best = np.empty((m, m)), np.empty(m)
    while m > 1:
        trace = 0.0
        for i in range(m):
            trace += G[i, i]
        shift = trace / m
        for i in range(m):
            for j in range(i + 1):
                A[i, j] = G[i, j] + shift
            A[i, i] += 1e-13 * trace
        _solve(A, best, m)
        total = 0.0
        for i in range(m):
            total += best[i]
        positive = True
        for i in range(m):
            best[i] /= total
            positive = positive and best[i] > NOTHING
        if positive:
            for i in range(m):
                w[i] = best[i]
            return m
        share = 1.0
        for i in range(m):
            if best[i] <= NOTHING and w[i] > best[i]:
                share = min(share, w[i] / (w[i] - best[i]))
        least = 0
        for i in range(m):
            w[i] += share * (best[i] - w[i])
            if w[i] < w[least]:
                least = i
        w[least] = 0.0
        kept = 0
        for i in range(m):
            if w[i] > NOTHING:
                w[kept], rows[kept] = w[i], rows[i]
                for j in range(m):
                    G[kept, j] = G[i, j]
                for j in range(m):
                    G[j, kept] = G[j, i]
                kept += 1
        m = kept
    w[0] = 1.0
    return m


@njit(cache=True)
def unused(origin: Array, m: int) -> int:
    """Returns the first slot that is not among the first m of those in use."""
    for slot in range(m + 1):
        used = False
        for i in range(m):
            if origin[i] == slot:
                used = True
        if not used:
            return slot
    return m
