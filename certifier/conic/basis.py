"""The polynomial space of one side of a pair, in a sampled basis (C-IRIS B.2; Loefberg and Parrilo 2004).

With k joints on the chain (coordinates u_A) and other joints in play, every polynomial of the program is
f = f_0(u_A) + sum_l u_l f_l(u_A), l the joints in play outside the chain, with f_l in the span of the monomials of coordinate degree <= 2,
and f_0 in that span and its products with one more u_j, j the c joints in play on the chain. Its coordinates are the values of f_0 at
3^k + c 3^(k-1) points and of each f_l at the first 3^k of them. rho holds the 2^k products of distinct chain coordinates.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from certifier.model import Array

NODES = np.array([-0.875, 0.0, 0.875, 0.5])
"""One-dimensional nodes; the points of the lower set of exponents e are NODES[e], unisolvent, condition 13 at k = 4."""


@dataclass(frozen=True)
class Basis:
    """Sample points and rho for k chain joints, in coordinates u in [-1, 1]^k.

    Attributes:
        cubic: the c coordinates that may have degree 3, ascending.
        points: (N_A, k), N_A = 3^k + c 3^(k-1); the first ``grid`` = 3^k are the tensor grid.
        rho: (N_A, 2^k), orthonormal products sqrt(3)^|S| prod_{i in S} u_i at the points.
        inverse: (N_A, N_A), Chebyshev coefficients from values.
    """

    k: int
    cubic: tuple[int, ...]
    grid: int
    points: Array
    rho: Array
    inverse: Array

    def functional(self, u: Array) -> tuple[Array, Array]:
        """Evaluation at u, (S, k), as weights on the points: (S, N_A) exact on f_0's space, (S, 3^k) exact on f_l's."""
        weights = _chebyshev(u, exponents(self.k, self.cubic)) @ self.inverse
        nodes = NODES[:3]
        line = np.stack([np.prod([(u - nodes[j]) / (nodes[i] - nodes[j]) for j in range(3) if j != i], axis=0) for i in range(3)], -1)
        grid_exponents = exponents(self.k, ())
        grid = np.ones((len(u), self.grid))
        for j in range(self.k):
            grid *= line[:, j, grid_exponents[:, j]]
        return weights, grid


def dimension(k: int, cubic: int, outside: int) -> int:
    """N of B.2: dimension of the polynomial space with k chain joints, ``cubic`` of them and ``outside`` others in play."""
    return 3**k + (cubic * 3**k) // 3 + outside * 3**k


def exponents(k: int, cubic: tuple[int, ...]) -> np.ndarray:
    """(N_A, k) exponents of the lower set: first {0,1,2}^k, then those with exactly one 3."""
    grid = list(itertools.product(range(3), repeat=k))
    threes = [(*e[:j], 3, *e[j:]) for j in cubic for e in itertools.product(range(3), repeat=k - 1)]
    return np.array(grid + threes, dtype=int).reshape(dimension(k, len(cubic), 0), k)


def subsets(k: int) -> np.ndarray:
    """(2^k, k) membership of each coordinate in each product of rho."""
    return np.array(list(itertools.product(range(2), repeat=k)), dtype=int).reshape(2**k, k)


def rho(u: Array) -> Array:
    """Orthonormal multilinear basis at u, (S, k) -> (S, 2^k)."""
    values = np.ones((len(u), 1))
    for j in range(u.shape[1]):
        values = (values[:, :, None] * np.stack([np.ones(len(u)), np.sqrt(3) * u[:, j]], -1)[:, None, :]).reshape(len(u), -1)
    return values


@lru_cache(maxsize=64)
def basis(k: int, cubic: tuple[int, ...]) -> Basis:
    """The basis for k chain joints, those of ``cubic`` in play; cached, it depends on nothing else."""
    powers = exponents(k, cubic)
    points = NODES[powers]
    return Basis(k, cubic, 3**k, points, rho(points), np.linalg.inv(_chebyshev(points, powers)))


def _chebyshev(u: Array, powers: np.ndarray) -> Array:
    """Products of Chebyshev polynomials at u, (S, k) -> (S, len(powers))."""
    one = np.stack([np.ones_like(u), u, 2 * u**2 - 1, 4 * u**3 - 3 * u])
    values = np.ones((len(u), len(powers)))
    for j in range(u.shape[1]):
        values *= one[powers[:, j], :, j].T
    return values
