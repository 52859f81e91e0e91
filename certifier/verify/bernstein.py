"""Bernstein polynomials of degree 3 in k variables, given by their control values, are multiplied, halved and summed up here.

Everything is a sum of products, mostly one by BLAS. certifier.verify.control_points says how much rounding may change.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from certifier.model import Array

_LOWER = np.array([[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [0.25, 0.5, 0.25, 0.0], [0.125, 0.375, 0.375, 0.125]])
HALVES = _LOWER, _LOWER[::-1, ::-1].copy()
"""These take the control values of a cubic polynomial on [0, 1] to those on [0, 1/2] and on [1/2, 1]: de Casteljau's algorithm."""
_WIDE = tuple(np.kron(half, np.eye(4)).T.copy() for half in HALVES)


def raised(a: Array, b: Array) -> Array:
    """Returns the product, of degree 3, of values of degree 2, (B, k, 3, ...), and the linear forms b, (2, B, k), as (B, k, 4, ...)."""
    a0, a1, a2 = np.moveaxis(a, 2, 0)
    b0, b1 = b.reshape(*b.shape, *[1] * (a.ndim - 3))
    return np.stack([a0 * b0, (2.0 * a1 * b0 + a0 * b1) / 3.0, (a2 * b0 + 2.0 * a1 * b1) / 3.0, a2 * b1], axis=2)


def half_of(a: Array, axis: int, k: int, upper: bool) -> Array:
    """Returns the control values, (..., 4^k), of the lower or the upper half along an axis."""
    inner = 4 ** (k - 1 - axis)
    if inner == 1:
        half: Array = a.reshape(-1, 4) @ HALVES[upper].T
    elif inner == 4:  # BLAS is faster with the zeros of one matrix than with many small ones
        half = a.reshape(-1, 16) @ _WIDE[upper]
    else:
        half = HALVES[upper] @ a.reshape(-1, 4, inner)
    return half.reshape(a.shape)


def products(factors: Array) -> list[Array]:
    """Returns the control values, (B, 4^i), of the products of the last i of k polynomials in one variable each, (B, k, 4), for all i."""
    B, k = factors.shape[:2]
    found: list[Array] = [np.ones((B, 1))]
    for i in reversed(range(k)):
        found.append((factors[:, i, :, None] @ found[-1][:, None]).reshape(B, -1))
    return found


def combined(weights: Array, factors: Array, others: Array, D: Sequence[Array]) -> Array:
    """Returns weights_0 D + sum_i weights_(1 + i) T_i, (B, V, 4^k). T_i is a product with others_i in the place of factors_i.

    Args:
        weights: (B, V, 1 + k).
        factors: (B, k, 4).
        others: (B, k, 4).
        D: the products of the factors.
    """
    B, V = weights.shape[:2]
    found = weights[..., :1]
    for i, below in zip(reversed(range(factors.shape[1])), D, strict=False):
        two = np.stack([found, np.broadcast_to(below[:, None], found.shape)], axis=2)
        step = np.stack([np.broadcast_to(factors[:, None, i], (B, V, 4)), weights[..., 1 + i, None] * others[:, None, i]], axis=-1)
        found = (step @ two).reshape(B, V, -1)
    return found
