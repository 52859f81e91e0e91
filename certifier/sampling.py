"""Uniform samples of a polytope P = {s : C s <= d} by hit-and-run, many chains at once."""

from __future__ import annotations

import numpy as np
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
    n = len(start)
    if not np.all(polytope.C @ start < polytope.d):
        raise RegionError("start_outside", "sampling must start at a point inside the polytope", field="start")
    rng = np.random.default_rng(seed)
    s = np.tile(start, (CHAINS, 1))
    shape = np.eye(n)
    for steps in (n, 2 * n, 4 * n, 8 * n):
        s = _walk(polytope, s, shape, steps, rng)
        spread = np.cov(s.T).reshape(n, n)
        shape = np.linalg.cholesky(spread + 1e-9 * np.trace(spread) * np.eye(n))
    s = _walk(polytope, s, shape, 30 * n, rng)
    blocks = [s[:0]]
    for _ in range(-(-count // CHAINS)):
        s = _walk(polytope, s, shape, 2 * n + 10, rng)
        blocks.append(s)
    return np.concatenate(blocks)[:count]


def _walk(polytope: Polytope, s: Array, shape: Array, steps: int, rng: np.random.Generator) -> Array:
    """The chains s (k, n) after that many steps along directions shape @ normal."""
    for _ in range(steps):
        v = rng.normal(size=s.shape) @ shape.T
        slack, speed = np.maximum(polytope.d - s @ polytope.C.T, 0), v @ polytope.C.T
        with np.errstate(divide="ignore", invalid="ignore"):
            time = slack / speed
        forth = np.where(speed > 0, time, np.inf).min(axis=1)
        back = np.where(speed < 0, time, -np.inf).max(axis=1)
        if not (np.isfinite(forth).all() and np.isfinite(back).all()):
            raise RegionError(
                "polytope_unbounded", "a line through the polytope does not end", field="polytope", hint="add the joint limits as rows"
            )
        # The last digits stay inside, so that rounding never carries a chain through a face.
        s = s + (1 - 1e-12) * (back + (forth - back) * rng.random(len(s)))[:, None] * v
    return s
