"""The pairs of a certification are certified by the program (11) on all of the polytope, or cell by cell.

The local driver and the service's workers both use this module, so their results are the same.
"""

from __future__ import annotations

from collections.abc import Callable

from certifier.carry.carry import Carry
from certifier.growth.actions import Certify
from certifier.model import Scene
from certifier.outcome import Outcome, Stage
from certifier.pair.certification import Certification
from certifier.pair.result import PairResult
from certifier.partition.certification import CellCertification, CutOff
from certifier.partition.subtrees import open_cells

CertifyPart = Callable[[int, int], PairResult]
"""Certifies a pair by its index, or the part of it that has this number."""
Left = Callable[[int, int], list[bytes]]
"""Returns the ``subtrees`` that an iteration, by its number, has left of a pair, by its index, in the order of the parts."""


def part_certifier(scene: Scene, action: Certify, seed: int, left: Left, carried: Carry | None = None) -> CertifyPart:
    """Prepares what all pairs of the action share, and returns the function that certifies a part of one of them.

    Args:
        seed: seeds the samples.
        left: reads what the iterations in ``action.begun``, and those after them, have left.
        carried: what the proof of a region of the scene before it changed is worth; None where there is no such region.

    Raises:
        RegionError: the polytope is empty or unbounded, or the centre is not inside.
    """
    cut_off = dict.fromkeys(action.hard, CutOff.NEAR) | dict.fromkeys(action.ending, CutOff.COARSELY)
    cut_off |= dict.fromkeys({*action.hard} & {*action.ending}, CutOff.ALL)
    if action.cells == 1:
        program = Certification(scene, action.polytope, action.center, seed)
        return lambda index, part: program.certify(index, every_face=index in action.hard)
    search = CellCertification(scene, action.polytope, seed, action.box, action.together, action.keep)
    begin = _beginning(search, action, cut_off, carried or Carry({}, {}))

    def certify(index: int, part: int) -> PairResult:
        begun = action.begun.get(index)
        if begun is None:
            return begin(index)
        last, parts = left(action.iteration - 1, index), action.parts.get(index, 1)
        if not open_cells(last):
            return search.put_together(index, [left(iteration, index) for iteration in range(begun, action.iteration)], part, parts)
        return search.go_on(index, action.cells, last, part, parts, cut_off.get(index, CutOff.CONTACTS))

    return certify


def _beginning(search: CellCertification, action: Certify, cut_off: dict[int, CutOff], carried: Carry) -> Callable[[int], PairResult]:
    """Returns the function that begins the partition of a pair, or takes over the proof that it has already."""
    files: dict[int, bytes] = {}

    def begin(index: int) -> PairResult:
        if index not in carried.proofs:
            return search.certify(index, action.cells, cut_off.get(index, CutOff.CONTACTS), carried.starts.get(index))
        proof = carried.proofs[index]
        if id(proof) not in files:
            files[id(proof)] = proof.to_bytes()
        return PairResult(Outcome.CERTIFIED, Stage.CARRIED, proof=files[id(proof)])

    return begin
