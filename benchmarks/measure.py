"""Both sides on the same pairs and the same faces, in processor time of this process: other programs on the machine do not count,
threads that a side might start do.
"""

from __future__ import annotations

import os
import platform
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Generic, TypeVar

from benchmarks.catalogue import Region
from certifier.disproof import DualProof, WitnessProof
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.pair import Certification, PairResult
from certifier.proof import PairProof
from certifier.reference import Reference, ReferenceResult
from certifier.verify.dual import verify_dual
from certifier.verify.pair import PairCheck
from certifier.verify.witness import verify_witness

Progress = Callable[[str], None]
PACKAGES = ("drake", "numpy", "scipy", "numba", "python-flint")


def machine() -> dict[str, Any]:
    """Where and with what a measurement is made, JSON-able."""
    path = Path("/proc/cpuinfo")
    found = re.search(r"^model name\s*:\s*(.+)$", path.read_text(), re.MULTILINE) if path.exists() else None
    return {
        "processor": found[1] if found else platform.processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "python": platform.python_version(),
        "versions": {package: version(package) for package in PACKAGES},
    }


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


def ours(scene: Scene, region: Region, indices: list[int], progress: Progress = lambda _: None) -> Run[Ours]:
    """The pairs by our certifier; every proof is checked as it is made, and once more for its time.

    Raises:
        ProofError: a proof does not hold.
    """
    start = time.process_time()
    certification = Certification(scene, scene.polytope(region.C, region.d), region.center)
    setup, check, found = time.process_time() - start, PairCheck(scene, certification.ground), {}
    for index in indices:
        start = time.process_time()
        result = certification.certify(index)
        certified = time.process_time()
        verify(scene, result, check)
        found[index] = answer = Ours(result, certified - start, time.process_time() - certified if result.proof else 0.0)
        progress(_line("ciris", scene, index, len(found), len(indices), result.outcome, answer.seconds))
    return Run(setup, found)


def verify(scene: Scene, result: PairResult, check: PairCheck) -> str:
    """Check the proof of an outcome from its bytes; returns what was checked, empty where there is nothing.

    Raises:
        ProofError: it does not hold.
    """
    if result.proof is None:
        return ""
    if result.outcome is Outcome.CERTIFIED:
        check.verify(PairProof.from_bytes(result.proof, scene))
        return "certificate verified exactly"
    if result.outcome is Outcome.NOT_CERTIFIABLE:
        verify_dual(DualProof.from_bytes(result.proof, scene))
        return "dual proof verified"
    verify_witness(WitnessProof.from_bytes(result.proof, scene))
    return "contact verified"


def drake(scene: Scene, region: Region, indices: list[int], progress: Progress) -> Run[ReferenceResult]:
    """The pairs by Drake's program and Clarabel."""
    reference, found = Reference(scene), {}
    for index in indices:
        found[index] = answer = reference.certify(index, region.C, region.d)
        seconds = answer.build_seconds + answer.solve_seconds
        progress(_line("drake", scene, index, len(found), len(indices), answer.outcome, seconds))
    return Run(reference.setup_seconds, found)


def _line(side: str, scene: Scene, index: int, done: int, of: int, outcome: str, seconds: float) -> str:
    pair = scene.pairs[index]
    return f"{side} {done}/{of} {pair.a} - {pair.b}: {outcome}, {seconds:.3f} s"
