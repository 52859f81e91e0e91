"""The agreement campaign: our verdicts against Drake's, on pairs that are feasible and on their infeasible twins.

Drake chooses the frame of a pair its own way. Where ours is another one of equal cost, naming the two bodies the other way round makes ours
Drake's, and the programs the same; what remains is said in the verdict. Every answer of ours is checked from the bytes of its proof.
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
from certifier.frames import choose_frame
from certifier.kinematics import Kinematics
from certifier.model import Pair, Scene
from certifier.outcome import Outcome
from certifier.pair import Certification, certify_pair
from certifier.reference import Reference
from certifier.verify.pair import PairCheck

BOXES, ROUND = 45, 25
"""Random arms with boxes alone, and with balls and capsules among them."""
SCALES = (0.05, 0.15, 0.3, 0.6, 1.0)
"""Sizes of the nested polytopes around a random arm; the last reaches to the joint limits."""


@dataclass(frozen=True)
class Question:
    """A scene of one pair, and a polytope."""

    name: str
    group: str
    scene: Scene
    region: Region


def questions(boxes: int = BOXES, rounded: int = ROUND) -> Iterator[Question]:
    """The whole campaign: arms of either kind, each at all scales."""
    yield from _questions("boxes", boxes, rounded=False)
    yield from _questions("round", rounded, rounded=True)


def _questions(group: str, count: int, rounded: bool) -> Iterator[Question]:
    """Arms of 2 to 4 joints with the first pair that is certified at the smallest scale and not at the largest: each has its twin."""
    made = seed = 0
    while made < count:
        rng = np.random.default_rng([seed, rounded])
        arm = random_arm(rng, 2 + seed % 3, rounded)
        center = rng.uniform(-0.3, 0.3, arm.n)
        C, d = random_faces(rng, center, 1.0)
        nested = [Region(C, C @ center + scale * (d - C @ center), center) for scale in SCALES]
        for pair in (arm.pairs[i] for i in rng.permutation(len(arm.pairs))):
            scene = replace(arm, pairs=(pair,))
            smallest, largest = (certify_pair(scene, 0, scene.polytope(r.C, r.d), center).outcome for r in (nested[0], nested[-1]))
            if smallest is Outcome.CERTIFIED and largest is not Outcome.CERTIFIED:
                yield from (Question(f"{group} {seed} x {s}", group, scene, r) for s, r in zip(SCALES, nested, strict=True))
                made += 1
                break
        seed += 1


def campaign(questions: Iterable[Question], progress: Progress) -> dict[str, Any]:
    """Ask both sides everything; the document of ``ciris bench agreement``.

    Raises:
        ProofError: a proof of ours does not hold.
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
    certification = Certification(scene, scene.polytope(region.C, region.d), region.center)
    ours = certification.certify(0)
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
        "evidence": measure.verify(scene, ours, PairCheck(scene, certification.ground)) or "none",
    }


def _in_frame(scene: Scene, frame: str) -> tuple[Scene, str]:
    """The scene of one pair, its bodies named in the order in which our frame is this one, if there is such an order; and our frame."""
    (pair,) = scene.pairs
    for order in (pair, Pair(pair.b, pair.a)):
        ours = choose_frame(Kinematics(scene), order).body
        if ours == frame:
            return replace(scene, pairs=(order,)), ours
    return scene, choose_frame(Kinematics(scene), pair).body
