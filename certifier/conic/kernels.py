"""Compiled loops run here over stacks of small symmetric matrices and form the Schur complement of certifier.conic.cone.

LAPACK spends most of a 16 x 16 factorisation on the call; here a whole stack is one call. The loops use one thread and allocate nothing
inside.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array

_ROWS = 27
"""A tile of the Schur complement has this many rows; the tile and its two factors stay in the second-level cache up to k = 4."""


@njit(cache=True, fastmath=True)
def cholesky_inverse(X: Array, inverse: Array) -> bool:
    """Computes the inverses of the lower Cholesky factors of a stack, (S, L, L).

    Returns:
        False at the first matrix that is not positive definite.
    """
    S, L = X.shape[0], X.shape[1]
    factor = np.empty((L, L))
    for s in range(S):
        for i in range(L):
            for j in range(i + 1):
                total = X[s, i, j]
                for k in range(j):
                    total -= factor[i, k] * factor[j, k]
                if i == j:
                    if not total > 0.0:
                        return False
                    factor[i, i] = np.sqrt(total)
                else:
                    factor[i, j] = total / factor[j, j]
        for j in range(L):
            for i in range(j):
                inverse[s, i, j] = 0.0
            inverse[s, j, j] = 1.0 / factor[j, j]
            for i in range(j + 1, L):
                total = 0.0
                for k in range(j, i):
                    total -= factor[i, k] * inverse[s, k, j]
                inverse[s, i, j] = total / factor[i, i]
    return True


@njit(cache=True)
def substitute(lower: Array, X: Array, transposed: bool) -> None:
    """Solves L Y = X, or L' Y = X, in place for a stack of lower triangles, (R, N, N) and (R, N, p)."""
    R, N, p = X.shape
    for r in range(R):
        L, x = lower[r], X[r]
        for step in range(N):
            i = N - 1 - step if transposed else step
            if not transposed:
                for j in range(i):
                    for c in range(p):
                        x[i, c] -= L[i, j] * x[j, c]
            inverse = 1.0 / L[i, i]
            for c in range(p):
                x[i, c] *= inverse
            if transposed:
                for j in range(i):
                    for c in range(p):
                        x[j, c] -= L[i, j] * x[i, c]


@njit(cache=True, fastmath=True)
def lowest_relative_eigenvalue(inverse: Array, D: Array, tolerance: float) -> float:
    """Returns the least eigenvalue over a stack of L^-1 D L^-T, to a relative tolerance; it is never above the true one by more than that.

    The method is Householder tridiagonalisation, then bisection on Sturm sequences. A matrix is skipped as soon as it is known to lie above
    the least eigenvalue found so far.
    """
    S, L = D.shape[0], D.shape[1]
    T = np.empty((L, L))
    half = np.empty((L, L))
    diagonal, off, v, w = np.empty(L), np.empty(L), np.empty(L), np.empty(L)
    lowest = np.inf
    for s in range(S):
        for i in range(L):
            for j in range(L):
                half[i, j] = 0.0
            for k in range(i + 1):
                factor = inverse[s, i, k]
                for j in range(L):
                    half[i, j] += factor * D[s, k, j]
        for i in range(L):
            for j in range(i + 1):
                total = 0.0
                for k in range(j + 1):
                    total += half[i, k] * inverse[s, j, k]
                T[i, j] = total
                T[j, i] = total
        for k in range(L - 2):
            norm = 0.0
            for i in range(k + 1, L):
                norm += T[i, k] * T[i, k]
            norm = np.sqrt(norm)
            if norm == 0.0:
                continue
            alpha = -norm if T[k + 1, k] > 0 else norm
            for i in range(k + 1, L):
                v[i] = T[i, k]
            v[k + 1] -= alpha
            square = 0.0
            for i in range(k + 1, L):
                square += v[i] * v[i]
            if square == 0.0:
                continue
            scale = 2.0 / square
            product = 0.0
            for i in range(k + 1, L):
                total = 0.0
                for j in range(k + 1, L):
                    total += T[i, j] * v[j]
                w[i] = scale * total
                product += w[i] * v[i]
            product *= 0.5 * scale
            for i in range(k + 1, L):
                w[i] -= product * v[i]
            for i in range(k + 1, L):
                for j in range(k + 1, L):
                    T[i, j] -= v[i] * w[j] + w[i] * v[j]
            T[k + 1, k] = alpha
        low, high = np.inf, np.inf
        for i in range(L):
            diagonal[i] = T[i, i]
            off[i] = T[i, i - 1] if i > 0 else 0.0
        for i in range(L):
            reach = abs(off[i]) + (abs(off[i + 1]) if i + 1 < L else 0.0)
            low = min(low, diagonal[i] - reach)
            high = min(high, diagonal[i])
        if low >= lowest or _count_below(diagonal, off, lowest) == 0:
            continue
        high = min(high, lowest)
        while high - low > tolerance * max(abs(low), abs(high), 1e-300):
            middle = 0.5 * (low + high)
            if _count_below(diagonal, off, middle) > 0:
                high = middle
            else:
                low = middle
        lowest = min(lowest, low)
    return lowest


@njit(cache=True)
def adjoint(weights: Array, slopes: Array, grid: int, products: Array, x: Array) -> Array:
    """Returns Lambda_j(x), (R K, L^2), as certifier.conic.cone has it.

    x is (R, N), and products is (N_A, L^2), those of rho.
    """
    R, (K, NA) = len(x), weights.shape
    scaled = np.empty((R * K, NA))
    for r in range(R):
        for k in range(K):
            row = scaled[r * K + k]
            for i in range(NA):
                row[i] = weights[k, i] * x[r, i]
            for joint in range(slopes.shape[1]):
                slope, start = slopes[k, joint], NA + joint * grid
                if slope != 0.0:
                    for i in range(grid):
                        row[i] += slope * x[r, start + i]
    return np.dot(scaled, products)


@njit(cache=True)
def values(weights: Array, slopes: Array, grid: int, products: Array, Q: Array) -> Array:
    """Returns the coordinates of sum_j g_j rho' Q_j rho, (R, N), as certifier.conic.cone has it.

    Q is (R K, L^2), and products is (L^2, N_A), those of rho.
    """
    K, NA = weights.shape
    R, squares = len(Q) // K, np.dot(Q, products)
    sums = np.zeros((R, NA + slopes.shape[1] * grid))
    for r in range(R):
        for k in range(K):
            row = squares[r * K + k]
            for i in range(NA):
                sums[r, i] += weights[k, i] * row[i]
            for joint in range(slopes.shape[1]):
                slope, start = slopes[k, joint], NA + joint * grid
                if slope != 0.0:
                    for i in range(grid):
                        sums[r, start + i] += slope * row[i]
    return sums


@njit(cache=True)
def line_search(eigenvalues: Array, slope: Array) -> Array:
    """Returns the minimisers a, (R,), of a slope_r - sum_i log(1 + a eigenvalue_ri), by safeguarded Newton's method from 0."""
    lengths = np.empty(len(slope))
    for r in range(len(slope)):
        lowest, a, following = eigenvalues[r].min(), 0.0, 0.0
        upper = -0.99 / lowest if lowest < 0 else 1e3
        for _ in range(30):
            first, second = 0.0, 0.0
            for value in eigenvalues[r]:
                term = value / (1 + a * value)
                first += term
                second += term * term
            if second == 0.0:  # nothing moves
                break
            following = min(max(a + (first - slope[r]) / second, 0.0), a + 0.9 * (upper - a))
            if abs(following - a) < 1e-3 * max(following, 1e-3):
                break
            a = following
        lengths[r] = following
    return lengths


@njit(cache=True)
def _count_below(diagonal: Array, off: Array, x: float) -> int:
    """Returns 1 if the tridiagonal matrix has an eigenvalue below x, else 0 (Sturm)."""
    if x == np.inf:
        return 1
    pivot = 1.0
    for i in range(len(diagonal)):
        pivot = diagonal[i] - x - off[i] * off[i] / pivot
        if pivot < 0.0:
            return 1
        if pivot == 0.0:
            pivot = 1e-300
    return 0


@njit(cache=True, fastmath=True)
def schur(rho: Array, weights: Array, slopes: Array, grid: int, Q: Array, S: Array, H: Array) -> None:
    """Adds to H, (R, N, N), the lower triangles of sum_k (g_k g_k') o (rho Q_k rho') o (rho S_k rho'), as conic.cone expands it."""
    R, K = Q.shape[0], Q.shape[1]
    NA, outside = rho.shape[0], slopes.shape[1]
    rho_t = np.ascontiguousarray(rho.T)
    for r in range(R):
        for first in range(0, NA, _ROWS):
            # Tiles of grid rows need every column, for the blocks of the outside joints; the other tiles need the lower triangle.
            last = min(first + _ROWS, NA)
            width = NA if first < grid and outside > 0 else last
            columns = np.ascontiguousarray(rho_t[:, :width])
            for k in range(K):
                A = np.dot(np.dot(rho[first:last], Q[r, k]), columns)
                B = np.dot(np.dot(rho[first:last], S[r, k]), columns)
                for i in range(first, last):
                    product = A[i - first]
                    other = B[i - first]
                    for j in range(width):
                        product[j] *= other[j]
                    gi = weights[k, i]
                    for j in range(i + 1):
                        H[r, i, j] += gi * weights[k, j] * product[j]
                    if i >= grid:
                        continue
                    for a in range(outside):
                        ea = slopes[k, a]
                        if ea == 0.0:
                            continue
                        row = NA + a * grid + i
                        for j in range(NA):
                            H[r, row, j] += ea * weights[k, j] * product[j]
                        for b in range(a):
                            eb = ea * slopes[k, b]
                            column = NA + b * grid
                            for j in range(grid):
                                H[r, row, column + j] += eb * product[j]
                        column = NA + a * grid
                        for j in range(i + 1):
                            H[r, row, column + j] += ea * ea * product[j]
