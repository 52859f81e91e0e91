"""Parts of pairs that are alike are done by one child, and their results come in the order in which they were asked for."""

from __future__ import annotations

import itertools
import os
from collections.abc import Generator, Sequence
from pathlib import Path

import numpy as np
import pytest

from certifier.errors import CirisError
from certifier.growth.options import GrowthOptions
from certifier.growth.pairs import alike
from certifier.jobs import local
from certifier.jobs.pairs import CertifyPart
from certifier.jobs.parallel import Asked, side_by_side
from certifier.outcome import Outcome
from certifier.pair.result import PairResult, Stage
from certifier.scene import load_scene
from tests.certifier.scenes import planar_arm
from tests.scenes import box_seed

EXAMPLES = Path(__file__).parents[3] / "examples"


def _who(index: int, part: int) -> PairResult:
    return PairResult(Outcome.INCONCLUSIVE, Stage.CELLS, detail=f"{index} {part} {os.getpid()}")


def test_results_come_in_order_and_alike_pairs_share_a_child() -> None:
    asked = [(index, part) for index in range(12) for part in range(1 + index % 3)]
    found = [result.detail.split() for result in side_by_side(_who, asked, 2, lambda index: index % 4)]
    assert [(int(index), int(part)) for index, part, _ in found] == asked
    children: dict[tuple[int, int], set[str]] = {}
    for index, part, child in found:
        children.setdefault((int(index) % 4, int(part)), set()).add(child)
    assert all(len(pids) == 1 for pids in children.values())
    assert str(os.getpid()) not in {child for _, _, child in found}


def test_an_interrupt_while_children_end_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """An exception in a generator that is only dropped would be printed and forgotten."""
    scene = planar_arm(2)

    def interrupted(certify: CertifyPart, asked: Sequence[Asked], *_: object) -> Generator[PairResult]:
        try:
            yield from itertools.starmap(certify, asked)
            yield PairResult(Outcome.INCONCLUSIVE, Stage.CELLS)  # for which nobody asks
        finally:
            raise KeyboardInterrupt

    monkeypatch.setattr(local, "side_by_side", interrupted)
    with pytest.raises(KeyboardInterrupt):
        local.grow(scene, GrowthOptions(seed=box_seed(np.zeros(2), 0.1)))


def test_pairs_of_the_same_parts_are_alike() -> None:
    scene = load_scene(EXAMPLES / "sphere_arm" / "scene.yaml")
    kinds: dict[frozenset[str], set[tuple[str, ...]]] = {}
    for index, pair in enumerate(scene.pairs):
        bodies = tuple(sorted(scene.geometry(name).body for name in (pair.a, pair.b)))
        kinds.setdefault(alike(scene, index), set()).add(bodies)
    assert all(len(bodies) == 1 for bodies in kinds.values())
    assert 1 < len(kinds) < len(scene.pairs) / 4
    # The boards of the rack are at rest in the world, but have little to do with each other.
    assert sum("arm/link_7" in kind and len({*kind} - {"arm/link_7"}) == 1 for kind in kinds) > 6


def test_the_death_of_a_child_is_an_error_that_says_what_to_do() -> None:
    def dies(index: int, part: int) -> PairResult:
        if index == 3:
            os._exit(1)
        return _who(index, part)

    with pytest.raises(CirisError, match="a process that certified pairs died") as caught:
        list(side_by_side(dies, [(index, 0) for index in range(6)], 2, lambda index: index))
    assert caught.value.code == "worker_lost"
