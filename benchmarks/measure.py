"""Both sides on the same pairs and the same faces, in processor time of this process: other programs on the machine do not count,
threads that a side might start do.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from benchmarks.catalogue import Region
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.pair import Certification, PairResult
from certifier.proof import PairProof
from certifier.reference import Reference, ReferenceResult
from certifier.verify.pair import PairCheck

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Ours:
    """One pair by our certifier.

    Attributes:
        seconds: everything, verification included; what pairs share is paid by the first that needs it.
        verify_seconds: what checking the proof takes, measured by checking it once more.
    """

    result: PairResult
    seconds: float
    verify_seconds: float

    @property
    def solve_seconds(self) -> float:
        return self.seconds - self.verify_seconds


Answer = TypeVar("Answer", Ours, ReferenceResult)


@dataclass(frozen=True)
class Run(Generic[Answer]):
    """One side: the seconds spent once for all pairs, and the answer for every pair by its index."""

    setup_seconds: float
    pairs: dict[int, Answer]


def ours(scene: Scene, region: Region, indices: list[int], progress: Progress) -> Run[Ours]:
    """The pairs by our certifier, each proof verified."""
    start = time.process_time()
    certification = Certification(scene, scene.polytope(region.C, region.d), region.center)
    setup = time.process_time() - start
    results: dict[int, tuple[PairResult, float]] = {}
    last = time.process_time()
    for index, result in _certify(certification, indices):
        results[index] = result, time.process_time() - last
        progress(_line("ciris", scene, index, len(results), len(indices), result.outcome, results[index][1]))
        last = time.process_time()
    verification = dict(
        _verify(
            scene, {index: result.proof for index, (result, _) in results.items() if result.outcome is Outcome.CERTIFIED and result.proof}
        )
    )
    return Run(setup, {index: Ours(result, seconds, verification.get(index, 0.0)) for index, (result, seconds) in results.items()})


def _certify(certification: Certification, indices: list[int]) -> Iterator[tuple[int, PairResult]]:
    for index in indices:
        yield index, certification.certify(index)


def _verify(scene: Scene, proofs: dict[int, bytes]) -> Iterator[tuple[int, float]]:
    """Seconds of checking every proof; one that serves several pairs is checked once."""
    checks: dict[bytes, PairCheck] = {}
    done: set[bytes] = set()
    for index, data in proofs.items():
        if data in done:
            continue
        done.add(data)
        proof = PairProof.from_bytes(data, scene)
        ground = b"".join(array.tobytes() for array in vars(proof.ground).values())
        if ground not in checks:
            checks[ground] = PairCheck(scene, proof.ground)
        start = time.process_time()
        checks[ground].verify(proof)
        yield index, time.process_time() - start


def drake(scene: Scene, region: Region, indices: list[int], time_limit: float | None, progress: Progress) -> Run[ReferenceResult]:
    """The pairs by Drake's program and Clarabel."""
    reference = Reference(scene, time_limit=time_limit)
    found = {}
    for index in indices:
        found[index] = answer = reference.certify(index, region.C, region.d)
        seconds = answer.build_seconds + answer.solve_seconds
        progress(_line("drake", scene, index, len(found), len(indices), answer.outcome, seconds))
    return Run(reference.setup_seconds, found)


def _line(side: str, scene: Scene, index: int, done: int, of: int, outcome: str, seconds: float) -> str:
    pair = scene.pairs[index]
    return f"{side} {done}/{of} {pair.a} - {pair.b}: {outcome}, {seconds:.3f} s"
