"""Gibbs sampling draws configurations of a polytope P = {s : C s <= d} that are uniform in the joint positions q, not in s.

Along one axis P is an interval of s_i, and so of q_i, from which q_i is drawn uniformly. This leaves the uniform distribution in q as it
is (hit-and-run along the coordinate axes, Smith, Operations Research 1984).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

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
    walked = s.copy()
    _rounds(np.ascontiguousarray(polytope.C.T), polytope.d, space.revolute, rng.random((rounds, s.shape[1], len(s))), walked)
    return walked


@njit(cache=True)
def _rounds(columns: Array, d: Array, revolute: np.ndarray, places: Array, s: Array) -> None:
    """Moves the chains s (k, n) along each axis in turn, to a place in [0, 1) of its interval in q.

    Args:
        columns: (n, m) the transpose of C.
        places: (rounds, n, k).
    """
    slack = np.empty(len(d))
    for chain in range(len(s)):
        for turn in range(len(places)):
            # The slack is computed anew in every round, so that rounding does not add up.
            slack[:] = d
            for i in range(len(columns)):
                slack -= s[chain, i] * columns[i]
            for i in range(len(columns)):
                column, here = columns[i], s[chain, i]
                least, most = -np.inf, np.inf
                for j in range(len(d)):
                    room = max(slack[j], 0.0)
                    if column[j] > 0.0:
                        most = min(most, room / column[j])
                    elif column[j] < 0.0:
                        least = max(least, room / column[j])
                least, most, place = here + least, here + most, places[turn, i, chain]
                if revolute[i]:
                    begin, end = math.atan(least), math.atan(most)
                    there = math.tan(begin + (end - begin) * place)
                else:
                    there = least + (most - least) * place
                there = min(max(there, least), most)
                for j in range(len(d)):
                    slack[j] -= (there - here) * column[j]
                s[chain, i] = there
