"""What happens to one cell of a pair's map, at one level: it has a plane, its volumes touch, or neither is known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.partition import planes
from certifier.partition.bodies import CALM, DESCENT, ENOUGH, LEAST, LOOKS, Pair, in_s, prove_both
from certifier.partition.hulls import gaps
from certifier.partition.multipliers import PROVED
from certifier.partition.sides import Proofs

LEVELS = 4
"""A tree has at most this many levels."""
CONTACTS = 8
"""A cell remembers at most this many configurations at which its volumes touch."""
NARROW = np.radians(0.1)
"""A cell that turns less than this in every joint is not cut any more."""
CORNERS, OTHERS, MORE = 64, 24, 120
"""CORNERS corners of a cell are looked at, and OTHERS other configurations on its boundary; up to MORE may join them."""
_SPREAD = np.random.default_rng(0).random((OTHERS, 64))
DONE, TOUCH, APART = 0, 1, 2
"""What happens to a cell at one level: it has a plane; its volumes touch; no plane was found or proved."""


class Levels(NamedTuple):
    """What the levels of a pair have in common.

    Attributes:
        number: how many there are.
        choices: which volumes each of them chooses, as a proof says it.
        scales: (L, k) what counts as a radian of each joint, for the volumes of each level.
        revolute: (k,).
        many, two_chains: as certifier.partition.levels says.
    """

    number: int
    choices: Array
    scales: Array
    revolute: Array
    many: bool
    two_chains: bool


@njit(cache=True)
def turn(levels: Levels, level: int, joint: int, lower: Array, upper: Array) -> float:
    """Returns how far a joint turns in a cell; a slide counts relative to the volumes' extent."""
    if levels.revolute[joint]:
        return 2 * (np.arctan(upper[joint]) - np.arctan(lower[joint]))
    return (upper[joint] - lower[joint]) / levels.scales[level, joint]


@njit(cache=True)
def middle(revolute: bool, l: float, u: float) -> float:
    """Returns the s that is midway in q between two others."""
    return np.tan((np.arctan(l) + np.arctan(u)) / 2) if revolute else (l + u) / 2


@njit(cache=True)
def configurations(joints: Array, lower: Array, upper: Array) -> Array:
    """Returns the middle of a cell, some of its corners, and others on its boundary."""
    n, k = len(lower), len(joints)
    corners = min(1 << k, CORNERS)
    X = np.empty((1 + corners + OTHERS, n))
    X[:] = (lower + upper) / 2
    for i in range(corners):
        for e in range(k):
            j = joints[e]
            high = (i >> e) & 1 if corners == 1 << k else _SPREAD[i % OTHERS, (e + i // OTHERS * 17) % 64] < 0.5
            X[1 + i, j] = upper[j] if high else lower[j]
    for i in range(OTHERS):
        row = X[1 + corners + i]
        for e in range(k):
            j = joints[e]
            row[j] = lower[j] + _SPREAD[i, e] * (upper[j] - lower[j])
        j = joints[i // 2 % k]
        row[j] = upper[j] if i % 2 else lower[j]
    return X


@njit(cache=True, inline="always")
def settle(
    pair: Pair, lower: Array, upper: Array, contacts: Array, known: int, proofs: Proofs, first: Array, plane: Array, s: Array
) -> tuple[int, int, int]:
    """Looks for a plane in a cell, and proves it.

    Args:
        contacts, known: those of the cell, and how many; new ones join them.
        proofs, first, plane: get the proof, the lengths of the first volume's part, and the plane, where there is one.
        s: (n,) gets a configuration at which no plane separates the volumes, where there is one.

    Returns:
        (what happened to the cell, how many contacts are known, the joint in which pieces were halved most; -1 for none).
    """
    n = len(lower)
    if known:
        s[:] = (lower + upper) / 2
        return TOUCH, known, -1
    J = pair.joints
    X = configurations(J, lower, upper)
    corners = len(X) - OTHERS
    found = gaps(pair.a, pair.b, X[:corners])
    for i in range(corners):
        if found[i] <= 0 and known < CONTACTS:
            contacts[known] = X[i]
            known += 1
    if known:
        s[:] = (lower + upper) / 2
        return TOUCH, known, -1
    mid, half = (lower + upper) / 2, (upper - lower) / 2
    C, d = np.zeros((2 * n, n)), np.empty(2 * n)
    for i in range(n):
        C[i, i], C[n + i, i], d[i], d[n + i] = 1.0, -1.0, upper[i], -lower[i]
    chart = planes.Chart(J, mid[J], CALM / half[J], CALM)
    N = len(X)
    Y = np.empty((N + MORE, n))
    Y[:N] = X
    kind, z, places, weights, N = planes.look(pair.a, pair.b, chart, C, d, Y, N, LOOKS, DESCENT, LEAST, ENOUGH)
    none, offsets, faces, refuted = np.zeros((0, n)), np.zeros(0), np.zeros(0, np.int64), np.empty(n)
    if kind == planes.FOUND:
        plane[:] = in_s(pair, lower, upper, z)
        result = prove_both(pair, plane, lower, upper, none, offsets, faces, proofs, first, refuted)
        if result == PROVED:
            return DONE, 0, -1
        s[:] = mid
        if result < 0:
            return APART, 0, -1 - result
        return APART, 0, -1
    s[:] = 0.0
    total = weights.sum()
    for i in range(len(places)):
        s += weights[i] / total * Y[places[i]]
    near = gaps(pair.a, pair.b, Y[places])
    for i in range(len(places)):
        if near[i] <= 0 and known < CONTACTS:
            contacts[known] = Y[places[i]]
            known += 1
    return (TOUCH if known else APART), known, -1


@njit(cache=True)
def joint_to_cut(pair: Pair, levels: Levels, level: int, lower: Array, upper: Array, s: Array, halved: int) -> int:
    """Returns the joint to cut a cell in: where proofs took most pieces, or the one that changes the gap most."""
    J, k = pair.joints, len(pair.joints)
    if halved >= 0 and turn(levels, level, halved, lower, upper) > NARROW / 2:
        return halved
    X = np.empty((2 * k + 1, len(s)))
    X[:] = s
    for e in range(k):
        X[2 * e, J[e]], X[2 * e + 1, J[e]] = lower[J[e]], upper[J[e]]
    found = gaps(pair.a, pair.b, X)
    best, most = J[0], -1.0
    for e in range(k):
        change = max(found[2 * e], found[2 * e + 1], found[2 * k]) - min(found[2 * e], found[2 * e + 1], found[2 * k])
        wide = turn(levels, level, J[e], lower, upper)
        value = change + 1e-9 * wide if wide > NARROW / 2 else -0.5
        if value > most:
            best, most = J[e], value
    return best
