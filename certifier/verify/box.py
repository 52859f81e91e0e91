"""Exact check that a polytope {s : C s <= d} lies in a half-space or a box, by multipliers (Farkas).

For y >= 0 every point of the polytope has c's <= y'd + r's, r = c - y'C. The numbers are doubles taken as they are, so
r rarely vanishes; what is left of it is bounded by rows that bound one coordinate alone (the joint limits).
"""

from __future__ import annotations

import numpy as np
from flint import fmpq

from certifier.model import Array, Scene
from certifier.proof import limits
from certifier.verify.kinematics import exact


def within_limits(scene: Scene, point: Array) -> bool:
    """Whether s, (n,) doubles, is within the joint limits beyond the rounding of the limits in s, which are rounded outwards."""
    lower, upper = np.nextafter(scene.s_lower, np.inf), np.nextafter(scene.s_upper, -np.inf)
    return bool(np.all(lower <= point) and np.all(point <= upper))


class Halfspaces:
    """{s : C s <= d}, C (m, n), d (m,), and what those rows say in which no other coordinate occurs.

    Attributes:
        upper, lower: for each coordinate the least upper and the largest lower bound of such rows; None where there is none.
    """

    def __init__(self, C: Array, d: Array) -> None:
        self.C, self.d = C, d
        self.upper: list[fmpq | None] = [None] * C.shape[1]
        self.lower: list[fmpq | None] = [None] * C.shape[1]
        for j in np.flatnonzero(np.count_nonzero(C, axis=1) == 1):
            (i,) = np.flatnonzero(C[j])
            bounds, closer = (self.upper, min) if C[j, i] > 0 else (self.lower, max)
            bound, known = exact(d[j]) / exact(C[j, i]), bounds[i]
            bounds[i] = bound if known is None else closer(bound, known)

    def contains(self, point: Array) -> bool:
        """Whether the point, (n,) doubles, satisfies every row, exactly."""
        s = [exact(x) for x in point]
        return all(_dot(c, s) <= exact(d) for c, d in zip(self.C, self.d, strict=True))

    def upper_bound(self, c: Array, y: Array) -> fmpq | None:
        """An exact upper bound of c's, with c (n,), y (m,).

        None when y proves nothing: a multiplier is negative or not finite, there are more of them than limits.MULTIPLIERS for each
        coordinate, or a residual meets no row that bounds its coordinate alone.
        """
        if y.shape != self.d.shape or not np.all(np.isfinite(y)) or np.any(y < 0):
            return None
        if np.count_nonzero(y) > limits.MULTIPLIERS * len(c):
            return None
        bound = fmpq(0)
        residual = [exact(x) for x in c]
        for j in np.flatnonzero(y):
            weight = exact(y[j])
            bound += weight * exact(self.d[j])
            for k in np.flatnonzero(self.C[j]):
                residual[k] -= weight * exact(self.C[j, k])
        for i, r in enumerate(residual):
            if r:
                limit = self.upper[i] if r > 0 else self.lower[i]
                if limit is None:
                    return None
                bound += r * limit
        return bound

    def lie_in(self, c: Array, value: float, y: Array) -> bool:
        """True when y proves c's <= value, exactly."""
        bound = self.upper_bound(c, y)
        return bound is not None and bool(np.isfinite(value)) and bound <= exact(value)

    def lie_in_box(self, lower: Array, upper: Array, Y_lower: Array, Y_upper: Array) -> bool:
        """True when row i of Y_upper (n, m) proves s_i <= upper_i and row i of Y_lower proves -s_i <= -lower_i, exactly, for every i."""
        m, n = self.C.shape
        if not (lower.shape == upper.shape == (n,) and Y_lower.shape == Y_upper.shape == (n, m)):
            return False
        eye = np.eye(n)
        return all(
            self.lie_in(eye[i], float(upper[i]), Y_upper[i]) and self.lie_in(-eye[i], -float(lower[i]), Y_lower[i]) for i in range(n)
        )


def _dot(c: Array, s: list[fmpq]) -> fmpq:
    return sum((exact(x) * y for x, y in zip(c, s, strict=True)), fmpq(0))
