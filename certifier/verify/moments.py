"""Pseudo-moments are linear functionals on the polynomials of one side of a pair, given by their values on monomials.

Let k of the n joints be on the chain. Let m be the 3^k monomials of coordinate degree <= 2 in the chain's coordinates. Every polynomial of
the program is a combination of u_e m, e = 0 .. n, with u_0 = 1.

N = 3^k + k 3^(k-1) + (n - k) 3^k of these products are distinct. They stand in this order:

- first the m, with prod u_i^e_i at sum_i e_i 3^i;
- then, for every chain joint, the products in which its exponent is 3, at the same sum over the other joints of the chain;
- then, for every joint l that is not on the chain, the products u_l m.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from certifier.model import Array


@lru_cache(maxsize=64)
def table(chain: tuple[int, ...], n: int) -> np.ndarray:
    """Returns the index of every u_e m among the N monomials, (n + 1, 3^k)."""
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
    """Returns the exponents of the monomials, (N, n)."""
    index = table(chain, n)
    exponents = np.zeros((index.max() + 1, n), dtype=int)
    digits = np.arange(index.shape[1])[:, None] // 3 ** np.arange(len(chain)) % 3
    for e in range(n + 1):
        exponents[np.ix_(index[e], list(chain))] = digits
        if e:
            exponents[index[e], e - 1] += 1
    return exponents


def localised(moments: Array, weights: Array, chain: tuple[int, ...]) -> Array:
    """Returns x_v(g_j m), (F, V, 3^k), for moments (V, N) and weights g (F, n + 1) in [1, u]."""
    expanded = moments[:, table(chain, weights.shape[1] - 1)]
    return np.einsum("fe,vem->fvm", weights, expanded)
