"""Pseudo-moments: linear functionals on the polynomials of one side of a pair, by their values on monomials.

With k chain joints out of n and m the 3^k monomials of coordinate degree <= 2 in the chain's coordinates, every polynomial of the program
is a combination of u_e m, e = 0 .. n, u_0 = 1. The distinct ones, N = 3^k + k 3^(k-1) + (n - k) 3^k, in this order: the m, prod u_i^e_i at
sum_i e_i 3^i; for every chain joint those with its exponent 3, at the same sum over the others; for every other joint u_l m.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from certifier.model import Array


@lru_cache(maxsize=64)
def table(chain: tuple[int, ...], n: int) -> np.ndarray:
    """(n + 1, 3^k) index of u_e m among the N monomials."""
    k, size = len(chain), 3 ** len(chain)
    code = np.arange(size)
    digits = code[:, None] // 3 ** np.arange(k) % 3
    index = np.zeros((n + 1, size), dtype=int)
    index[0] = code
    for position, joint in enumerate(chain):
        low = code % 3**position
        others = low + (code // 3 ** (position + 1)) * 3**position
        index[1 + joint] = np.where(digits[:, position] < 2, code + 3**position, size + position * (size // 3) + others)
    first = size + k * (size // 3)
    for place, joint in enumerate(i for i in range(n) if i not in chain):
        index[1 + joint] = first + place * size + code
    return index


def monomials(chain: tuple[int, ...], n: int) -> np.ndarray:
    """(N, n) exponents of the monomials."""
    index = table(chain, n)
    exponents = np.zeros((index.max() + 1, n), dtype=int)
    digits = np.arange(index.shape[1])[:, None] // 3 ** np.arange(len(chain)) % 3
    for e in range(n + 1):
        exponents[np.ix_(index[e], list(chain))] = digits
        if e:
            exponents[index[e], e - 1] += 1
    return exponents


def localised(moments: Array, weights: Array, chain: tuple[int, ...]) -> Array:
    """x_v(g_j m) for moments (V, N) and weights g (F, n + 1) in [1, u]: (F, V, 3^k)."""
    expanded = moments[:, table(chain, weights.shape[1] - 1)]
    return np.einsum("fe,vem->fvm", weights, expanded)
