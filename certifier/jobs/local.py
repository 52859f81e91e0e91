"""Jobs carried out in this process, without the service: the state machine of certifier.growth.machine driven by plain calls."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from certifier.errors import CirisError
from certifier.growth.actions import Accepted, Certification, Certify, Failed, Finish, Propose, Report, Step
from certifier.growth.machine import advance, begin
from certifier.growth.options import GrowthOptions
from certifier.jobs.region import Region, certified_region, versions
from certifier.jobs.reports import stepped, weakness
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Guarantee, Outcome, combine
from certifier.pair.certification import Certification as PairCertification
from certifier.pair.result import PairResult
from certifier.polytopes.ellipsoid import inscribed_ellipsoid
from certifier.seeding.options import SeedOptions
from certifier.seeding.propose import propose
from certifier.step.step import step

Progress = Callable[[str], None]


@dataclass
class _Run:
    """Results of a job so far: iteration -> pair index -> result, the seconds of the seeding, and the last accepted region's data."""

    scene: Scene
    seed: int
    progress: Progress
    results: dict[int, dict[int, PairResult]] = field(default_factory=dict)
    seeding_seconds: float = 0.0
    accepted: Accepted | None = None

    def certify(self, action: Certify) -> Certification:
        center = None if action.center is None else np.array(action.center)
        shared = PairCertification(self.scene, Polytope(np.array(action.C), np.array(action.d)), center, self.seed)
        found = self.results.setdefault(action.iteration, {})
        failures = 0
        for index in action.pairs:
            found[index] = shared.certify(index, every_face=index in action.hard)
            pair = self.scene.pairs[index]
            self.progress(
                f"{action.label} {action.iteration}: {len(found)}/{len(action.pairs)} {pair.a} - {pair.b}: {found[index].outcome}"
            )
            failures += found[index].outcome is not Outcome.CERTIFIED
            if failures == action.failures:
                break
        return Certification(
            action.iteration, {i: r.outcome for i, r in found.items()}, {i: w for i, r in found.items() if (w := weakness(r))}
        )

    def proofs(self, accepted: Accepted) -> dict[int, bytes]:
        return {index: self.results[iteration][index].proof or b"" for index, iteration in accepted.proofs.items()}

    def carry_out(self, action: Propose | Certify | Step) -> Report:
        if isinstance(action, Certify):
            return self.certify(action)
        if isinstance(action, Propose):
            self.progress("seeding")
            found = propose(self.scene, SeedOptions.from_document(action.seed))
            self.seeding_seconds = found.info["seconds"]
            return found
        assert self.accepted is not None, "a step follows an accepted region"
        self.progress("polytope step")
        polytope, witnesses = Polytope(np.array(action.C), np.array(action.d)), np.array(action.contain)
        return stepped(step(self.scene, polytope, self.proofs(self.accepted), witnesses=witnesses))


def grow(scene: Scene, options: GrowthOptions, progress: Progress = lambda _: None) -> Region:
    """Grow a certified region in this process.

    Raises:
        CirisError: no region could be certified; code ``not_grown``, or the error of the seeding.
    """
    start = time.perf_counter()
    run = _Run(scene, options.random_seed, progress)
    transition = begin(scene, options)
    curve: list[dict[str, Any]] = []
    while not isinstance(transition.action, Finish):
        failure: CirisError | None = None
        try:
            report = run.carry_out(transition.action)
        except CirisError as error:
            failure, report = error, Failed(error.to_document())
        transition = advance(scene, transition.state, report)
        if failure and run.accepted is None:
            raise failure
        if transition.accepted:
            run.accepted = transition.accepted
            seconds = time.perf_counter() - start
            volume = inscribed_ellipsoid(Polytope(np.array(run.accepted.C), np.array(run.accepted.d))).volume
            curve.append({"iteration": run.accepted.iteration, "seconds": seconds, "ellipsoid": volume})
    if run.accepted is None:
        raise CirisError("not_grown", transition.action.reason, hint="try another seed, or look at the pair named")
    provenance = {
        "options": options.to_document(),
        "versions": versions(scene),
        "reason": transition.action.reason,
        "growth_curve": curve,
        "seeding_seconds": run.seeding_seconds,
        "pair_seconds": sum(result.seconds for found in run.results.values() for result in found.values()),
        "seconds": time.perf_counter() - start,
    }
    accepted = run.accepted
    return certified_region(scene, accepted, run.proofs(accepted), provenance)


def certify(scene: Scene, C: Array, d: Array, center: Array | None = None, progress: Progress = lambda _: None) -> dict[str, Any]:
    """Certify every pair on {C s <= d} and the joint limits; the document of ``ciris certify --json``.

    Raises:
        RegionError: the polytope is malformed, empty or unbounded.
    """
    start = time.perf_counter()
    options = GrowthOptions(kind="certify", seed={"C": C.tolist(), "d": d.tolist(), "center": None if center is None else center.tolist()})
    action = begin(scene, options).action
    assert isinstance(action, Certify)
    run = _Run(scene, options.random_seed, progress)
    run.certify(action)
    return document(scene, run.results[action.iteration], Guarantee.EXACT, time.perf_counter() - start)


def document(scene: Scene, results: dict[int, PairResult], guarantee: Guarantee, seconds: float) -> dict[str, Any]:
    """The results of all pairs with stable keys; ``guarantee`` is what it is worth that every pair is certified."""
    outcome = combine([result.outcome for result in results.values()])
    return {
        "scene": {"name": scene.name, "hash": scene.hash},
        "outcome": outcome.value,
        "guarantee": (guarantee if outcome is Outcome.CERTIFIED else Guarantee.NONE).value,
        "seconds": seconds,
        "pairs": [pair_document(scene, index, results[index]) for index in sorted(results)],
    }


def pair_document(scene: Scene, index: int, result: PairResult) -> dict[str, Any]:
    """One pair's outcome with stable keys."""
    pair = scene.pairs[index]
    return {
        "a": pair.a,
        "b": pair.b,
        "outcome": result.outcome.value,
        "margin": result.margin,
        "seconds": result.seconds,
        "stage": result.stage,
        "witness_q": None if result.witness_s is None else scene.to_q(result.witness_s).tolist(),
        "detail": result.detail,
    }
