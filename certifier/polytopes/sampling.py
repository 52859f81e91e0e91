"""Hit-and-run draws uniform samples of a polytope P = {s : C s <= d}, with many chains at once.

Directions are the axes of the chains' covariance (coordinate hit-and-run with rounding; Haraldsdóttir, Cousins, Thiele, Fleming,
Vempala, *CHRR*, Bioinformatics 2017). So a step costs a few operations a face, whatever the dimension.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from certifier.errors import RegionError
from certifier.model import Array, Polytope

CHAINS = 64
"""This many independent chains are run."""


def hit_and_run(polytope: Polytope, start: ArrayLike, count: int, seed: int) -> Array:
    """Returns points of P, (count, n), nearly uniform and nearly independent; the same seed gives the same points.

    All chains start at ``start``. In a first phase, round after round, the covariance of all chains replaces that of the directions, so
    thin polytopes mix as well as round ones. Then the covariance is fixed, and the chains walk on until they have forgotten it. After that
    each gives a point every 2n + 10 steps; row i belongs to chain i modulo ``CHAINS``.

    Args:
        start: (n,) a point inside P.

    Raises:
        RegionError: ``start_outside`` when C s < d does not hold at the start; ``polytope_unbounded`` when a chord of P has no end.
    """
    start = np.asarray(start, dtype=float)
    n = len(start)
    if not np.all(polytope.C @ start < polytope.d):
        raise RegionError("start_outside", "sampling must start at a point inside the polytope", field="start")
    rng = np.random.default_rng(seed)
    s, shape = np.tile(start, (CHAINS, 1)), np.eye(n)
    for steps in (n, 2 * n, 4 * n, 8 * n):
        s = _walk(polytope, s, shape, steps, rng)
        spread = s - s.mean(axis=0)
        covariance = spread.T @ spread / (CHAINS - 1)
        shape = np.linalg.cholesky(covariance + 1e-9 * np.trace(covariance) * np.eye(n))
    s = _walk(polytope, s, shape, 30 * n, rng)
    blocks = [s[:0]]
    for _ in range(-(-count // CHAINS)):
        s = _walk(polytope, s, shape, 2 * n + 10, rng)
        blocks.append(s)
    return np.concatenate(blocks)[:count]


def _walk(polytope: Polytope, s: Array, shape: Array, steps: int, rng: np.random.Generator) -> Array:
    """Returns the chains s (k, n) after that many steps along columns of the shape."""
    columns, places = rng.integers(len(shape), size=(len(s), steps)), rng.random((len(s), steps))
    moves, slack = np.zeros(s.shape), np.maximum(polytope.d - s @ polytope.C.T, 0)
    if not _steps((polytope.C @ shape).T.copy(), slack, columns, places, moves):
        raise RegionError(
            "polytope_unbounded", "a line through the polytope does not end", field="polytope", hint="add the joint limits as rows"
        )
    return s + moves @ shape.T


@njit(cache=True)
def _steps(speed: Array, slack: Array, columns: Array, places: Array, moves: Array) -> bool:
    """Adds up the chains' moves (k, n): each step goes to a place in [0, 1) of its chord.

    Args:
        speed: (n, m) by which the faces come nearer along a column.
        slack: (k, m) of the faces, changed.
        columns: (k, steps) the column that each step goes along.
        places: (k, steps) in [0, 1).

    Returns:
        False when a chord has no end.
    """
    m = slack.shape[1]
    for chain in range(len(moves)):
        for step in range(columns.shape[1]):
            column = columns[chain, step]
            forth, back = np.inf, -np.inf
            for j in range(m):
                if speed[column, j] > 0:
                    forth = min(forth, slack[chain, j] / speed[column, j])
                elif speed[column, j] < 0:
                    back = max(back, slack[chain, j] / speed[column, j])
            if forth == np.inf or back == -np.inf:
                return False
            # The last digits stay inside, so that rounding never carries a chain through a face.
            length = (1 - 1e-12) * (back + (forth - back) * places[chain, step])
            moves[chain, column] += length
            for j in range(m):
                slack[chain, j] = max(slack[chain, j] - length * speed[column, j], 0.0)
    return True
