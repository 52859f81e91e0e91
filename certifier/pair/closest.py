"""Closest points of two convex hulls, in floating point: the start of the pair program and the refutation of a configuration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from certifier.model import Array

_WEIGHT = 1e4
"""Weight of the convexity rows of the least-squares problem; distances are accurate to about 1 / weight^2 of the size."""


@dataclass(frozen=True)
class Closest:
    """Nearest points p_a, p_b (3,) of conv(A) and conv(B), their distance, and the gap that the direction between them proves.

    ``gap`` = min over A of n'v - max over B of n'v for the unit n from p_b to p_a: a lower bound of the distance whatever
    the accuracy of the points, negative when n separates nothing. ``weights`` are the convex weights of either's vertices, not normalised.
    """

    p_a: Array
    p_b: Array
    distance: float
    normal: Array
    gap: float
    weights: tuple[Array, Array]


def closest(A: Array, B: Array) -> Closest:
    """Closest points of the hulls of A (v, 3) and B (w, 3), by nonnegative least squares over the convex weights."""
    center = B.mean(axis=0)
    scale = max(float(np.abs(A - center).max()), float(np.abs(B - center).max()), 1e-12)
    a, b = (A - center) / scale, (B - center) / scale
    rows = np.zeros((5, len(a) + len(b)))
    rows[:3, : len(a)], rows[:3, len(a) :] = a.T, -b.T
    rows[3, : len(a)] = rows[4, len(a) :] = _WEIGHT
    weights, _ = nnls(rows, np.array([0, 0, 0, _WEIGHT, _WEIGHT]))
    wa, wb = weights[: len(a)], weights[len(a) :]
    p_a, p_b = wa @ A / wa.sum(), wb @ B / wb.sum()
    distance = float(np.linalg.norm(p_a - p_b))
    normal = (p_a - p_b) / distance if distance > 0 else np.zeros(3)
    return Closest(p_a, p_b, distance, normal, float((A @ normal).min() - (B @ normal).max()), (wa, wb))


def first_within(A: Array, B: Array, reach: float) -> tuple[int, Closest] | None:
    """The first of S configurations at which the hulls of A (S, v, 3) and B (S, w, 3) are not shown to be farther apart than ``reach``.

    Most directions that keep bodies apart at one configuration do so at most of the others.
    """
    left = np.arange(len(A))
    while len(left):
        found = closest(A[left[0]], B[left[0]])
        if not found.gap > reach:
            return int(left[0]), found
        left = left[1:]
        gaps = (A[left] @ found.normal).min(axis=1) - (B[left] @ found.normal).max(axis=1)
        left = left[~(gaps > reach)]
    return None
