"""Uniform samples of a polytope P = {s : C s <= d} by hit-and-run, many chains at once.

Directions are the axes of the chains' covariance (coordinate hit-and-run with rounding; Haraldsdóttir, Cousins, Thiele, Fleming,
Vempala, *CHRR*, Bioinformatics 2017): a step costs a few operations a face, whatever the dimension.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from certifier.errors import RegionError
from certifier.model import Array, Polytope

CHAINS = 64
"""Number of independent chains."""


def hit_and_run(polytope: Polytope, start: ArrayLike, count: int, seed: int) -> Array:
    """(count, n) points of P, nearly uniform and nearly independent; deterministic for a seed.

    Chains start together at ``start``. In a first phase the covariance of all chains replaces that of the directions
    round after round, so thin polytopes mix as well as round ones. Then it is fixed, the chains walk on until they have
    forgotten it, and each gives a point every 2n + 10 steps; row i belongs to chain i modulo ``CHAINS``.

    Args:
        start: (n,) a point inside P.

    Raises:
        RegionError: ``start_outside`` when C s < d does not hold at the start; ``polytope_unbounded`` when a chord of P has no end.
    """
    start = np.asarray(start, dtype=float)
    n, blocks = len(start), -(-count // CHAINS)
    if not np.all(polytope.C @ start < polytope.d):
        raise RegionError("start_outside", "sampling must start at a point inside the polytope", field="start")
    adapting = np.array([n, 2 * n, 4 * n, 8 * n])
    steps = np.concatenate([adapting, [30 * n], np.full(blocks, 2 * n + 10)])
    random = np.random.default_rng(seed).random((2, steps.sum(), CHAINS))
    samples = np.zeros((blocks + 1, CHAINS, n))
    if not _sample(polytope.C, polytope.d, start, steps, len(adapting), random, samples):
        raise RegionError(
            "polytope_unbounded", "a line through the polytope does not end", field="polytope", hint="add the joint limits as rows"
        )
    return samples[1:].reshape(-1, n)[:count]


@njit(cache=True)
def _sample(C: Array, d: Array, start: Array, steps: Array, adapting: int, random: Array, samples: Array) -> bool:
    """Walks of so many steps, the first few followed by a new covariance, the last ones' ends into samples[0], [1], ...; False when a chord
    has no end.

    Args:
        random: (2, steps.sum(), k) uniform numbers in [0, 1): which column, which place on the chord.
    """
    chains, n = samples.shape[1:]
    s, shape, done = np.zeros((chains, n)) + start, np.eye(n), 0
    for phase in range(len(steps)):
        speed, moves = np.ascontiguousarray((C @ shape).T), np.zeros((chains, n))
        for chain in range(chains):
            slack = np.maximum(d - C @ s[chain], 0)
            for step in range(done, done + steps[phase]):
                column = int(n * random[0, step, chain])
                length = _move(slack, speed[column], random[1, step, chain])
                if not np.isfinite(length):
                    return False
                moves[chain, column] += length
        s += moves @ np.ascontiguousarray(shape.T)
        done += steps[phase]
        if phase < adapting:
            spread = s - s.sum(axis=0) / chains
            covariance = spread.T @ spread / (chains - 1)
            shape = np.linalg.cholesky(covariance + 1e-9 * np.trace(covariance) * np.eye(n))
        else:
            samples[phase - adapting] = s
    return True


@njit(cache=True)
def _move(slack: Array, speed: Array, place: float) -> float:
    """The length of the step to a place of the chord along which the faces come nearer with this speed; the slack after it."""
    forth, back = np.inf, -np.inf
    for j in range(len(slack)):
        if speed[j] > 0:
            forth = min(forth, slack[j] / speed[j])
        elif speed[j] < 0:
            back = max(back, slack[j] / speed[j])
    # The last digits stay inside, so that rounding never carries a chain through a face.
    length = (1 - 1e-12) * (back + (forth - back) * place)
    for j in range(len(slack)):
        slack[j] = max(slack[j] - length * speed[j], 0.0)
    return length
