"""The agreement campaign: our verdicts against Drake's, on pairs that are feasible and on their infeasible twins.

Drake chooses the frame of a pair its own way. Where ours is another one of equal cost, naming the two bodies the other way round makes ours
Drake's, and the two programs the same; what remains is said in the verdict. Every answer of ours is checked by other hands: a proof by
the exact verifier, from its bytes; a collision by Drake's distance query.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks import catalogue, machine
from benchmarks.arms import random_arm, random_faces
from benchmarks.catalogue import Region
from benchmarks.measure import Progress
from benchmarks.verdicts import Verdict, verdict
from certifier.disproof import DualProof
from certifier.drake_model import build_diagram, geometry_name
from certifier.frames import choose_frame
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Scene
from certifier.outcome import Outcome
from certifier.pair import PairResult, certify_pair
from certifier.proof import PairProof
from certifier.reference import Reference
from certifier.verify.dual import verify_dual
from certifier.verify.pair import verify_pair

BOXES, ROUND = 45, 25
"""Random arms with boxes alone, and with balls and capsules among them."""
SCALES = (0.05, 0.15, 0.3, 0.6, 1.0)
"""Sizes of the nested polytopes around a random arm; the last reaches to the joint limits."""
LONGEST_CHAIN = 3
"""Catalogue instances with a longer chain on either side are left out: Drake takes minutes for each."""


@dataclass(frozen=True)
class Question:
    """A scene of one pair, and a polytope."""

    name: str
    group: str
    scene: Scene
    region: Region


def questions() -> Iterator[Question]:
    """The whole campaign: random arms of either kind at all scales, then the catalogue."""
    yield from random_questions("boxes", BOXES, rounded=False)
    yield from random_questions("round", ROUND, rounded=True)
    for instance in catalogue.instances().values():
        scene = instance.scene
        frame = choose_frame(Kinematics(scene), instance.pair)
        if max(len(frame.chain_a), len(frame.chain_b)) <= LONGEST_CHAIN:
            yield Question(instance.name, "catalogue", scene, instance.region)


def random_questions(group: str, count: int, rounded: bool) -> Iterator[Question]:
    """Arms of 2 to 5 joints with the first pair that is not certified on the largest polytope: each has its infeasible twin."""
    made = seed = 0
    while made < count:
        rng = np.random.default_rng([seed, rounded])
        seed += 1
        arm = random_arm(rng, 2 + seed % 4, rounded)
        center = rng.uniform(-0.3, 0.3, arm.n)
        C, d = random_faces(rng, center, 1.0)
        nested = [Region(C, C @ center + scale * (d - C @ center), center) for scale in SCALES]
        for pair in (arm.pairs[i] for i in rng.permutation(len(arm.pairs))):
            scene = replace(arm, pairs=(pair,))
            if _certify(scene, nested[0]).outcome is Outcome.CERTIFIED and _certify(scene, nested[-1]).outcome is not Outcome.CERTIFIED:
                yield from (Question(f"{group} {seed - 1} x {s}", group, scene, r) for s, r in zip(SCALES, nested, strict=True))
                made += 1
                break


def campaign(questions: Iterable[Question], progress: Progress) -> dict[str, Any]:
    """Ask both sides everything; the document of ``ciris bench agreement``."""
    findings = []
    for question in questions:
        findings.append(finding := _ask(question))
        progress(f"{len(findings)} {question.name}: {finding['ciris']}, Drake {finding['drake']}: {finding['verdict']}")
    counts = Counter((f["group"], f["ciris"], f["drake"], f["verdict"]) for f in findings)
    return {
        "benchmark": "agreement",
        "machine": machine.describe(),
        "instances": len(findings),
        "same_program": sum(f["same_program"] for f in findings),
        "counts": [{"group": g, "ciris": c, "drake": d, "verdict": v, "instances": n} for (g, c, d, v), n in sorted(counts.items())],
        "evidence": dict(Counter(f["evidence"] for f in findings)),
        "disagreements": [f for f in findings if f["verdict"] != Verdict.AGREE],
        "contradictions": sum(f["verdict"] == Verdict.CONTRADICTION for f in findings),
    }


def _ask(question: Question) -> dict[str, Any]:
    region = question.region
    theirs = Reference(question.scene).certify(0, region.C, region.d)
    scene, frame = _in_frame(question.scene, theirs.frame)
    ours = _certify(scene, region)
    same_program = frame == theirs.frame and not any(scene.geometry(name).radius for name in vars(scene.pairs[0]).values())
    return {
        "name": question.name,
        "group": question.group,
        "ciris": ours.outcome.value,
        "detail": ours.detail,
        "drake": theirs.outcome.value,
        "status": theirs.status,
        "frames": [frame, theirs.frame],
        "same_program": same_program,
        "verdict": verdict(ours.outcome, theirs.outcome, same_program).value,
        "evidence": _evidence(scene, ours),
    }


def _certify(scene: Scene, region: Region) -> PairResult:
    return certify_pair(scene, 0, scene.polytope(region.C, region.d), region.center)


def _in_frame(scene: Scene, frame: str) -> tuple[Scene, str]:
    """The scene of one pair, its bodies named in the order in which our frame is this one, if there is such an order; and our frame."""
    (pair,) = scene.pairs
    for order in (pair, Pair(pair.b, pair.a)):
        ours = choose_frame(Kinematics(scene), order).body
        if ours == frame:
            return replace(scene, pairs=(order,)), ours
    return scene, choose_frame(Kinematics(scene), pair).body


def _evidence(scene: Scene, result: PairResult) -> str:
    """What besides the solver speaks for our answer.

    Raises:
        ProofError: the proof does not hold.
        AssertionError: Drake sees no collision at the configuration that refutes the pair.
    """
    if result.outcome is Outcome.CERTIFIED and result.proof:
        verify_pair(PairProof.from_bytes(result.proof, scene))
        return "proof verified exactly"
    if result.outcome is Outcome.NOT_CERTIFIABLE and result.proof:
        verify_dual(DualProof.from_bytes(result.proof, scene))
        return "dual proof verified"
    if result.witness_s is not None:
        distance = _distance(scene, scene.to_q(result.witness_s))
        assert distance <= 1e-6, f"Drake finds the bodies {distance} m apart where they are said to touch"
        return "collision confirmed by Drake"
    return "none"


def _distance(scene: Scene, q: Array) -> float:
    """Drake's signed distance of the scene's only pair at q, metres."""
    diagram = build_diagram(scene)
    context = diagram.CreateDefaultContext()
    diagram.plant().SetPositions(diagram.mutable_plant_context(context), q)
    query = diagram.scene_graph().get_query_output_port().Eval(diagram.mutable_scene_graph_context(context))
    ids = {geometry_name(query.inspector(), g): g for g in query.inspector().GetAllGeometryIds()}
    (pair,) = scene.pairs
    return float(query.ComputeSignedDistancePairClosestPoints(ids[pair.a], ids[pair.b]).distance)
