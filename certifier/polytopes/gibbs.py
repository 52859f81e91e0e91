"""Gibbs sampling draws configurations of a polytope P = {s : C s <= d} that are uniform in the joint positions q, not in s.

Along one axis P is an interval of s_i, and so of q_i, from which q_i is drawn uniformly. This leaves the uniform distribution in q as it
is (hit-and-run along the coordinate axes, Smith, Operations Research 1984).
"""

from __future__ import annotations

import numpy as np

from certifier.coordinates import ConfigurationSpace
from certifier.model import Array, Polytope
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.sampling import hit_and_run

_FORGET = 40
"""The chains start from points that are uniform in s, and walk on for this many rounds over all axes first."""
_THIN = 8
"""Between two samples of a chain lie this many rounds over all axes."""


def uniform_in_q(polytope: Polytope, space: ConfigurationSpace, chains: int, each: int, seed: int) -> Array:
    """Returns points of P in s, (chains, each, n), nearly uniform in q; the same seed gives the same points.

    The chains are independent of one another but for their starts, which hit-and-run draws. Samples of one chain may still depend on each
    other, so an error has to be estimated between the chains.

    Args:
        polytope: bounded, for instance by the joint limits.
        space: the joints.

    Raises:
        RegionError: as :func:`certifier.polytopes.polytope.chebyshev_center`.
    """
    starts, draws = np.random.SeedSequence(seed).spawn(2)
    s = hit_and_run(polytope, chebyshev_center(polytope)[0], chains, int(starts.generate_state(1)[0]))
    rng = np.random.default_rng(draws)
    s = _walk(polytope, space, s, _FORGET, rng)
    found = np.empty((chains, each, s.shape[1]))
    for i in range(each):
        s = found[:, i] = _walk(polytope, space, s, _THIN, rng)
    return found


def _walk(polytope: Polytope, space: ConfigurationSpace, s: Array, rounds: int, rng: np.random.Generator) -> Array:
    """Returns the chains s (k, n) after that many rounds over all axes."""
    s = s.copy()
    axes = [(i, space.of(i), column, column > 0, column < 0) for i, column in enumerate(polytope.C.T)]
    for _ in range(rounds):
        # The slack is computed anew in every round, so that rounding does not add up.
        slack = np.maximum(polytope.d - s @ polytope.C.T, 0)
        for i, joint, column, up, down in axes:
            least = s[:, i] + (slack[:, down] / column[down]).max(axis=1)
            most = s[:, i] + (slack[:, up] / column[up]).min(axis=1)
            place = rng.random(len(s))
            begin, end = joint.offset(least), joint.offset(most)
            new = np.minimum(np.maximum(joint.at_offset(begin + (end - begin) * place), least), most)
            slack = np.maximum(slack - np.outer(new - s[:, i], column), 0)
            s[:, i] = new
    return s
