"""The verifier checks here, exactly, that a polytope {s : C s <= d} lies in a half-space or a box. Multipliers prove it (Farkas).

Let y >= 0 be multipliers of the rows, and let ' mean transposed. Every point s of the polytope has c's <= y'd + r's with r = c - y'C.

The numbers are doubles and are taken as they are, so r rarely vanishes. The rows that bound one coordinate alone (the joint limits)
bound the remaining r's.
"""

from __future__ import annotations

import numpy as np
from flint import fmpq

from certifier.model import Array, Scene
from certifier.proof import limits
from certifier.verify.kinematics import exact


def within_limits(scene: Scene, point: Array) -> bool:
    """Whether s, (n,) doubles, is within the joint limits beyond the rounding of the limits in s, which are rounded outwards."""
    outer_lower, outer_upper = scene.outer_limits
    lower, upper = np.nextafter(outer_lower, np.inf), np.nextafter(outer_upper, -np.inf)
    return bool(np.all(lower <= point) and np.all(point <= upper))


def limited(scene: Scene, C: Array, d: Array) -> Halfspaces:
    """Returns {C s <= d}, C (m, n), within the joint limits rounded outwards, whose rows come last: upper limits, then lower ones."""
    lower, upper = scene.outer_limits
    eye = np.eye(scene.n)
    return Halfspaces(np.concatenate([C, eye, -eye]), np.concatenate([d, upper, -lower]))


class Halfspaces:
    """Holds the polytope {s : C s <= d}, with C (m, n) and d (m,), and the bounds of its single coordinates.

    Such a bound comes from a row in which only one coordinate occurs.

    Attributes:
        upper: for each coordinate the least upper bound of such rows; None where there is none.
        lower: for each coordinate the largest lower bound of such rows; None where there is none.
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
        """Returns whether the point, (n,) doubles, satisfies every row exactly."""
        s = [exact(x) for x in point]
        return all(_dot(c, s) <= exact(d) for c, d in zip(self.C, self.d, strict=True))

    def upper_bound(self, c: Array, y: Array) -> fmpq | None:
        """Returns an exact upper bound of c's on the polytope, with c (n,) and multipliers y (m,).

        Returns None when y proves nothing. Then a multiplier is negative or not finite, or more of them are nonzero than
        limits.MULTIPLIERS for each coordinate, or a residual meets no row that bounds its coordinate alone.
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
        """Returns True when y proves, exactly, that c's <= value on the polytope."""
        bound = self.upper_bound(c, y)
        return bound is not None and bool(np.isfinite(value)) and bound <= exact(value)

    def lie_in_box(self, lower: Array, upper: Array, Y_lower: Array, Y_upper: Array) -> bool:
        """Returns True when the multipliers prove the box, exactly.

        For every i, row i of Y_upper, (n, m), has to prove s_i <= upper_i. Row i of Y_lower, (n, m), has to prove -s_i <= -lower_i.
        """
        m, n = self.C.shape
        if not (lower.shape == upper.shape == (n,) and Y_lower.shape == Y_upper.shape == (n, m)):
            return False
        eye = np.eye(n)
        return all(
            self.lie_in(eye[i], float(upper[i]), Y_upper[i]) and self.lie_in(-eye[i], -float(lower[i]), Y_lower[i]) for i in range(n)
        )


def _dot(c: Array, s: list[fmpq]) -> fmpq:
    return sum((exact(x) * y for x, y in zip(c, s, strict=True)), fmpq(0))
