"""Exact integer arrays whose products are done by BLAS.

An array of integers X is held as doubles x of shape (w, ...), its *limbs*: X = sum_i x[i] 2^(16 i). It is *normal* when
0 <= x[i] < 2^16 for all but the last limb, which carries the sign and lies in [-2^15, 2^15).

Why no operation rounds: every double that occurs is an integer below 2^53 in magnitude, and sums, differences and products of
integers are exact in double precision as long as they stay below it, in whatever order they are added and with or without fused
multiply-add. A product of two limbs is at most 2^32, and :func:`product` refuses to add more than 2^16 of them: its limbs stay
below 2^48, and up to 16 such arrays may be added before :func:`normal`. There 2^-16 x and floor are exact, the carries stay below 2^37.
:func:`absolute_sums` adds normal limbs, fewer than 2^37 of them in any memory.
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
    """Normal limbs of Python integers, (w, r, c)."""
    width = max((value.bit_length() for row in rows for value in row), default=0) // BITS + 1
    words = b"".join(value.to_bytes(2 * width, "little", signed=True) for row in rows for value in row)
    return _of_words(np.frombuffer(words, dtype="<u2").reshape(len(rows), -1, width))


def of_array(values: np.ndarray) -> Array:
    """Normal limbs of an int64 array, (w, *shape)."""
    return _trimmed(_of_words(np.ascontiguousarray(values, dtype="<i8").view("<u2").reshape(*values.shape, 4)))


def _of_words(words: np.ndarray) -> Array:
    limbs = np.ascontiguousarray(np.moveaxis(words, -1, 0), dtype=float)
    limbs[-1] -= BASE * (limbs[-1] >= BASE / 2)
    return limbs


def normal(x: Array) -> Array:
    """The same integers in normal limbs; the limbs given are integers below 2^52 in magnitude."""
    return _trimmed(_carried(x))


def _carried(x: Array) -> Array:
    """Normal limbs, the last ones perhaps without need."""
    # Three limbs more take up what reaches beyond the last one.
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
    """Without leading limbs that only repeat the sign."""
    while len(x) > 1:
        last = x[-2] + BASE * x[-1]
        if last.size and (last.min() < -BASE / 2 or last.max() >= BASE / 2):
            break
        x = x[:-1]
        x[-1] = last
    return x


def product(A: Array, B: Array) -> Array:
    """Limbs, not normal, of the matrix product of normal A, (a, r, s), and normal B, (b, s, c): (a + b - 1, r, c), below 2^48.

    Raises:
        ProofError: so many terms that a sum might round.
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
    """Limbs of A - B, shapes (a, ...) and (b, ...), not normal."""
    limbs = np.zeros((max(len(A), len(B)), *A.shape[1:]))
    limbs[: len(A)] += A
    limbs[: len(B)] -= B
    return limbs


def integers(x: Array) -> list[list[int]]:
    """The integers X of shape (r, c), for limbs (w, r, c), normal or not."""
    return [[_integer(x[:, i, j]) for j in range(x.shape[2])] for i in range(x.shape[1])]


def absolute_sums(x: Array) -> list[int]:
    """Sums of |X| over the last axis, for X of shape (r, c) in limbs (w, r, c) below 2^52: r integers."""
    limbs = _carried(x)
    sums = np.where(limbs[-1] < 0, -limbs, limbs).sum(axis=-1)
    return [_integer(row) for row in sums.T]


def _integer(limbs: Array) -> int:
    value = 0
    for limb in limbs[::-1].astype(np.int64).tolist():
        value = (value << BITS) + limb
    return value
