"""Cosines and sines of many angles, in doubles, with a bound of their errors. NumPy's own depend on the processor and promise nothing.

An angle x loses k quarter turns: y = (x - k P1) - k P2 with P1 + P2 = pi/2. P1 has 33 bits, so k P1 is exact for |k| < 2^20, and the
subtraction is wrong by at most 2^-53. P2 is wrong by less than 2^-86, and k P2, below 2^-12, by less than 2^-65. So y is wrong by less
than 2^-52, and at most 0.79 in magnitude, but for 2^-20. There the series of Taylor end: the next terms are below 2^-66. Every step of
their evaluation multiplies what was wrong before by less than 0.4 and rounds twice, so the value is wrong by less than 2^-50.
"""

from __future__ import annotations

import numpy as np
from flint import arb, ctx

from certifier.errors import ProofError
from certifier.model import Array

ERROR = 2.0**-49
"""A cosine or a sine is wrong by less than this."""
LARGEST = 1e6
"""Angles are at most this large, in radians."""


def _quarter_turn() -> tuple[float, float]:
    with ctx.workprec(256):
        first = float((arb.pi() / 2 * 2**32).floor().unique_fmpz()) / 2**32
        return first, float((arb.pi() / 2 - arb(first)).mid())


P1, P2 = _quarter_turn()


def cosines_and_sines(angles: Array) -> tuple[Array, Array]:
    """Returns the cosines and the sines of angles, in radians, each wrong by less than ERROR.

    Raises:
        ProofError: an angle is larger than LARGEST.
    """
    if angles.size and not np.abs(angles).max() <= LARGEST:
        raise ProofError("proof_too_large", f"an angle of the proof is larger than {LARGEST:g}")
    k = np.rint(angles / (P1 + P2))
    y = (angles - k * P1) - k * P2
    square = y * y
    cosine, sine = np.ones_like(y), np.ones_like(y)
    for i in range(18, 0, -2):
        cosine = 1.0 - square / (i * (i - 1)) * cosine
        sine = 1.0 - square / (i * (i + 1)) * sine
    sine = y * sine
    quarter = k.astype(np.int64) % 4
    turned, sign = quarter % 2 == 1, np.where(quarter >= 2, -1.0, 1.0)
    return np.where(turned, -sine, cosine) * sign, np.where(turned, cosine, sine) * sign
