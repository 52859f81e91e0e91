"""The agreement campaign compares our verdicts with Drake's, on pairs that are feasible and on their infeasible twins.

Drake chooses the frame of a pair in its own way. Our frame may be another one of equal cost. Where naming the two bodies in the other
order makes it Drake's frame, we do so, and the two programs are the same. Where the frames still differ, the verdict says so.

The verifier checks each of our answers from the bytes of its proof.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks import measure
from benchmarks.arms import random_arm, random_faces
from benchmarks.catalogue import Region
from benchmarks.compare import Verdict, same_program, verdict
from benchmarks.measure import Progress
from certifier.jobs.reference import Reference
from certifier.model import Pair, Scene
from certifier.outcome import Outcome
from certifier.pair.certification import certify_pair
from certifier.pair.forecast import forecast
from certifier.pair.result import PairResult

BOXES, ROUND = 60, 40
"""The campaign has BOXES random arms with boxes alone, and ROUND that also have balls and capsules."""
SMALLEST, LARGEST = 0.05, 1.0
"""The polytopes around a random arm have sizes from SMALLEST to LARGEST. The largest reaches to the joint limits."""
BRACKET, APART = 1.02, 1.01
"""A pair ceases to be certifiable between two sizes whose ratio is at most BRACKET.

Drake is asked at two sizes that lie outside of these, each by the factor APART.
"""


@dataclass(frozen=True)
class Question:
    """Asks about the one pair of a scene on one polytope."""

    name: str
    group: str
    scene: Scene
    region: Region


def questions(boxes: int = BOXES, rounded: int = ROUND) -> Iterator[Question]:
    """Yields the whole campaign: arms of either kind, each with polytopes of four sizes."""
    yield from _questions("boxes", boxes, rounded=False)
    yield from _questions("round", rounded, rounded=True)


def _questions(group: str, count: int, rounded: bool) -> Iterator[Question]:
    """Yields the questions about arms of 2 to 4 joints.

    Each arm keeps the first of its pairs, in random order, that is certified at the smallest size and not at the largest. So each
    feasible question has its infeasible twin.
    """
    made = seed = 0
    while made < count:
        rng = np.random.default_rng([seed, rounded])
        arm = random_arm(rng, 2 + seed % 3, rounded)
        center = rng.uniform(-0.3, 0.3, arm.n)
        C, d = random_faces(rng, center, 1.0)
        whole = Region(C, d, center)
        for pair in (arm.pairs[i] for i in rng.permutation(len(arm.pairs))):
            scene = replace(arm, pairs=(pair,))
            if _certifies(scene, _scaled(whole, SMALLEST)) and not _certifies(scene, _scaled(whole, LARGEST)):
                for size in (SMALLEST, *_bracket(scene, whole), LARGEST):
                    yield Question(f"{group} {seed} x {size:.3g}", group, scene, _scaled(whole, size))
                made += 1
                break
        seed += 1


def _scaled(region: Region, size: float) -> Region:
    return Region(region.C, region.C @ region.center + size * (region.d - region.C @ region.center), region.center)


def _certify(scene: Scene, region: Region) -> PairResult:
    return certify_pair(scene, 0, scene.polytope(region.C, region.d), region.center)


def _certifies(scene: Scene, region: Region) -> bool:
    return _certify(scene, region).outcome is Outcome.CERTIFIED


def _bracket(scene: Scene, region: Region) -> tuple[float, float]:
    """Returns a size just below, and one just above, the size at which the pair ceases to be certifiable."""
    certified, failed = SMALLEST, LARGEST
    while failed > BRACKET * certified:
        middle = float(np.sqrt(certified * failed))
        certified, failed = (middle, failed) if _certifies(scene, _scaled(region, middle)) else (certified, middle)
    return certified / APART, failed * APART


def campaign(questions: Iterable[Question], progress: Progress) -> dict[str, Any]:
    """Asks both sides everything, and returns the document of ``ciris bench agreement``.

    Raises:
        ProofError: one of our proofs does not hold.
    """
    findings = []
    for question in questions:
        findings.append(finding := _ask(question))
        progress(f"{len(findings)} {question.name}: {finding['ciris']}, Drake {finding['drake']}: {finding['verdict']}")
    counts = Counter((f["group"], f["ciris"], f["drake"], f["verdict"]) for f in findings)
    return {
        "benchmark": "agreement",
        "machine": measure.machine(),
        "instances": len(findings),
        "same_program": sum(f["same_program"] for f in findings),
        "counts": [{"group": g, "ciris": c, "drake": d, "verdict": v, "instances": n} for (g, c, d, v), n in sorted(counts.items())],
        "verdicts": dict(Counter(f["verdict"] for f in findings)),
        "evidence": dict(Counter(f["evidence"] for f in findings)),
        "disagreements": [f for f in findings if f["verdict"] != Verdict.AGREE],
    }


def _ask(question: Question) -> dict[str, Any]:
    region = question.region
    theirs = Reference(question.scene).certify(0, region.C, region.d)
    scene, frame = _in_frame(question.scene, theirs.frame)
    ours = _certify(scene, region)
    same = same_program(scene, scene.pairs[0], frame, theirs.frame)
    return {
        "name": question.name,
        "group": question.group,
        "ciris": ours.outcome.value,
        "detail": ours.detail,
        "drake": theirs.outcome.value,
        "status": theirs.status,
        "frames": [frame, theirs.frame],
        "same_program": same,
        "verdict": verdict(ours.outcome, theirs.outcome, same).value,
        "evidence": measure.Verifier(scene).verify(ours).what,
    }


def _in_frame(scene: Scene, frame: str) -> tuple[Scene, str]:
    """Returns the scene of one pair and the frame that we choose for it.

    The pair's bodies are named in the order in which our frame is the given one, if such an order exists.
    """
    (pair,) = scene.pairs
    named = [replace(scene, pairs=(order,)) for order in (pair, Pair(pair.b, pair.a))]
    ours = [(some, forecast(some)[0].frame) for some in named]
    return next((found for found in ours if found[1] == frame), ours[0])
