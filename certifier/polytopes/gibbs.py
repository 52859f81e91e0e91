"""Gibbs sampling draws configurations of a polytope P = {s : C s <= d} that are uniform in the joint positions q, not in s.

Along one axis P is an interval of s_i, and so of q_i, from which q_i is drawn uniformly. This leaves the uniform distribution in q as it
is (hit-and-run along the coordinate axes, Smith, Operations Research 1984).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.sparse import csc_array

from certifier.coordinates import ConfigurationSpace
from certifier.model import Array, Polytope
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.sampling import hit_and_run

_FORGET = 40
"""The chains start from points that are uniform in s, and walk on for this many rounds over all axes first."""
_THIN = 8
"""Between two samples of a chain lie this many rounds over all axes."""
AFRESH = 8
"""The slack of the faces is computed anew after this many rounds, so that rounding does not add up."""
LANES = 32
"""This many chains walk side by side."""


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
    columns = csc_array(polytope.C)
    s = _walk(columns, polytope.d, space, s, _FORGET, rng)
    found = np.empty((chains, each, s.shape[1]))
    for i in range(each):
        s = found[:, i] = _walk(columns, polytope.d, space, s, _THIN, rng)
    return found


def _walk(columns: csc_array, d: Array, space: ConfigurationSpace, s: Array, rounds: int, rng: np.random.Generator) -> Array:
    """Returns the chains s (k, n) after that many rounds over all axes."""
    places, walked = rng.random((rounds, s.shape[1], len(s))), np.empty(s.shape)
    for first in range(0, len(s), LANES):
        some = slice(first, first + LANES)
        lanes = np.ascontiguousarray(s[some].T)
        _rounds(columns.indptr, columns.indices, columns.data, d, space.revolute, np.ascontiguousarray(places[:, :, some]), lanes)
        walked[some] = lanes.T
    return walked


@njit(cache=True)
def _rounds(begins: np.ndarray, faces: np.ndarray, entries: Array, d: Array, revolute: np.ndarray, places: Array, s: Array) -> None:
    """Moves the chains s (n, k) along each axis in turn, to a place in [0, 1) of its interval in q.

    The chains are side by side in vector registers.

    Args:
        begins, faces, entries: the entries of C by columns: those of the axis i are ``begins[i] : begins[i + 1]``, each of a face.
        places: (rounds, n, k).
    """
    n, k = s.shape
    slack, least, most, moved = np.empty((len(d), k)), np.empty(k), np.empty(k), np.empty(k)
    for turn in range(len(places)):
        if turn % AFRESH == 0:
            for j in range(len(d)):
                slack[j] = d[j]
            for i in range(n):
                for e in range(begins[i], begins[i + 1]):
                    j, entry = faces[e], entries[e]
                    for c in range(k):
                        slack[j, c] -= s[i, c] * entry
        for i in range(n):
            least[:], most[:] = -np.inf, np.inf
            for e in range(begins[i], begins[i + 1]):
                j, entry = faces[e], entries[e]
                if entry > 0.0:
                    for c in range(k):
                        room = (slack[j, c] if slack[j, c] > 0.0 else 0.0) / entry
                        most[c] = room if room < most[c] else most[c]
                else:
                    for c in range(k):
                        room = (slack[j, c] if slack[j, c] > 0.0 else 0.0) / entry
                        least[c] = room if room > least[c] else least[c]
            for c in range(k):
                low, high, place = s[i, c] + least[c], s[i, c] + most[c], places[turn, i, c]
                if revolute[i]:
                    begin, end = math.atan(low), math.atan(high)
                    there = math.tan(begin + (end - begin) * place)
                else:
                    there = low + (high - low) * place
                there = min(max(there, low), high)
                moved[c] = there - s[i, c]
                s[i, c] = there
            for e in range(begins[i], begins[i + 1]):
                j, entry = faces[e], entries[e]
                for c in range(k):
                    slack[j, c] -= moved[c] * entry
