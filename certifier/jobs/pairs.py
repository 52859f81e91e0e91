"""The pairs of a certification are certified by the program (11) on all of the polytope, or cell by cell.

The local driver and the service's workers both ask here, so they come to the same results.
"""

from __future__ import annotations

from collections.abc import Callable

from certifier.growth.actions import Certify
from certifier.model import Scene
from certifier.pair.certification import Certification
from certifier.pair.result import PairResult
from certifier.partition.certification import CellCertification

CertifyPair = Callable[[int, bytes | None], PairResult]
"""Certifies a pair by its index, and goes on with the ``partition`` of an earlier result of this pair where there is one."""


def pair_certifier(scene: Scene, action: Certify, seed: int) -> CertifyPair:
    """Prepares what all pairs of the action share, and returns the function that certifies one of them.

    Args:
        seed: seeds the samples.

    Raises:
        RegionError: the polytope is empty or unbounded, or the centre is not inside.
    """
    hard, ending = frozenset(action.hard), frozenset(action.ending)
    if action.cells == 1:
        program = Certification(scene, action.polytope, action.center, seed)
        return lambda index, begun: program.certify(index, every_face=index in hard)
    search = CellCertification(scene, action.polytope, seed, action.box)
    return lambda index, begun: search.certify(index, action.cells, begun, index in ending)
