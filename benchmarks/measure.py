"""This module measures both sides on the same pairs and the same faces, in processor time of this process.

So other programs on the machine do not count, but threads that a side might start do.
"""

from __future__ import annotations

import os
import platform
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Generic, TypeVar

from benchmarks.catalogue import Region
from certifier.jobs.reference import Reference, ReferenceResult
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.pair.result import PairResult
from certifier.proof.negative import DualProof, WitnessProof
from certifier.proof.pair import PairProof
from certifier.proof.partition import PartitionProof
from certifier.proof.region import RegionProof
from certifier.verify.dual import verify_dual
from certifier.verify.pair import PairCheck
from certifier.verify.witness import verify_witness

Progress = Callable[[str], None]
PACKAGES = ("drake", "numpy", "scipy", "numba", "python-flint")


def machine() -> dict[str, Any]:
    """Returns where and with what a measurement is made, JSON-able."""
    path = Path("/proc/cpuinfo")
    found = re.search(r"^model name\s*:\s*(.+)$", path.read_text(), re.MULTILINE) if path.exists() else None
    return {
        "processor": found[1] if found else platform.processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "python": platform.python_version(),
        "versions": {package: version(package) for package in PACKAGES},
    }


def share(manifest: dict[str, Any]) -> dict[str, Any]:
    """Returns which share of the proposal a region keeps; nothing is known where its growth ended before there was a proposal."""
    return manifest["share"] or {"value": None, "stderr": None}


def cells(data: bytes) -> int:
    """Returns how many cells the partitions in a region's proof file have."""
    proofs = RegionProof.from_bytes(data).proofs
    return sum(int((proof.nodes < 0).sum()) for proof in proofs if isinstance(proof, PartitionProof))


@dataclass(frozen=True)
class Ours:
    """Describes one pair that our certifier answered.

    Attributes:
        seconds: time for everything, verification included. What pairs share, such as a proof, counts for the first pair that needs it.
        verify_seconds: time to check the proof, measured by checking it once more.
        covers: how many pairs the proof is about.
    """

    result: PairResult
    seconds: float
    verify_seconds: float
    covers: int

    @property
    def solve_seconds(self) -> float:
        return self.seconds - self.verify_seconds


Answer = TypeVar("Answer", Ours, ReferenceResult)


@dataclass(frozen=True)
class Run(Generic[Answer]):
    """Describes one side: the seconds spent once for all pairs, and the answer for every pair by its index."""

    setup_seconds: float
    pairs: dict[int, Answer]


def ours(scene: Scene, region: Region, indices: list[int], progress: Progress = lambda _: None) -> Run[Ours]:
    """Certifies the pairs with our certifier. Every proof is checked as it is made, and once more to measure its time.

    Raises:
        ProofError: a proof does not hold.
    """
    start = time.process_time()
    certification = Certification(scene, scene.polytope(region.C, region.d), region.center)
    setup, verifier, found = time.process_time() - start, Verifier(scene), {}
    for index in indices:
        start = time.process_time()
        result = certification.certify(index)
        seconds = time.process_time() - start
        check = verifier.verify(result)
        found[index] = answer = Ours(result, seconds, check.seconds, check.covers)
        progress(_line("ciris", scene, index, len(found), len(indices), result.outcome, answer.seconds))
    return Run(setup, found)


@dataclass(frozen=True)
class Check:
    """Says in words what was checked, of how many pairs, and how many seconds it took. A proof checked before takes no time again."""

    what: str
    covers: int
    seconds: float


class Verifier:
    """Checks the proofs of one scene from their bytes. Proofs on one polytope share what is the same, as in the certifier."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._on: dict[bytes, PairCheck] = {}
        self._done: dict[bytes, Check] = {}

    def verify(self, result: PairResult) -> Check:
        """Checks the proof of an outcome.

        Raises:
            ProofError: the proof does not hold.
        """
        if result.proof is None:
            return Check("none", 1, 0.0)
        if result.proof in self._done:
            return replace(self._done[result.proof], seconds=0.0)
        start = time.process_time()
        what, covers = self._check(result.outcome, result.proof)
        self._done[result.proof] = check = Check(what, covers, time.process_time() - start)
        return check

    def _check(self, outcome: Outcome, data: bytes) -> tuple[str, int]:
        if outcome is Outcome.CERTIFIED:
            proof = PairProof.from_bytes(data, self._scene)
            ground = b"".join(array.tobytes() for array in vars(proof.ground).values())
            if ground not in self._on:
                self._on[ground] = PairCheck(self._scene, proof.ground)
            return "certificate verified exactly", len(self._on[ground].verify(proof).pairs)
        if outcome is Outcome.NOT_CERTIFIABLE:
            verify_dual(DualProof.from_bytes(data, self._scene))
            return "dual proof verified", 1
        verify_witness(WitnessProof.from_bytes(data, self._scene))
        return "contact verified", 1


def drake(scene: Scene, region: Region, indices: list[int], progress: Progress) -> Run[ReferenceResult]:
    """Certifies the pairs with Drake's program and Clarabel."""
    reference, found = Reference(scene), {}
    for index in indices:
        found[index] = answer = reference.certify(index, region.C, region.d)
        seconds = answer.build_seconds + answer.solve_seconds
        progress(_line("drake", scene, index, len(found), len(indices), answer.outcome, seconds))
    return Run(reference.setup_seconds, found)


def _line(side: str, scene: Scene, index: int, done: int, of: int, outcome: str, seconds: float) -> str:
    pair = scene.pairs[index]
    return f"{side} {done}/{of} {pair.a} - {pair.b}: {outcome}, {seconds:.3f} s"
