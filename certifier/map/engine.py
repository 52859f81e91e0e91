"""Cells of a pair's map are worked on here, in compiled loops: those first in which most is to be gained.

A cell is a box. It goes through these steps, until it has a plane or is cut:

    a configuration of it at which the volumes touch is known   -> it is cut
    corners and other configurations are looked at              -> where the volumes touch at one of them, it is cut
    a plane, affine in s, is looked for                         -> there is none: it is cut
    proofs that all vertices keep to their sides                -> too many pieces: it is cut

Before it is cut in a joint, an oblique cut is tried now and then, with a plane for the part without contacts (certifier.map.oblique).

Coarse volumes come first, on levels (certifier.partition.levels). A cell that is narrow in all joints that move them goes on to the next
level, and one that is narrow in all joints stays open.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.map.oblique import MOST_JOINTS, cut_off
from certifier.map.settle import CONTACTS, DONE, NARROW, TOUCH, Levels, joint_to_cut, middle, settle, turn
from certifier.model import Array
from certifier.partition.bodies import Pair
from certifier.partition.hulls import gaps
from certifier.partition.search import NARROW_APART, NARROW_COARSE, NARROW_CUT
from certifier.partition.sides import Proofs, room_for
from certifier.polytopes.simplex import dot
from certifier.proof.partition import OBLIQUE, OPEN, PLANE

LOOKED_AT, MOSTLY = 16, 0.6
"""A cell goes on to the next level at once where coarse volumes touch at more than MOSTLY of LOOKED_AT samples in it."""
WAIT = 2
"""After an oblique cut was tried, a cell is cut WAIT times in joints before the next one is."""


class Work(NamedTuple):
    """Cells, in growing arrays; a cell is a node of a tree.

    Attributes:
        kinds, values, children: as certifier.map.descent has them.
        lower, upper: (N, k) the bounds.
        level: how many levels, the finest ones, are to be tried; 0 where the cell is not looked at any more.
        contacts, known: (N, CONTACTS, k) and (N,) configurations at which the volumes of its level touch, and how many are known.
        waits: how many times the cell is to be cut in joints before an oblique cut is tried.
        begin, end: which part of the order of the samples is in the cell.
        plane: the number of its plane; of an oblique cut, its own number, which is the row of its normal.
        normals: (N, k).
    """

    kinds: Array
    values: Array
    children: Array
    lower: Array
    upper: Array
    level: Array
    contacts: Array
    known: Array
    waits: Array
    begin: Array
    end: Array
    plane: Array
    normals: Array


def empty(given: int, most: int, k: int) -> Work:
    """Returns room for the cells of k joints that some cells are cut into when ``most`` are looked at."""
    room = given + 4 * most
    level, known, waits, begin, end, plane = np.zeros((6, room), np.int64)
    lower, upper, normals = np.empty((3, room, k))
    kinds, children, contacts = np.full(room, OPEN, np.int16), np.zeros((room, 2), np.int32), np.empty((room, CONTACTS, k))
    return Work(kinds, np.zeros(room), children, lower, upper, level, contacts, known, waits, begin, end, plane, normals)


class Kept(NamedTuple):
    """The planes that were found, in the order in which they were.

    Attributes:
        planes, choices: (P, 5, 1 + k), (P,) as a proof has them.
        bounds: (P + 1, 3) where the nodes of pieces of each plane begin, its pieces, and its multipliers.
        held: (1,) how many planes there are.
    """

    planes: Array
    choices: Array
    bounds: Array
    held: Array


class Streams(NamedTuple):
    """Room for the nodes of pieces of planes, the counts of multipliers of pieces, and the multipliers, (R,) each."""

    pieces: Array
    counts: Array
    multipliers: Array


@njit(cache=True)
def advance(
    pairs: tuple[Pair, ...], levels: Levels, work: Work, given: int, order: Array, samples: Array, weights: Array, most: int, water: float
) -> tuple[int, int, Kept, tuple[Array, Array, Array]]:
    """Works on cells until ``most`` were looked at or none has a weight above ``water``.

    Args:
        pairs: the volumes of every level, the finest first; LEVELS of them, of which the first ``levels.number`` ones count.
        given: how many cells there are to begin with, which are the first nodes.
        order: the numbers of the samples; those of a cell stand together.
        samples, weights: (S, k), (S,).

    Returns:
        How many nodes there are now, how many cells were looked at, the planes, and their pieces, counts and multipliers.
    """
    k, vertices, most_pieces = samples.shape[1], 0, 0
    for pair in pairs:
        most_pieces = max(most_pieces, pair.pieces)
        vertices = max(vertices, len(pair.first.vertices) + len(pair.second.vertices))
    proofs, first = room_for(vertices, most_pieces), np.zeros(3, np.int64)
    room = 2 * most  # a cell may have a plane for a part of it, and then one for all of it
    kept = Kept(np.zeros((room, 5, 1 + k)), np.empty(room, np.int8), np.zeros((room + 1, 3), np.int64), np.zeros(1, np.int64))
    needed, size, looked = 2 * len(proofs.pieces), given, 0
    streams = _streams(2 * needed)
    heap = [(-_weight(work, order, weights, i), i) for i in range(given)]
    heapq.heapify(heap)
    while len(heap) and looked < most:
        weight, cell = heapq.heappop(heap)
        if -weight <= water:
            break
        looked += 1
        if kept.bounds[kept.held[0]].max() + needed > len(streams.pieces):
            streams = _larger(streams)
        joint, cell, size = _tried(pairs, levels, work, cell, size, order, samples, proofs, first, kept, streams)
        if joint >= 0 and _cut(levels, work, cell, size, joint, order, samples):
            for child in range(size, size + 2):
                of_child = _weight(work, order, weights, child)
                if of_child > 0:
                    heapq.heappush(heap, (-of_child, child))
            size += 2
    ends = kept.bounds[kept.held[0]]
    return size, looked, kept, (streams.pieces[: ends[0]], streams.counts[: ends[1]], streams.multipliers[: ends[2]])


@njit(cache=True)
def _streams(room: int) -> Streams:
    return Streams(np.empty(room, np.int8), np.empty(room, np.int16), np.empty(room, np.float32))


@njit(cache=True)
def _larger(streams: Streams) -> Streams:
    """Returns twice the room, with what the streams hold."""
    held = len(streams.pieces)
    more = _streams(2 * held)
    more.pieces[:held] = streams.pieces
    more.counts[:held] = streams.counts
    more.multipliers[:held] = streams.multipliers
    return more


@njit(cache=True)
def _weight(work: Work, order: Array, weights: Array, cell: int) -> float:
    """Returns the weight of the samples in a cell."""
    total = 0.0
    for x in range(work.begin[cell], work.end[cell]):
        total += weights[order[x]]
    return total


@njit(cache=True, inline="always")
def _tried(
    pairs: tuple[Pair, ...],
    levels: Levels,
    work: Work,
    cell: int,
    size: int,
    order: Array,
    samples: Array,
    proofs: Proofs,
    first: Array,
    kept: Kept,
    streams: Streams,
) -> tuple[int, int, int]:
    """Tries a cell with one level after the other.

    Returns:
        The joint to cut, or -1 where nothing is left to cut; the cell to cut, which is another node after an oblique cut; how many nodes
        there are.
    """
    lower, upper, s, level = work.lower[cell], work.upper[cell], np.empty(samples.shape[1]), min(work.level[cell], levels.number) - 1
    tries = work.waits[cell] == 0
    while True:
        pair = pairs[level]
        if level and _touch_mostly(pair, order[work.begin[cell] : work.end[cell]], samples):
            work.known[cell] = 0
        else:
            plane = np.empty((5, 1 + len(pair.joints)))
            kind, work.known[cell], halved = settle(pair, lower, upper, work.contacts[cell], work.known[cell], proofs, first, plane, s)
            if kind == DONE:
                work.kinds[cell], work.plane[cell] = PLANE, kept.held[0]
                _keep(pair, levels.choices[level], plane, proofs, first, kept, streams)
                return -1, cell, size
            if tries and len(pair.joints) <= MOST_JOINTS:
                work.waits[cell] = WAIT
                inside = samples[order[work.begin[cell] : work.end[cell]]]
                found, normal, value, plane, parts, ends = cut_off(pair, lower, upper, inside)
                if found:
                    _cut_off(work, cell, size, normal, value, kept.held[0], order, samples)
                    _keep(pair, levels.choices[level], plane, parts, ends, kept, streams)
                    cell, size, tries = size + 1, size + 2, False
                    if work.begin[cell] == work.end[cell]:
                        return -1, cell, size
            joint = joint_to_cut(pair, levels, level, lower, upper, s, halved)
            if level == 0 or _worth_a_cut(pair, levels, level, lower, upper, kind, joint):
                return joint, cell, size
        work.level[cell] = level
        level -= 1
        # What touches on a finer level is looked at anew.
        near, still = gaps(pairs[level].a, pairs[level].b, work.contacts[cell, : work.known[cell]]), 0
        for i in range(len(near)):
            if near[i] <= 0:
                work.contacts[cell, still] = work.contacts[cell, i]
                still += 1
        work.known[cell] = still


@njit(cache=True)
def _worth_a_cut(pair: Pair, levels: Levels, level: int, lower: Array, upper: Array, kind: int, joint: int) -> bool:
    """Returns whether a cell is wide enough to be cut in a joint for coarse volumes (certifier.partition.search has the same rule)."""
    in_all, in_one = NARROW_COARSE, NARROW_CUT
    if levels.two_chains:
        in_all, in_one = (np.inf if kind == TOUCH else NARROW_COARSE), 0.0
    elif levels.many and kind != TOUCH:
        in_all, in_one = NARROW_APART, 0.0
    widest = 0.0
    for j in pair.joints:
        widest = max(widest, turn(levels, level, j, lower, upper))
    return widest > in_all and turn(levels, level, joint, lower, upper) > in_one


@njit(cache=True)
def _keep(pair: Pair, choice: int, plane: Array, proofs: Proofs, first: Array, kept: Kept, streams: Streams) -> None:
    """Keeps a plane and its pieces as a proof has them whose planes move with all joints."""
    at = kept.held[0]
    begin = kept.bounds[at]
    kept.planes[at, :, 0], kept.choices[at] = plane[:, 0], choice
    for e in range(len(pair.joints)):
        kept.planes[at, :, 1 + pair.joints[e]] = plane[:, 1 + e]
    _renumbered(pair, proofs.pieces, first[0], proofs.lengths[0], streams.pieces[begin[0] :])
    streams.counts[begin[1] : begin[1] + proofs.lengths[1]] = proofs.counts[: proofs.lengths[1]]
    streams.multipliers[begin[2] : begin[2] + proofs.lengths[2]] = proofs.multipliers[: proofs.lengths[2]]
    for i in range(3):
        kept.bounds[at + 1, i] = begin[i] + proofs.lengths[i]
    kept.held[0] += 1


@njit(cache=True)
def _cut_off(work: Work, cell: int, size: int, normal: Array, value: float, plane: int, order: Array, samples: Array) -> None:
    """Cuts a cell by a face. The node ``size`` is the lower part, which has a plane, and the next one the whole cell, once more."""
    work.kinds[cell], work.values[cell], work.plane[cell], work.normals[cell] = OBLIQUE, value, cell, normal
    work.children[cell] = size, size + 1
    work.kinds[size], work.plane[size] = PLANE, plane
    rest, begin, end = size + 1, work.begin[cell], work.end[cell]
    places = np.empty(end - begin)
    for x in range(begin, end):
        places[x - begin] = dot(normal, samples[order[x]])
    at = _parted(order, begin, places, value)
    work.kinds[rest], work.begin[rest], work.end[rest] = OPEN, at, end
    work.lower[rest], work.upper[rest], work.level[rest] = work.lower[cell], work.upper[cell], work.level[cell]
    work.contacts[rest], work.known[rest], work.waits[rest] = work.contacts[cell], work.known[cell], work.waits[cell]


@njit(cache=True)
def _cut(levels: Levels, work: Work, cell: int, size: int, joint: int, order: Array, samples: Array) -> bool:
    """Cuts a cell in the middle of a joint's range, if it is wide enough; its parts are the nodes ``size`` and ``size`` + 1."""
    lower, upper, widest = work.lower[cell], work.upper[cell], 0.0
    for j in range(len(lower)):
        widest = max(widest, turn(levels, 0, j, lower, upper))
    value = middle(levels.revolute[joint], lower[joint], upper[joint])
    if widest < NARROW or not lower[joint] < value < upper[joint]:
        work.level[cell] = 0
        return False
    work.kinds[cell], work.values[cell] = joint, value
    places = np.empty(work.end[cell] - work.begin[cell])
    for x in range(len(places)):
        places[x] = samples[order[work.begin[cell] + x], joint]
    below = _parted(order, work.begin[cell], places, value)
    for part in range(2):
        child = size + part
        work.children[cell, part], work.kinds[child], work.level[child] = child, OPEN, work.level[cell]
        work.waits[child] = max(work.waits[cell] - 1, 0)
        work.lower[child], work.upper[child] = lower, upper
        work.begin[child], work.end[child] = (work.begin[cell], below) if part == 0 else (below, work.end[cell])
        if part == 0:
            work.upper[child, joint] = value
        else:
            work.lower[child, joint] = value
        known = 0
        for i in range(work.known[cell]):
            at = work.contacts[cell, i, joint]
            if (at <= value) if part == 0 else (at >= value):
                work.contacts[child, known] = work.contacts[cell, i]
                known += 1
        work.known[child] = known
    return True


@njit(cache=True)
def _touch_mostly(pair: Pair, numbers: Array, samples: Array) -> bool:
    """Returns whether coarse volumes touch at most of the samples of a cell."""
    count = min(len(numbers), LOOKED_AT)
    X = np.empty((count, samples.shape[1]))
    for i in range(count):
        X[i] = samples[numbers[i * len(numbers) // count]]
    return (gaps(pair.a, pair.b, X) <= 0).sum() > MOSTLY * count


@njit(cache=True)
def _renumbered(pair: Pair, pieces: Array, first: int, length: int, to: Array) -> None:
    """Copies pieces, with the numbers that the axes have where all joints are in play."""
    for side in range(2):
        moving = pair.first if side == 0 else pair.second
        own, outside = moving.own, moving.outside
        for i in range(0 if side == 0 else first, first if side == 0 else length):
            axis = pieces[i]
            if axis >= len(own):
                joint = outside[axis - len(own)]
                # The number of the joint among those that do not move this side.
                axis = len(own)
                for j in range(joint):
                    mine = False
                    for e in own:
                        mine = mine or e == j
                    if not mine:
                        axis += 1
            to[i] = axis


@njit(cache=True)
def _parted(order: Array, begin: int, places: Array, value: float) -> int:
    """Moves the samples of a cell that are below a cut before the others, each in their order, and returns where the others begin.

    Args:
        begin: where the samples of the cell begin in the order.
        places: of each of them, in the direction that is cut.
    """
    held = order[begin : begin + len(places)].copy()
    at = begin
    for i in range(len(held)):
        if places[i] <= value:
            order[at] = held[i]
            at += 1
    below = at
    for i in range(len(held)):
        if places[i] > value:
            order[at] = held[i]
            at += 1
    return below
