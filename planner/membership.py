"""This module finds which regions {s : C s <= d} contain which points, and by how much.

It computes all faces of all regions in one matrix product.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array, Polytope, Scene


@dataclass(frozen=True)
class Membership:
    """Holds the answer for k points and r regions.

    Attributes:
        inside: (k, r) True where the point satisfies every inequality of the region.
        margin: (k, r) distance in s from the point to the nearest face's hyperplane, negative outside:
            min_j (d_j - c_j's) / |c_j|. Minus infinity where the point has no coordinates s.
    """

    inside: NDArray[np.bool_]
    margin: Array


class MembershipIndex:
    """Holds the faces of r >= 0 regions of an n-joint scene, stacked."""

    def __init__(self, polytopes: Sequence[Polytope], n: int) -> None:
        self._count = len(polytopes)
        self._C = np.concatenate([np.zeros((0, n)), *(p.C for p in polytopes)])
        self._d = np.concatenate([np.zeros(0), *(p.d for p in polytopes)])
        self._first = np.cumsum([0, *(len(p.d) for p in polytopes[:-1])])
        norms = np.linalg.norm(self._C, axis=1)
        self._norms = np.where(norms > 0, norms, 1.0)

    def locate(self, s: Array) -> Membership:
        """Returns the membership of the points s, (k, n). A row with a value that is not finite is outside of every region."""
        k = len(s)
        if not self._count:
            return Membership(np.zeros((k, 0), dtype=bool), np.zeros((k, 0)))
        finite = np.isfinite(s).all(axis=1, keepdims=True)
        slack = self._d - np.where(finite, s, 0.0) @ self._C.T
        inside = np.logical_and.reduceat(slack >= 0, self._first, axis=1) & finite
        margin: Array = np.minimum.reduceat(slack / self._norms, self._first, axis=1)
        return Membership(inside, np.where(finite, margin, -np.inf))


def to_s(scene: Scene, q: Array) -> Array:
    """Returns the tangent-space coordinates (k, n) of configurations q (k, n), with a row of NaN where a joint is outside its limits.

    A joint that can turn a whole turn and more is in the same pose a turn later, so its position is taken to the window that the scene
    covers. s itself has period 2 pi in every revolute joint, so without the check of the limits any configuration a turn away would count.
    """
    lower, upper = scene.own_limits
    shifted = scene.in_windows(q)
    within = (q >= lower) & (q <= upper) & (shifted >= scene.q_lower) & (shifted <= scene.q_upper)
    return np.where(within.all(axis=1, keepdims=True), scene.to_s(shifted), np.nan)
