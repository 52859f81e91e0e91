"""The map of a scene is grown here, in this process and children of it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from certifier.map.growing import Coverage, Growing, Task, Trees, beside
from certifier.map.pair import Found, PairTree
from certifier.map.trees import Pairs, Plan
from certifier.model import Array, Scene
from certifier.orphans import die_with_parent
from certifier.proof.map import MapProof
from certifier.seeding.limits import check_in_windows

Tell = Callable[[str, dict[str, Any]], None]
Work = Callable[[Sequence[Task]], Iterator[tuple[Task, Found]]]
"""Works on tasks, and gives each of them with what was found, in their order; perhaps not all of them, where the time is over."""


@dataclass(frozen=True)
class SceneMap:
    """A map that was grown.

    Attributes:
        coverage: the share of the free configurations that it proves.
        looked: how many cells were looked at.
        cells: how many cells are proved.
        refused: how many tasks were given up because the verifier refused what they found.
        wanted: ``proved``, ``open`` or ``in_collision`` for each of the configurations that were wanted first.
        seconds: how long it took.
        reason: why it ended: ``coverage``, ``deadline``, ``nothing_left``, ``size`` where the verifier would not read a larger file,
            ``interrupted``, or ``worker_lost`` where a child died.
    """

    proof: MapProof
    coverage: Coverage
    looked: int
    cells: int
    refused: int
    wanted: list[str]
    seconds: float
    reason: str


def grow_map(
    scene: Scene,
    coverage: float,
    deadline_s: float | None = None,
    processes: int = 1,
    tell: Tell = lambda *_: None,
    at: Array | None = None,
    seed: int = 0,
    former: MapProof | None = None,
    ways: Array | None = None,
) -> SceneMap:
    """Grows the map of a scene until it covers this share, or the time is over, or somebody interrupts it.

    Args:
        coverage: share of the free configurations to cover.
        at: (D, n) configurations in s that are wanted first.
        former: a map of this scene or another one, which has passed the verifier. What it proves of the same bodies is taken over.
        ways: (W, 2, n) joint positions q where straight motions begin and end that are wanted first.
    """
    start = time.perf_counter()
    at = np.zeros((0, scene.n)) if at is None else at
    with _interrupts() as interrupted:

        def over() -> str | None:
            late = deadline_s is not None and time.perf_counter() > start + deadline_s
            return "interrupted" if interrupted() else "deadline" if late else None

        def told() -> None:
            now, seconds = growing.coverage, time.perf_counter() - start
            said = {"seconds": seconds, "coverage": now.share, "error": now.error, "cells": growing.planes, "looked": growing.looked}
            tell("map", said)

        growing = Growing(scene, at, seed, former, ways)
        with _workers(scene, growing, processes, over) as work:
            try:
                while (reason := grow_round(growing, work, coverage, over)) is None:
                    if not over():
                        told()
            except BrokenProcessPool:
                reason = "worker_lost"
        proof, seconds = growing.proof(), time.perf_counter() - start
    wanted = states_of(growing, at)
    return SceneMap(proof, growing.coverage, growing.looked, growing.planes, growing.refused, wanted, seconds, reason)


def in_s(scene: Scene, at: Sequence[Sequence[float]]) -> Array:
    """Returns joint positions, one row for each configuration, in s."""
    return scene.to_s(scene.in_windows(np.array(at, dtype=float).reshape(-1, scene.n)))


def ways_of(scene: Scene, paths: Sequence[Sequence[Sequence[float]]]) -> Array:
    """Returns where the straight parts of motions begin and end, (W, 2, n) in q; ``paths`` has the waypoints of each motion.

    Raises:
        RegionError: ``seed_outside_window``, for a waypoint that is a turn away from where the scene has it.
    """
    for i, path in enumerate(paths):
        for j, q in enumerate(path):
            check_in_windows(scene, q, f"options.paths[{i}][{j}]")
    ways = [ends for path in paths for ends in pairwise(path)]
    return np.array(ways, dtype=float).reshape(-1, 2, scene.n)


def states_of(trees: Trees, at: Array) -> list[str]:
    """Returns ``proved``, ``open`` or ``in_collision`` for configurations, (D, n) in s. One on a cut is proved if all sides of it are."""
    free = Plan(trees.scene).free(at)
    sides = beside(trees.scene, at)
    proved = trees.contains(sides.reshape(-1, trees.scene.n)).reshape(sides.shape[:2]).all(axis=1)
    return np.where(proved, "proved", np.where(free, "open", "in_collision")).tolist()


def grow_round(growing: Growing, work: Work, coverage: float, over: Callable[[], str | None]) -> str | None:
    """Grows a map by one round, or returns why it has ended before this one. A task is taken as a whole or not at all.

    Args:
        over: says why the map is to end now, or returns None.
    """
    if growing.coverage.share >= coverage and not growing.wants:
        return "coverage"
    if reason := ("size" if growing.full else over()):
        return reason
    tasks = growing.round()
    for task, found in work(tasks) if tasks else ():
        growing.take(task, found)
        if growing.full:
            break
    return None if tasks else "nothing_left"


@contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Yields what says whether somebody has interrupted this process, which does not end it. A second time does."""
    seen: list[int] = []
    before = signal.getsignal(signal.SIGINT)

    def note(number: int, _: object) -> None:
        seen.append(number)
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield lambda: bool(seen)
    finally:
        signal.signal(signal.SIGINT, before)


class Worker:
    """Works on tasks, and keeps the trees that it was asked for."""

    def __init__(self, scene: Scene, known: dict[Pairs, PairTree]) -> None:
        self._scene, self._known = scene, known

    def __call__(self, task: Task) -> Found:
        if task.pairs not in self._known:
            self._known[task.pairs] = PairTree(self._scene, task.pairs)
        tree = self._known[task.pairs]
        found = tree.advance(task.given, task.samples, task.weights, task.most, task.water)
        return tree.verified(task.given, found)


@contextmanager
def _workers(scene: Scene, growing: Growing, processes: int, over: Callable[[], str | None]) -> Iterator[Work]:
    """Yields what works on tasks until the time is over."""
    worker = Worker(scene, {pairs: tree.pair for pairs, tree in growing.trees.items()})
    if processes == 1:
        yield lambda tasks: _until(over, ((task, worker(task)) for task in tasks))
        return
    # The children are forked, so they have the trees without making them.
    with ProcessPoolExecutor(processes, multiprocessing.get_context("fork"), _adopt, (worker, os.getpid())) as executor:
        try:
            yield lambda tasks: _until(over, zip(tasks, executor.map(_run, tasks), strict=True))
        finally:
            executor.shutdown(cancel_futures=True)


def _until(over: Callable[[], str | None], done: Iterator[tuple[Task, Found]]) -> Iterator[tuple[Task, Found]]:
    """Yields what is done, and ends after what is done when the time is over."""
    for one in done:
        yield one
        if over():
            return


_adopted: list[Worker] = []
"""This holds the worker of the parent of this process, so that it need not travel to it."""


def _adopt(worker: Worker, parent: int) -> None:
    die_with_parent(parent=parent)  # the children hold one another's pipes open, so none of these would end
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal interrupts children too, but their parent says when they end
    _adopted.append(worker)


def _run(task: Task) -> Found:
    return _adopted[0](task)
