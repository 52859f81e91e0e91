"""This module measures lookups in large free sets: one configuration, a thousand, and straight motions, in one thread.

A map is grown for some seconds. As many cells as are asked for would take it an hour, so its trees are then cut on without proofs: open
cells are divided in four across their longest sides, and two of the four count as proved. So these free sets say nothing about their
scenes, but lookups in them cost what they would cost.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from certifier.jobs.map import grow_map
from certifier.map.descent import boxes
from certifier.map.free_set import OPEN, PROVED, as_file, free_set, smallest
from certifier.model import Array
from certifier.proof import partition
from certifier.proof.partition import OBLIQUE
from ciris.free_set import FreeSet
from client.cores import cores

SCENES = ("iiwa_shelf", "iiwa_gripper")
CELLS, LIMIT = 1_000_000, 60.0
COVERED = 0.99
"""No map grows on when it covers this much."""
SINGLE, BATCH, REPEAT = 5000, 1000, 30
REACH = 0.2
"""A motion goes this far from a proved configuration, in radians or metres in all joints together: a cycle of a quick arm."""


def lookups(names: list[str], cells: int, limit: float, progress: Progress) -> dict[str, Any]:
    """Measures lookups in a free set of each of these scenes. Returns the document of ``ciris bench lookups``.

    Args:
        cells: how many proved cells each has at least.
        limit: seconds in which the map that it begins with is grown.
    """
    rows = []
    for name in names:
        progress(name)
        scene = catalogue.scene(name)
        arrays = free_set(grow_map(scene, COVERED, limit, cores()).proof)
        grown = int((arrays["joint"] == PROVED).sum())
        rows.append({"example": name, "pairs": len(scene.pairs), "grown": grown, **measured(enlarged(arrays, cells))})
    return {"benchmark": "lookups", "machine": measure.machine(), "rows": rows}


def enlarged(arrays: dict[str, Any], cells: int) -> dict[str, Any]:
    """Returns the arrays of a free set (certifier.map.free_set) whose open cells were cut on until there are this many proved cells."""
    rng, bounds = np.random.default_rng(0), (arrays["q_lower"], arrays["q_upper"])
    trees = list(zip(*(np.split(arrays[name], arrays["root"][1:]) for name in ("joint", "cut")), strict=True))
    while (missing := cells - _count(trees, PROVED)) > 0:
        share = min(1.0, 0.5 * missing / max(1, _count(trees, OPEN)))
        before, trees = trees, [_cut_on(joint, cut, *bounds, share, rng) for joint, cut in trees]
        if _count(trees, PROVED) == _count(before, PROVED):
            break
    whole = [smallest(joint, cut) for joint, cut in trees]
    root = np.concatenate([[0], np.cumsum([len(joint) for joint, *_ in whole])[:-1]]).astype(np.int32)
    upper = [np.where(joint >= 0, upper + begin, 0).astype(np.int32) for begin, (joint, _, upper, _) in zip(root, whole, strict=True)]
    joint, cut = (np.concatenate([tree[i] for tree in whole]) for i in (0, 1))
    return {**arrays, "root": root, "joint": joint, "cut": cut, "upper": np.concatenate(upper)}


def _count(trees: list[tuple[Array, Array]], kind: int) -> int:
    return sum(int((joint == kind).sum()) for joint, _ in trees)


def _cut_on(joint: Array, cut: Array, q_lower: Array, q_upper: Array, share: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Returns a tree, its nodes' joints and cuts in preorder, in which this share of the open cells is divided in four."""
    joint, cut, upper, _ = smallest(joint, cut)
    mine = np.unique(joint[(joint >= 0) & (joint != OBLIQUE)])
    chosen = np.flatnonzero(joint == OPEN)
    asked = rng.random(len(chosen)) < share
    if not len(mine) or not asked.any():
        return joint, cut
    children = np.stack([np.arange(1, len(joint) + 1), upper], axis=1)
    low, high = (side[asked] for side in boxes(np.where(joint == OPEN, partition.OPEN, joint), cut, children, q_lower, q_upper))
    chosen, row = chosen[asked], np.arange(len(low))
    lengths = ((high - low) / (q_upper - q_lower))[:, mine]
    first = lengths.argmax(axis=1)
    lengths[row, first] /= 2
    second, first = mine[lengths.argmax(axis=1)], mine[first]
    middle = (low + high) / 2
    quarters = (middle[row, second] - low[row, second]) / 2 * (first == second)
    swapped, other = rng.random((2, len(row))) < 0.5
    halves = [np.where(side, PROVED, OPEN) for side in (swapped, ~swapped, other, ~other)]
    times = np.ones(len(joint), np.int64)
    times[chosen] = 7
    at = (np.cumsum(times) - times)[chosen, None] + np.arange(7)
    joint, cut = np.repeat(joint, times), np.repeat(cut, times)
    joint[at] = np.stack([first, second, *halves[:2], second, *halves[2:]], axis=1)
    cut[at[:, [0, 1, 4]]] = np.stack([middle[row, first], middle[row, second] - quarters, middle[row, second] + quarters], axis=1)
    return joint, cut


def measured(arrays: dict[str, Any]) -> dict[str, Any]:
    """Returns what lookups in a free set of these arrays cost."""
    free, rng = FreeSet.of_bytes(as_file(arrays), "the free set"), np.random.default_rng(1)
    lower, upper = free.space.q_lower, free.space.q_upper
    proved = np.zeros((0, len(lower)))
    while len(proved) < SINGLE:
        q = rng.uniform(lower, upper, (20_000, len(lower)))
        proved = np.concatenate([proved, q[free.contains(q)]])[:SINGLE]
    ways = rng.normal(size=proved.shape)
    ends = np.clip(proved + REACH * ways / np.linalg.norm(ways, axis=1, keepdims=True), lower, upper)
    held = free.contains_motion(proved, ends)
    batches = [proved[rng.permutation(SINGLE)[:BATCH]] for _ in range(REPEAT)]
    return {
        "cells": int((arrays["joint"] == PROVED).sum()),
        "nodes": len(arrays["joint"]),
        "trees": len(arrays["root"]),
        "point": _quantiles([partial(free.contains, q) for q in proved]),
        "batch": _quantiles([partial(free.contains, batch) for batch in batches]),
        "motion": _quantiles([partial(free.contains_motion, a, b) for a, b in zip(proved[held], ends[held], strict=True)]),
        "motions_held": float(held.mean()),
    }


def _quantiles(calls: list[Callable[[], object]]) -> dict[str, float]:
    """Returns the median, the 99th percentile and the largest of what calls take, in seconds of this thread."""
    taken = []
    for call in calls:
        begin = time.thread_time()
        call()
        taken.append(time.thread_time() - begin)
    return {"p50": float(np.percentile(taken, 50)), "p99": float(np.percentile(taken, 99)), "most": max(taken)}
