"""The map of a scene is grown here, in this process and children of it."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from certifier.map.growing import Coverage, Growing, Task
from certifier.map.pair import Found, PairTree
from certifier.map.trees import Pairs
from certifier.model import Array, Scene
from certifier.orphans import die_with_parent
from certifier.proof.map import MapProof

Tell = Callable[[str, dict[str, Any]], None]
Work = Callable[[Sequence[Task]], Iterator[Found]]
"""Works on tasks, and gives the results in their order."""


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
) -> SceneMap:
    """Grows the map of a scene until it covers this share, or the time is over, or somebody interrupts it.

    Args:
        coverage: share of the free configurations to cover.
        at: (D, n) configurations in s that are wanted first.
    """
    start = time.perf_counter()
    end = math.inf if deadline_s is None else start + deadline_s
    at = np.zeros((0, scene.n)) if at is None else at
    with _interrupts() as interrupted:
        growing = Growing(scene, at, seed)
        with _workers(scene, growing, processes) as work:
            try:
                reason = _grown(growing, work, coverage, start, end, interrupted, tell)
            except BrokenProcessPool:
                reason = "worker_lost"
        proof, seconds = growing.proof(), time.perf_counter() - start
    wanted = np.where(growing.contains(at), "proved", np.where(growing.is_free(at), "open", "in_collision")).tolist()
    return SceneMap(proof, growing.coverage, growing.looked, growing.planes, growing.refused, wanted, seconds, reason)


def _grown(growing: Growing, work: Work, coverage: float, start: float, end: float, interrupted: Callable[[], bool], tell: Tell) -> str:
    """Grows a map until it covers enough, or the time is over, and returns why it ended. A task is taken as a whole or not at all."""
    while tasks := growing.round():
        for task, found in zip(tasks, work(tasks), strict=True):
            growing.take(task, found)
            if growing.full:
                return "size"
            if interrupted():
                return "interrupted"
            if time.perf_counter() > end:
                return "deadline"
        now = growing.coverage
        seconds = time.perf_counter() - start
        tell("map", {"seconds": seconds, "coverage": now.share, "error": now.error, "cells": growing.planes, "looked": growing.looked})
        if now.share >= coverage:
            return "coverage"
    return "nothing_left"


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


class _Worker:
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
def _workers(scene: Scene, growing: Growing, processes: int) -> Iterator[Work]:
    """Yields what works on tasks."""
    worker = _Worker(scene, {pairs: tree.pair for pairs, tree in growing.trees.items()})
    if processes == 1:
        yield lambda tasks: map(worker, tasks)
        return
    # The children are forked, so they have the trees without making them.
    with ProcessPoolExecutor(processes, multiprocessing.get_context("fork"), _adopt, (worker, os.getpid())) as executor:
        try:
            yield lambda tasks: executor.map(_run, tasks)
        finally:
            executor.shutdown(cancel_futures=True)


_adopted: list[_Worker] = []
"""This holds the worker of the parent of this process, so that it need not travel to it."""


def _adopt(worker: _Worker, parent: int) -> None:
    die_with_parent(parent=parent)  # the children hold one another's pipes open, so none of these would end
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal interrupts children too, but their parent says when they end
    _adopted.append(worker)


def _run(task: Task) -> Found:
    return _adopted[0](task)
