"""Exact check that a polytope {s : C s <= d} lies in a half-space or a box, by multipliers (Farkas).

For y >= 0 every point of the polytope has c's <= y'd + r's, r = c - y'C. The numbers are doubles taken as they are, so
r rarely vanishes; what is left of it is bounded by rows that bound one coordinate alone (the joint limits).
"""

from __future__ import annotations

import numpy as np
from flint import fmpq

from certifier.model import Array
from certifier.verify.kinematics import exact


def upper_bound(C: Array, d: Array, c: Array, y: Array) -> fmpq | None:
    """An exact upper bound of c's on {C s <= d}, with C (m, n), d (m,), c (n,), y (m,).

    None when y proves nothing: a multiplier is negative or not finite, or a residual meets no row that bounds its
    coordinate alone.
    """
    if y.shape != d.shape or not np.all(np.isfinite(y)) or np.any(y < 0):
        return None
    bound = fmpq(0)
    residual = [exact(x) for x in c]
    for j in np.flatnonzero(y):
        weight = exact(y[j])
        bound += weight * exact(d[j])
        for k in np.flatnonzero(C[j]):
            residual[k] -= weight * exact(C[j, k])
    for i, r in enumerate(residual):
        if r:
            limits = _single_row_limits(C, d, i, upper=r > 0)
            if not limits:
                return None
            bound += r * (min(limits) if r > 0 else max(limits))
    return bound


def _single_row_limits(C: Array, d: Array, i: int, upper: bool) -> list[fmpq]:
    """Upper (or lower) bounds of s_i by the rows in which no other coordinate occurs."""
    alone = np.count_nonzero(C, axis=1) == 1
    rows = np.flatnonzero(alone & (C[:, i] > 0 if upper else C[:, i] < 0))
    return [exact(d[j]) / exact(C[j, i]) for j in rows]


def check_box(C: Array, d: Array, lower: Array, upper: Array, Y_lower: Array, Y_upper: Array) -> bool:
    """True when row i of Y_upper (n, m) proves s_i <= upper_i and row i of Y_lower proves -s_i <= -lower_i, exactly, for every i."""
    n = C.shape[1]
    if not (lower.shape == upper.shape == (n,) and Y_lower.shape == Y_upper.shape == (n, len(d))):
        return False
    eye = np.eye(n)
    return all(holds(C, d, eye[i], float(upper[i]), Y_upper[i]) and holds(C, d, -eye[i], -float(lower[i]), Y_lower[i]) for i in range(n))


def holds(C: Array, d: Array, c: Array, value: float, y: Array) -> bool:
    """True when y proves c's <= value on {C s <= d}, exactly."""
    bound = upper_bound(C, d, c, y)
    return bound is not None and bool(np.isfinite(value)) and bound <= exact(value)
