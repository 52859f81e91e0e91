"""BLAS multiplies arrays of integers exactly, when they are held as this module holds them.

An array of integers X is held as doubles x of shape (w, ...), its *limbs*: X = sum_i x[i] 2^(16 i). The limbs are *normal* when
0 <= x[i] < 2^16 for all but the last one. The last limb carries the sign and lies in [-2^15, 2^15).

Why no operation rounds:

Every double that occurs is an integer below 2^53 in magnitude. Sums, differences and products of integers are exact in double precision
as long as they stay below 2^53. This is so in whatever order they are added, and with or without fused multiply-add.

A product of two limbs is at most 2^32, and :func:`product` refuses to add more than 2^16 of them. So its limbs stay below 2^48, and up to
16 such arrays may be added before :func:`normal` is called. In :func:`normal`, 2^-16 x and floor are exact, and the carries stay below
2^37. :func:`absolute_sums` adds normal limbs, and any memory holds fewer than 2^37 of them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from certifier.errors import ProofError
from certifier.model import Array

BITS = 16
BASE = float(1 << BITS)
MAX_TERMS = 1 << 16


def of_rows(rows: Sequence[Sequence[int]]) -> Array:
    """Returns normal limbs of Python integers, (w, r, c)."""
    width = max((value.bit_length() for row in rows for value in row), default=0) // BITS + 1
    words = b"".join(value.to_bytes(2 * width, "little", signed=True) for row in rows for value in row)
    return _of_words(np.frombuffer(words, dtype="<u2").reshape(len(rows), -1, width))


def of_array(values: np.ndarray) -> Array:
    """Returns normal limbs of an int64 array, (w, *shape)."""
    return _trimmed(_of_words(np.ascontiguousarray(values, dtype="<i8").view("<u2").reshape(*values.shape, 4)))


def _of_words(words: np.ndarray) -> Array:
    limbs = np.ascontiguousarray(np.moveaxis(words, -1, 0), dtype=float)
    limbs[-1] -= BASE * (limbs[-1] >= BASE / 2)
    return limbs


def normal(x: Array) -> Array:
    """Returns the same integers in normal limbs; the limbs given must be integers below 2^52 in magnitude."""
    return _trimmed(_carried(x))


def _carried(x: Array) -> Array:
    """Returns normal limbs, of which the last ones may not be needed."""
    # Three more limbs take up what reaches beyond the last one.
    limbs = np.concatenate([x, np.zeros((3, *x.shape[1:]))])
    carry = np.empty(x.shape[1:])
    for low, high in itertools.pairwise(limbs):
        np.multiply(low, 1 / BASE, out=carry)
        np.floor(carry, out=carry)
        high += carry
        carry *= BASE
        low -= carry
    return limbs


def _trimmed(x: Array) -> Array:
    """Returns the limbs without leading ones that only repeat the sign."""
    while len(x) > 1:
        last = x[-2] + BASE * x[-1]
        if last.size and (last.min() < -BASE / 2 or last.max() >= BASE / 2):
            break
        x = x[:-1]
        x[-1] = last
    return x


def product(A: Array, B: Array) -> Array:
    """Returns limbs of the matrix product of A, (a, r, s), and B, (b, s, c), whose limbs must be normal.

    The limbs returned, (a + b - 1, r, c), are below 2^48 and not normal.

    Raises:
        ProofError: a sum has more than MAX_TERMS terms, so it might round.
    """
    (a, r, s), (b, _, c) = A.shape, B.shape
    if s * min(a, b) > MAX_TERMS:
        raise ProofError("proof_too_large", f"sums of {s * min(a, b)} products, more than {MAX_TERMS}")
    blocks = (A.reshape(a * r, s) @ B.transpose(1, 0, 2).reshape(s, b * c)).reshape(a, r, b, c).transpose(0, 2, 1, 3)
    limbs = np.zeros((a + b - 1, r, c))
    for i, block in enumerate(blocks):
        limbs[i : i + b] += block
    return limbs


def difference(A: Array, B: Array) -> Array:
    """Returns limbs of A - B, for A (a, ...) and B (b, ...); they are not normal."""
    limbs = np.zeros((max(len(A), len(B)), *A.shape[1:]))
    limbs[: len(A)] += A
    limbs[: len(B)] -= B
    return limbs


def integers(x: Array) -> list[list[int]]:
    """Returns the integers X of shape (r, c), for limbs (w, r, c), normal or not."""
    return [[_integer(x[:, i, j]) for j in range(x.shape[2])] for i in range(x.shape[1])]


def absolute_sums(x: Array) -> list[int]:
    """Returns the sums of |X| over the last axis, r integers, for X of shape (r, c) in limbs (w, r, c) below 2^52."""
    limbs = _carried(x)
    sums = np.where(limbs[-1] < 0, -limbs, limbs).sum(axis=-1)
    return [_integer(row) for row in sums.T]


def _integer(limbs: Array) -> int:
    value = 0
    for limb in limbs[::-1].astype(np.int64).tolist():
        value = (value << BITS) + limb
    return value
