"""The closest points of two convex hulls are found in floating point, for the contacts of screens and the gaps of the broad phase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from certifier.model import Array

_WEIGHT = 1e4
"""The convexity rows of the least-squares problem have this weight; distances are accurate to about 1 / weight^2 of the size."""


@dataclass(frozen=True)
class Closest:
    """Holds nearest points of conv(A) and conv(B), their distance, and the gap that the direction between them proves.

    Attributes:
        p_a, p_b: (3,) the points, in the frame of A and B.
        distance: between them, in the unit of A and B.
        normal: (3,) the unit vector n from p_b to p_a; 0 where the distance is 0.
        gap: min over A of n'v - max over B of n'v. This is a lower bound of the distance however inaccurate the points are, and it is
            negative when n separates nothing.
        weights: convex weights of the vertices of A and of B, not normalised.
    """

    p_a: Array
    p_b: Array
    distance: float
    normal: Array
    gap: float
    weights: tuple[Array, Array]


def closest(A: Array, B: Array) -> Closest:
    """Returns the closest points of the hulls of A (v, 3) and B (w, 3), by nonnegative least squares over the convex weights."""
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
    """Returns the first configuration at which two hulls are not shown to be farther apart than ``reach``, with its closest points.

    Most directions that keep bodies apart at one configuration do so at most of the others. So each direction that is found is tried on
    all configurations that are left.

    Args:
        A, B: (S, v, 3) and (S, w, 3) vertices at S configurations.

    Returns:
        The index of the configuration and the closest points there; None when the hulls are farther apart everywhere.
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
