"""The verifier bounds here, exactly, how far the sums of squares of one side of a proof miss the polynomials that they stand for.

For every vertex v of the side's volume the residual is, in the box's coordinates u and divided by sigma, the least value of den,

    e_v(u) = +-(a'p_v + b den)/sigma - (r kappa + t) den/sigma - sum_j g_j |L_j' rho|^2,   g_0 = 1.

On the box, where |u_i| <= 1, |e_v| is at most the sum of the absolute values of its coefficients.

Let m be the 3^k monomials of coordinate degree <= 2 in the chain's coordinates. Every part of e_v has the form sum_e u_e (c_e' m), with
u_0 = 1: the plane's coefficients times those of p_v, and the faces' coefficients times those of the squares. Both are matrix products of
integers (certifier.verify.limbs).

Only the coefficients of the numerators are rounded, down to multiples of 2^-128. What that can change is part of the bound.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from flint import fmpq

from certifier.errors import ProofError
from certifier.model import Array, Volume
from certifier.proof import limits
from certifier.proof.pair import Side, lower_triangle
from certifier.verify import limbs
from certifier.verify.kinematics import ExactKinematics, exact

POSITION_BITS = 128
KEPT_BYTES = 256 << 20
"""At most this many bytes of numerators are kept for proofs that may need them again."""
MAX_CHAIN = 7
"""A chain may have this many joints, so that no sum rounds.

With k joints, 4^k products of two limbs of a factor are added, and then 4 such sums, because a factor's 64 bits are 4 limbs. The result is
below 2^52. Then k + 1 differences of two products of matrices are added, which are 16 arrays below 2^48.
"""


@dataclass(frozen=True)
class Numerators:
    """Holds X_FB times its denominator over sigma, in units of 2^-POSITION_BITS, rounded down.

    Attributes:
        chain: position indices of the joints between F and B, ascending.
        columns: limbs of the (4, 4 * 3^k) integers. Row c holds column c of the matrix, its four entries one after the other. In each
            entry the monomial prod u_i^e_i is at sum_i e_i 3^i.
    """

    chain: tuple[int, ...]
    columns: Array

    @classmethod
    def between(cls, kinematics: ExactKinematics, frame: str, body: str) -> Numerators:
        """Returns the numerators from the frame of body F to body B.

        Raises:
            ProofError: more joints lie between them than MAX_CHAIN.
        """
        chain = tuple(kinematics.positions(frame, body))
        if len(chain) > MAX_CHAIN:
            raise ProofError("proof_too_large", f"more than {MAX_CHAIN} joints between {frame} and {body}")
        scale = fmpq(2) ** POSITION_BITS / kinematics.scale(frame, body)
        X, size = kinematics.pose(frame, body), 3 ** len(chain)
        places: dict[tuple[int, ...], int] = {}
        columns: list[list[int]] = [[], [], [], []]
        for c, i in itertools.product(range(4), repeat=2):
            values = [0] * size
            for powers, coefficient in X[i][c].to_dict().items():
                if powers not in places:
                    places[powers] = sum(powers[joint] * 3**position for position, joint in enumerate(chain))
                # The product is taken in integers, because to reduce its fraction would take longer.
                values[places[powers]] = int(coefficient.p * scale.p // (coefficient.q * scale.q))
            columns[c] += values
        return cls(chain, limbs.of_rows(columns))


class NumeratorCache:
    """Keeps numerators that were needed before, up to KEPT_BYTES of them, the latest."""

    def __init__(self) -> None:
        self._held: dict[tuple[int, str, str], Numerators] = {}
        self._bytes = 0

    def between(self, kinematics: ExactKinematics, frame: str, body: str) -> Numerators:
        """Returns the numerators from frame body F to body B.

        Raises:
            ProofError: as :meth:`Numerators.between`.
        """
        key = id(kinematics), frame, body
        found = self._held.pop(key, None)
        if found is None:
            found = Numerators.between(kinematics, frame, body)
            self._bytes += found.columns.nbytes
        self._held[key] = found
        while self._bytes > KEPT_BYTES and len(self._held) > 1:
            self._bytes -= self._held.pop(next(iter(self._held))).columns.nbytes
        return found


def largest_residual(
    numerators: Numerators, volume: Volume, side: Side, plane: Sequence[Sequence[fmpq]], weights: Sequence[Sequence[fmpq]]
) -> fmpq:
    """Returns the largest bound of |e_v| on the box, over the volume's vertices.

    Args:
        plane: (4, n + 1) coefficients in [1, u] of +-a, and of +-b - (r kappa + t); dyadic numbers.
        weights: (f + 1, n + 1) coefficients of 1 and of the faces used; dyadic numbers.

    Raises:
        ProofError: the factors do not fit the chain, the vertices or the faces.
    """
    vertices = [[*(exact(x) for x in vertex), fmpq(1)] for vertex in volume.vertices]
    n, size = len(plane[0]) - 1, 3 ** len(side.chain)
    length = 2 ** len(side.chain)
    shape = (len(vertices), len(weights), length * (length + 1) // 2)
    if side.chain != numerators.chain or side.mantissa.shape != shape or side.exponent.shape != (len(weights),):
        raise ProofError("proof_malformed", f"the Gram factors of {', '.join(volume.geometries)} do not fit")
    exponents = [2 * int(e) for e in side.exponent]
    if max(map(abs, exponents)) > 2 * limits.EXPONENT:
        raise ProofError("proof_malformed", "a Gram factor is out of range")

    (places, vertex_bits), plane_bits, weight_bits = dyadic(vertices), _bits(plane), _bits(weights)
    unit = max(POSITION_BITS + vertex_bits + plane_bits, weight_bits - min(exponents))
    normal = _integers(plane, [unit - POSITION_BITS - vertex_bits] * 4)
    faces = _integers(weights, [unit + e for e in exponents])

    positions = limbs.normal(limbs.product(limbs.of_rows(places), numerators.columns))
    positions = np.moveaxis(positions.reshape(len(positions), len(places), 4, size), 2, 1).reshape(len(positions), 4, -1)
    planes = limbs.product(_transposed(normal), positions)
    sums = limbs.product(_transposed(faces), _squares(side))
    missed = limbs.difference(planes, sums).reshape(-1, n + 1, len(places), size)
    rounding = size * sum(abs(x) for row in normal for x in row) * max(sum(map(abs, place)) for place in places)
    return fmpq(max(_coefficient_sums(missed, side.chain)) + rounding) / fmpq(2) ** unit


def dyadic(rows: Sequence[Sequence[fmpq]]) -> tuple[list[list[int]], int]:
    """Returns integers X and the least e >= 0 such that the rows are 2^-e X."""
    bits = _bits(rows)
    return _integers(rows, [bits] * len(rows)), bits


def _bits(values: Sequence[Sequence[fmpq]]) -> int:
    """Returns the least e >= 0 for which all 2^e x are integers."""
    return max(int(x.q).bit_length() for row in values for x in row) - 1


def _integers(values: Sequence[Sequence[fmpq]], bits: Sequence[int]) -> list[list[int]]:
    """Returns the integers 2^bits[i] times row i, for every row."""
    return [[int(x.p) << e + 1 - int(x.q).bit_length() for x in row] for row, e in zip(values, bits, strict=True)]


def _transposed(rows: list[list[int]]) -> Array:
    return limbs.of_rows(list(zip(*rows, strict=True)))


def _squares(side: Side) -> Array:
    """Returns |L_j' rho|^2 in units of 4^exponent_j, in normal limbs of the (f + 1, V * 3^k) integers."""
    length, (vertices, faces) = 2 ** len(side.chain), side.mantissa.shape[:2]
    mantissa = limbs.of_array(side.mantissa)
    rows, columns = lower_triangle(length)
    factor = np.zeros((len(mantissa), vertices * faces, length, length))
    factor[:, :, rows, columns] = mantissa.reshape(len(mantissa), vertices * faces, -1)
    gather = _gather(len(side.chain))
    squares = np.zeros((2 * len(factor) - 1, vertices * faces, gather.shape[1]))
    for p, q in itertools.product(range(len(factor)), repeat=2):
        squares[p + q] += (factor[p] @ np.swapaxes(factor[q], 1, 2)).reshape(vertices * faces, -1) @ gather
    squares = limbs.normal(squares).reshape(-1, vertices, faces, gather.shape[1])
    return np.swapaxes(squares, 1, 2).reshape(len(squares), faces, -1)


@lru_cache(maxsize=MAX_CHAIN + 1)
def _places(k: int) -> np.ndarray:
    """Returns where each monomial of degrees 0 to 2 stands among those of degrees 0 to 3, (3^k,)."""
    return np.array([sum(d * 4**i for i, d in enumerate(reversed(digits))) for digits in itertools.product(range(3), repeat=k)], dtype=int)


@lru_cache(maxsize=MAX_CHAIN + 1)
def _gather(k: int) -> Array:
    """Returns a matrix, (4^k, 3^k), that is 1 where rho_i rho_j is the monomial and 0 elsewhere."""
    subsets = np.array(list(itertools.product(range(2), repeat=k)), dtype=int).reshape(2**k, k)
    code = (subsets[:, None, :] + subsets[None, :, :]) @ 3 ** np.arange(k)
    return np.asarray(code.reshape(-1, 1) == np.arange(3**k), dtype=float)


def _coefficient_sums(missed: Array, chain: tuple[int, ...]) -> list[int]:
    """Returns, for every vertex, the sum of the absolute values of the coefficients of sum_e u_e (c_e' m), V integers.

    c is given in limbs (w, n + 1, V, 3^k).
    """
    k, width, place = len(chain), missed.shape[0], _places(len(chain))
    inside = np.zeros((width, missed.shape[2], 4**k))
    inside[:, :, place] += missed[:, 0]
    for position, joint in enumerate(chain):
        inside[:, :, place + 4**position] += missed[:, 1 + joint]
    outside = [1 + i for i in range(missed.shape[1] - 1) if i not in chain]
    rest = np.moveaxis(missed[:, outside], 1, 2).reshape(width, missed.shape[2], -1)
    return limbs.absolute_sums(np.concatenate([inside, rest], axis=2))
