"""The objective and the barriers of the polytope step's faces are made here, where the inscribed ellipsoid is the unit ball.

The unknowns are, face by face, (c_j, d_j, delta_j), which are n + 2 numbers. The face is {c_j'w <= d_j} with w = E^-1 (s - s_E), and

    |c_j| <= d_j - delta_j,   |c_j| <= 1,   delta_j >= 0,   d_j <= cap,   c_j'w_k <= d_j for every point w_k.
"""

from __future__ import annotations

import numpy as np

from certifier.conic.arrow import Term
from certifier.model import Array

EPSILON = 1e-3
"""This is added to the margins in the geometric mean, so that a face that cannot move does not hold up the others."""


def objective_term(n: int) -> Term:
    """Returns what is minimised: -sum log(delta_j + eps) of the margins delta_j between the ellipsoid and the faces."""

    def term(y: Array) -> tuple[float, Array, Array]:
        delta = y.reshape(-1, n + 2)[:, -1]
        gradient, hessian = np.zeros_like(y), np.zeros((len(y), len(y)))
        at = np.arange(n + 1, len(y), n + 2)
        gradient[at] = -1 / (delta + EPSILON)
        hessian[at, at] = np.square(gradient[at])
        return -float(np.log(np.maximum(delta + EPSILON, 1e-300)).sum()), gradient, hessian

    return term


def face_barrier(n: int, cap: float, points: Array) -> Term:
    """Returns the barrier -log of the slacks, in which |c_j| <= 1 and |c_j| <= d_j - delta_j are second-order cones.

    Args:
        cap: the largest offset d_j.
        points: (k, n) the points w_k.
    """
    # The linear slacks delta, cap - d and d - c'w_k are constant + rows v.
    rows = np.zeros((2 + len(points), n + 2))
    rows[0, -1], rows[1, -2], rows[2:, :n], rows[2:, -2] = 1.0, -1.0, -points, 1.0
    constant = np.zeros(len(rows))
    constant[1] = cap
    ball = np.diag([-1.0] * n + [0.0, 0.0])
    margin = ball.copy()
    margin[-2:, -2:] = [[1.0, -1.0], [-1.0, 1.0]]

    def term(y: Array) -> tuple[float, Array, Array]:
        v = y.reshape(-1, n + 2)
        slack = constant + v @ rows.T
        forms = [(float(offset), J, offset + np.einsum("mi,ij,mj->m", v, J, v)) for offset, J in ((1.0, ball), (0.0, margin))]
        outside = min(slack.min(), (v[:, -2] - v[:, -1]).min(), *(q.min() for _, _, q in forms)) <= 0
        if outside:
            return np.inf, np.zeros_like(y), np.zeros((len(y), len(y)))
        gradient = -(1 / slack) @ rows
        hessian = np.einsum("mk,ki,kj->mij", 1 / slack**2, rows, rows)
        value = -float(np.log(slack).sum())
        for _, J, q in forms:
            Jv = v @ J
            gradient -= 2 * Jv / q[:, None]
            hessian += 4 * Jv[:, :, None] * Jv[:, None, :] / q[:, None, None] ** 2 - 2 * J / q[:, None, None]
            value -= float(np.log(q).sum())
        return value, gradient.ravel(), _block_diagonal(hessian)

    return term


def _block_diagonal(blocks: Array) -> Array:
    m, k = blocks.shape[:2]
    matrix = np.zeros((m, k, m, k))
    matrix[np.arange(m), :, np.arange(m), :] = blocks
    return matrix.reshape(m * k, m * k)
