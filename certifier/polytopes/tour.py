"""A region is shown by some of its points: where each coordinate is least and greatest, and samples that are uniform in q."""

from __future__ import annotations

from typing import Any

import numpy as np

from certifier.coordinates import ConfigurationSpace
from certifier.model import Array, Polytope
from certifier.polytopes import gibbs, simplex
from certifier.polytopes.polytope import chebyshev_center

CHAINS = 25
HAIR = 1e-9


def extremes(polytope: Polytope) -> tuple[Array, Array]:
    """Returns points at which each coordinate is least, and points at which it is greatest, (n, n) each, one row a coordinate.

    They are inside by a hair, which rounding does not take away.

    Raises:
        RegionError: as :func:`certifier.polytopes.polytope.chebyshev_center`.
    """
    n = polytope.C.shape[1]
    center = chebyshev_center(polytope)[0]
    points, _ = simplex.maximise(polytope.C, polytope.d, np.concatenate([-np.eye(n), np.eye(n)]), center)
    points = center + (1 - HAIR) * (points - center)
    return points[:n], points[n:]


def samples(polytope: Polytope, space: ConfigurationSpace, count: int, seed: int) -> Array:
    """Returns ``count`` points of P in s, (count, n), nearly uniform in q; the same seed gives the same points."""
    each = -(-count // CHAINS)
    drawn: Array = gibbs.uniform_in_q(polytope, space, CHAINS, each, seed).swapaxes(0, 1).reshape(-1, polytope.C.shape[1])
    return drawn[:count]


def answer(payload: dict[str, Any]) -> dict[str, Any]:
    """Answers both questions in a child process, for ``C``, ``d``, ``q_star``, ``revolute``, ``count`` and ``seed``, in s."""
    polytope, space = Polytope(payload["C"], payload["d"]), ConfigurationSpace(payload["q_star"], payload["revolute"])
    lower, upper = extremes(polytope)
    drawn = samples(polytope, space, payload["count"], payload["seed"]) if payload["count"] else np.zeros((0, len(lower)))
    return {"lower": lower, "upper": upper, "samples": drawn}
