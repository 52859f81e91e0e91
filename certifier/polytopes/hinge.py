"""The linear program of a face: what has to go lies beyond it, what has to stay before it, and the hinge loss of all else is least.

The program of a face x'p = b is

    min  sum over rest of max(0, margin + x'p - b)   s.t.  x'p >= b for p in far,  x'p <= b - 1 for p in near

Its dual has a column y_p for each point, with bounds, and only k + 1 rows, whose multipliers are x and b:

    min  c'y   s.t.  A y = 0,  0 <= y <= u

The dual simplex method with long steps solves it: most columns go from one bound to the other on the way, without being in a basis
(Maros, A generalized dual phase-2 simplex algorithm, European Journal of Operational Research 149, 2003). Growth solves thousands of these
programs. One takes less than a tenth of what HiGHS needs for it (docs/measurements.md).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array

_MOST = 1e6
"""The bound of columns that have none. Where one is there, no face separates the points, or only one without room."""
_PIVOT, _ROUNDED = 1e-10, 1e-9
"""An entry of the tableau that is smaller than the first is 0. A basic column may be outside of its bounds by the second."""
_AFRESH, _STEPS = 50, 2000
"""The inverse of the basis is computed anew after _AFRESH steps. There are at most _STEPS; hardly any program takes a hundred."""
_LOWER, _UPPER, _BASIC = 0, 1, 2


def hinge_face(far: Array, near: Array, rest: Array, margin: float) -> tuple[Array, float] | None:
    """Returns the face x (k,), b with ``far`` beyond it, ``near`` before it, and little of ``rest`` (h, k) beyond it; None without one."""
    columns = np.ones((len(far) + len(near) + len(rest), far.shape[1] + 1))
    np.concatenate([-far, near, rest], out=columns[:, :-1])
    columns[len(far) :, -1] = -1.0
    costs = np.concatenate([np.zeros(len(far)), -np.ones(len(near)), np.full(len(rest), -margin)])
    upper = np.concatenate([np.full(len(far) + len(near), _MOST), np.ones(len(rest))])
    x, y = np.empty(columns.shape[1]), np.zeros(len(columns))
    if not _solved(columns, costs, upper, x, y) or (y[: len(far) + len(near)] > _MOST / 2).any():
        return None
    return x[:-1], float(x[-1])


@njit(cache=True)
def _solved(columns: Array, costs: Array, upper: Array, x: Array, y: Array) -> bool:
    """Fills in the rows' multipliers x, (m,), and the columns y, (N,), of the program above; says whether the method has ended.

    Args:
        columns: (N, m), the columns of A.
        y: zeros.
    """
    N, m = columns.shape
    # The first basis is of m artificial columns, which are fixed at 0 and do not come back. They are numbered N, ..., N + m - 1.
    basis, inverse, inside = np.arange(N, N + m), np.eye(m), np.empty(m)
    state, reduced = np.zeros(N, dtype=np.int8), costs.copy()
    for j in range(N):
        if costs[j] < 0.0:
            state[j], y[j] = _UPPER, upper[j]
    for step in range(_STEPS):
        if step % _AFRESH == _AFRESH - 1:
            inverse = _inverse(columns, basis)
        inside[:] = 0.0
        for j in range(N):
            if state[j] != _BASIC and y[j] != 0.0:
                for i in range(m):
                    inside[i] -= columns[j, i] * y[j]
        inside = inverse @ inside
        leaving, too_far, above = _farthest_outside(inside, basis, upper)
        if leaving < 0:
            x[:] = 0.0
            for i in range(m):
                if basis[i] < N:
                    y[basis[i]] = inside[i]
                    x += costs[basis[i]] * inverse[i]
            return True
        row = inverse[leaving] if above else -inverse[leaving]
        alpha, ratios, candidates = _ratios(columns, row, state, reduced)
        if not len(candidates):
            return False
        entering, gone = -1, basis[leaving]
        for j in candidates[np.argsort(ratios)]:
            too_far -= abs(alpha[j]) * upper[j]
            entering = j  # of the last one, only rounding says that it leaves something over
            if too_far < 0.0:
                break
            state[j] = _UPPER if state[j] == _LOWER else _LOWER
            y[j] = upper[j] if state[j] == _UPPER else 0.0
        length = reduced[entering] / alpha[entering]
        for j in range(N):
            if state[j] != _BASIC:
                reduced[j] -= length * alpha[j]
        if gone < N:
            state[gone], y[gone] = (_UPPER, upper[gone]) if above else (_LOWER, 0.0)
            reduced[gone] = -length if above else length
        state[entering], basis[leaving], reduced[entering] = _BASIC, entering, 0.0
        pivot = inverse @ columns[entering]
        inverse[leaving] /= pivot[leaving]
        for i in range(m):
            if i != leaving:
                inverse[i] -= pivot[i] * inverse[leaving]
    return False


@njit(cache=True)
def _inverse(columns: Array, basis: np.ndarray) -> Array:
    """Returns the inverse of a basis, (m, m)."""
    (N, m), made = columns.shape, np.zeros((len(basis), len(basis)))
    for i in range(m):
        if basis[i] < N:
            made[:, i] = columns[basis[i]]
        else:
            made[basis[i] - N, i] = 1.0
    return np.ascontiguousarray(np.linalg.inv(made))


@njit(cache=True)
def _farthest_outside(inside: Array, basis: np.ndarray, upper: Array) -> tuple[int, float, bool]:
    """Returns which basic column is farthest outside of its bounds, by how much, and whether it is above them; -1 where none is."""
    leaving, farthest, above = -1, 0.0, False
    for i in range(len(basis)):
        most = upper[basis[i]] if basis[i] < len(upper) else 0.0
        for outside, over in ((-inside[i], False), (inside[i] - most, True)):
            if outside > farthest and outside > _ROUNDED * max(1.0, most):
                leaving, farthest, above = i, outside, over
    return leaving, farthest, above


@njit(cache=True)
def _ratios(columns: Array, row: Array, state: np.ndarray, reduced: Array) -> tuple[Array, Array, np.ndarray]:
    """Returns the row of the tableau, (N,), and of the columns that may enter, the steps after which their reduced costs are 0."""
    alpha, ratios, candidates, count = np.zeros(len(columns)), np.empty(len(columns)), np.empty(len(columns), dtype=np.int64), 0
    for j in range(len(columns)):
        if state[j] != _BASIC:
            for i in range(len(row)):
                alpha[j] += row[i] * columns[j, i]
            if (state[j] == _LOWER and alpha[j] > _PIVOT) or (state[j] == _UPPER and alpha[j] < -_PIVOT):
                ratios[count], candidates[count] = max(reduced[j] / alpha[j], 0.0), j
                count += 1
    return alpha, ratios[:count], candidates[:count]
