"""The polynomial space of one side of a pair has a sampled basis (C-IRIS B.2; Loefberg and Parrilo 2004).

Let the chain have k joints with coordinates u_A. Then every polynomial of the program is

    f = f_0(u_A) + sum_l u_l f_l(u_A),   l the joints in play outside the chain.

f_l lies in the span of the monomials of coordinate degree <= 2. f_0 lies in that span and its products with one more u_j, where j is
one of the c joints in play on the chain.

The coordinates of f are the values of f_0 at 3^k + c 3^(k-1) points and of each f_l at the first 3^k of them. rho holds the 2^k products
of distinct chain coordinates.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from certifier.model import Array

NODES = np.array([-0.875, 0.0, 0.875, 0.5])
"""These are the one-dimensional nodes. The points of the lower set of exponents e are NODES[e], unisolvent, with condition 13 at k = 4."""


@dataclass(frozen=True)
class Basis:
    """A basis consists of sample points and rho for k chain joints, in coordinates u in [-1, 1]^k.

    Attributes:
        cubic: the c coordinates that may have degree 3, ascending.
        points: (N_A, k), N_A = 3^k + c 3^(k-1); the first ``grid`` = 3^k are the tensor grid.
        rho: (N_A, 2^k), orthonormal products sqrt(3)^|S| prod_{i in S} u_i at the points.
        inverse: (N_A, N_A), maps values to Chebyshev coefficients.
    """

    k: int
    cubic: tuple[int, ...]
    grid: int
    points: Array
    rho: Array
    inverse: Array

    def functional(self, u: Array) -> tuple[Array, Array]:
        """Returns evaluation at u, (S, k), as weights on the points: (S, N_A) exact on f_0's space, and (S, 3^k) exact on f_l's."""
        weights = _chebyshev(u, exponents(self.k, self.cubic)) @ self.inverse
        nodes = NODES[:3]
        line = np.stack([np.prod([(u - nodes[j]) / (nodes[i] - nodes[j]) for j in range(3) if j != i], axis=0) for i in range(3)], -1)
        grid_exponents = exponents(self.k, ())
        grid = np.ones((len(u), self.grid))
        for j in range(self.k):
            grid *= line[:, j, grid_exponents[:, j]]
        return weights, grid


def dimension(k: int, cubic: int, outside: int) -> int:
    """Returns N of B.2, the dimension of the polynomial space with k chain joints, ``cubic`` of them and ``outside`` others in play."""
    return 3**k + (cubic * 3**k) // 3 + outside * 3**k


def exponents(k: int, cubic: tuple[int, ...]) -> np.ndarray:
    """Returns the exponents of the lower set, (N_A, k): first {0,1,2}^k, then those with exactly one 3."""
    grid = list(itertools.product(range(3), repeat=k))
    threes = [(*e[:j], 3, *e[j:]) for j in cubic for e in itertools.product(range(3), repeat=k - 1)]
    return np.array(grid + threes, dtype=int).reshape(dimension(k, len(cubic), 0), k)


def subsets(k: int) -> np.ndarray:
    """Returns which coordinates are in which product of rho, (2^k, k), as 0 and 1."""
    return np.array(list(itertools.product(range(2), repeat=k)), dtype=int).reshape(2**k, k)


def rho(u: Array) -> Array:
    """Returns the orthonormal multilinear basis at u, (S, k) -> (S, 2^k)."""
    values = np.ones((len(u), 1))
    for j in range(u.shape[1]):
        values = (values[:, :, None] * np.stack([np.ones(len(u)), np.sqrt(3) * u[:, j]], -1)[:, None, :]).reshape(len(u), -1)
    return values


@lru_cache(maxsize=64)
def basis(k: int, cubic: tuple[int, ...]) -> Basis:
    """Returns the basis for k chain joints, those of ``cubic`` in play; it is cached, for it depends on nothing else."""
    powers = exponents(k, cubic)
    points = NODES[powers]
    return Basis(k, cubic, 3**k, points, rho(points), np.linalg.inv(_chebyshev(points, powers)))


def _chebyshev(u: Array, powers: np.ndarray) -> Array:
    """Returns products of Chebyshev polynomials at u, (S, k) -> (S, len(powers))."""
    one = np.stack([np.ones_like(u), u, 2 * u**2 - 1, 4 * u**3 - 3 * u])
    values = np.ones((len(u), len(powers)))
    for j in range(u.shape[1]):
        values *= one[powers[:, j], :, j].T
    return values
