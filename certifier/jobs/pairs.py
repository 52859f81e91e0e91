"""The pairs of a certification are certified by the program (11) on all of the polytope, or cell by cell.

The local driver and the service's workers both ask here, so they come to the same results.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from certifier.growth.actions import Certify
from certifier.model import Scene
from certifier.pair.certification import Certification
from certifier.pair.result import PairResult
from certifier.partition.certification import CellCertification
from certifier.partition.subtrees import open_cells

NEAR = 0.1
"""Places of open cells of hard pairs are cut off where the bodies are nearer than this, relative to their extent."""
CertifyPart = Callable[[int, int], PairResult]
"""Certifies a pair by its index, or the part of it that has this number."""
Left = Callable[[int, int], list[bytes]]
"""Returns the ``subtrees`` that an iteration, by its number, has left of a pair, by its index, in the order of the parts."""


def part_certifier(scene: Scene, action: Certify, seed: int, left: Left) -> CertifyPart:
    """Prepares what all pairs of the action share, and returns the function that certifies a part of one of them.

    Args:
        seed: seeds the samples.
        left: reads what the iterations from ``action.begun`` on have left.

    Raises:
        RegionError: the polytope is empty or unbounded, or the centre is not inside.
    """
    within = dict.fromkeys(action.hard, NEAR) | dict.fromkeys(action.ending, math.inf)
    if action.cells == 1:
        program = Certification(scene, action.polytope, action.center, seed)
        return lambda index, part: program.certify(index, every_face=index in within)
    search, begun = CellCertification(scene, action.polytope, seed, action.box), action.begun
    if begun is None:
        return lambda index, part: search.certify(index, action.cells, within.get(index, 0.0))

    def go_on(index: int, part: int) -> PairResult:
        last, parts = left(action.iteration - 1, index), action.parts.get(index, 1)
        if not open_cells(last):
            return search.put_together(index, [left(iteration, index) for iteration in range(begun, action.iteration)], part, parts)
        return search.go_on(index, action.cells, last, part, parts, within.get(index, 0.0))

    return go_on
