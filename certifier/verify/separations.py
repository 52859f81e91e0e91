"""Many proofs of pairs, of any form, are checked here, by several processes if one likes. The results are the same for any number of them.

The parts are the proofs, and some cells at a time of those over partitions. Processes are forked, so they share the proofs in memory, and
each checks one part after the other. Few parts wait at once, so memory stays bounded.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from certifier.errors import ProofError
from certifier.model import Scene, Volume
from certifier.orphans import die_with_parent
from certifier.proof.map import PairMap
from certifier.proof.pair import PairProof
from certifier.proof.partition import OPEN, PartitionProof
from certifier.proof.separation import Separation
from certifier.verify.pair import PairCheck, PairStatement, check_ground, check_interior
from certifier.verify.partition import CellCheck, PartitionCheck
from certifier.verify.residual import NumeratorCache
from certifier.verify.scene import check_scene
from certifier.verify.streams import Cells
from certifier.verify.volume import check_contained

Progress = Callable[[int, int], None]
"""A function of this kind receives how many of how many parts are checked: cells, and proofs without any."""
CELLS = 256
"""A part has at most this many cells."""
WAITING = 4
"""At most this many parts wait or run for each process."""


class Part(NamedTuple):
    """A part of the work: a proof's number, and which of its cells; None for a proof without cells."""

    proof: int
    cells: Cells | None


def statements(
    scene: Scene | None, proofs: Sequence[Separation], processes: int = 1, progress: Progress | None = None
) -> list[PairStatement]:
    """Checks proofs and returns what each of them proves.

    Args:
        scene: what all proofs have to be about; None where each is about its own scene. certifier.verify.scene.check_scene has accepted it.
        proofs: on grounds that certifier.verify.pair.check_ground has accepted.

    Raises:
        ProofError: one of the proofs does not hold; the first one, in their order.
    """
    if scene is not None:
        check_contained((scene, {id(volume): volume for proof in proofs for volume in proof.all_volumes}.values()))
    check = _Check(scene, proofs)
    gaps = [np.inf] * len(proofs)
    sizes = [
        int(np.count_nonzero((proof.nodes < 0) & (proof.nodes != OPEN))) if isinstance(proof, PartitionProof) else 1 for proof in proofs
    ]
    done, total = 0, sum(sizes)
    processes = max(1, min(processes, sum(-(-size // CELLS) for size in sizes)))
    for part, gap in _results(check, processes):
        gaps[part.proof] = min(gap, gaps[part.proof])
        done += 1 if part.cells is None else len(part.cells.number)
        if progress:
            progress(done, total)
    return [check.statement(proof, gap) for proof, gap in zip(proofs, gaps, strict=True)]


def gap_of_share(scene: Scene, proof: PartitionProof, share: int, shares: int) -> float:
    """Checks a share of the cells of a proof and returns the gap that they prove, in metres. The proof holds when all its shares do.

    Args:
        scene, proof: as for :func:`statements`.
        share: its number, from 0.

    Raises:
        ProofError: the proof makes no sense, or a cell of the share does not hold.
    """
    check_contained((scene, proof.all_volumes))
    check = _Check(scene, [proof])
    gap = min((check.gap(part) for part in itertools.islice(check.parts(), share, None, shares)), default=np.inf)
    return check.statement(proof, gap).gap if shares == 1 else gap


def verify_separation(proof: Separation, processes: int = 1, progress: Progress | None = None) -> PairStatement:
    """Checks a proof of any form, and what it is about, and returns what it proves.

    Raises:
        ProofError: the proof does not hold.
    """
    check_scene(proof.scene)
    check_ground(proof.scene, proof.ground)
    check_interior(proof.scene, proof.ground, proof.interior)
    return statements(proof.scene, [proof], processes, progress)[0]


class _Check:
    """Checks parts, and keeps what the next one needs."""

    def __init__(self, scene: Scene | None, proofs: Sequence[Separation]) -> None:
        self._scene, self._proofs = scene, proofs
        self._contained: dict[int, Volume] = {}
        self._coarse: dict[int, Volume] = {}
        self._numerators = NumeratorCache()
        self._pair_checks: dict[int, PairCheck] = {}
        self._latest: tuple[int, CellCheck] | None = None

    def parts(self) -> Iterator[Part]:
        """Yields the parts of all proofs, in their order.

        Raises:
            ProofError: a proof makes no sense, or its cuts do not divide the box.
        """
        for number, proof in enumerate(self._proofs):
            if isinstance(proof, PartitionProof):
                for cells in self._cell_check(number, proof).cells(CELLS):
                    yield Part(number, cells)
            else:
                yield Part(number, None)

    def gap(self, part: Part) -> float:
        """Checks a part and returns the gap that it proves.

        Raises:
            ProofError: it does not hold.
        """
        proof = self._proofs[part.proof]
        if isinstance(proof, PartitionProof) and part.cells is not None:
            return self._cell_check(part.proof, proof).gap(part.cells)
        if not isinstance(proof, PairProof):
            raise ProofError("proof_malformed", f"{proof.title}: a proof of kind {proof.KIND} cannot be checked")
        ground = proof.ground
        if id(ground) not in self._pair_checks:
            self._pair_checks[id(ground)] = PairCheck(self._scene or proof.scene, ground, self._contained, self._numerators)
        return self._pair_checks[id(ground)].verify(proof).gap

    def statement(self, proof: Separation, gap: float) -> PairStatement:
        """Returns what a proof proves of which all parts hold.

        Raises:
            ProofError: the proof says that its polytope is empty.
        """
        if not np.isfinite(gap) and not isinstance(proof, PairMap):
            raise ProofError("proof_interior", f"{proof.title}: the proof says that the polytope is empty")
        return PairStatement(proof.pairs, gap)

    def _cell_check(self, number: int, proof: PartitionProof) -> CellCheck:
        if self._latest is None or self._latest[0] != number:
            check = PartitionCheck(self._scene or proof.scene, proof.ground, self._contained, self._coarse)
            self._latest = number, check.prepared(proof)
        return self._latest[1]


def _results(check: _Check, processes: int) -> Iterator[tuple[Part, float]]:
    """Yields all parts with their gaps, in order.

    Raises:
        ProofError: that of the first part that does not hold.
    """
    if processes == 1:
        for part in check.parts():
            yield part, check.gap(part)
        return
    executor = ProcessPoolExecutor(processes, multiprocessing.get_context("fork"), _adopt, (check, os.getpid()))
    waiting: deque[tuple[Part, Future[float | dict[str, str | None]]]] = deque()
    try:
        parts, wrong = check.parts(), None
        while True:
            try:
                part = next(parts)
            except StopIteration:
                break
            except ProofError as error:  # a part before this one may be wrong as well
                wrong = error
                break
            waiting.append((part, executor.submit(_run, part)))
            if len(waiting) == WAITING * processes:
                yield _result(*waiting.popleft())
        while waiting:
            yield _result(*waiting.popleft())
        if wrong:
            raise wrong
    finally:
        executor.shutdown(cancel_futures=True)


_adopted: list[_Check] = []
"""This holds what the parent of this process checks, so that a part alone travels to it."""


def _adopt(check: _Check, parent: int) -> None:
    die_with_parent(parent=parent)  # the children hold one another's pipes open, so none of these would end
    _adopted.append(check)


def _run(part: Part) -> float | dict[str, str | None]:
    """Returns the gap of a part, or the error as a document."""
    try:
        return _adopted[0].gap(part)
    except ProofError as error:
        return error.to_document()


def _result(part: Part, future: Future[float | dict[str, str | None]]) -> tuple[Part, float]:
    found = future.result()
    if isinstance(found, dict):
        raise ProofError(found["code"] or "", found["message"] or "", field=found["field"], hint=found["hint"] or "")
    return part, found
