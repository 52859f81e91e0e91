"""Jobs are carried out in this process, without the service: plain calls drive the state machine of certifier.growth.machine."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from certifier.errors import CirisError
from certifier.growth.actions import Candidate, Certify, Failed, Finish, Outcomes, Propose, Report, Step, Transition
from certifier.growth.machine import advance, begin
from certifier.growth.options import GrowthOptions
from certifier.growth.pairs import alike
from certifier.growth.refusal import DEADLINE, at_deadline, ended_by, refusal
from certifier.growth.state import Start
from certifier.jobs.former import Former
from certifier.jobs.pairs import part_certifier
from certifier.jobs.parallel import side_by_side
from certifier.jobs.region import REST, Region, certified_region, growth_point, versions
from certifier.jobs.share import SampledProposal
from certifier.jobs.verdict import Verdict
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Guarantee, Outcome, combine
from certifier.pair.result import PairResult
from certifier.proof.region import RegionProof
from certifier.proof.separation import digest
from certifier.seeding.options import SeedOptions
from certifier.seeding.propose import propose
from certifier.step.step import step

Tell = Callable[[str, dict[str, Any]], None]
"""Hears of what happens, as the events of the service say it (docs/architecture.md): their kind and their data."""
Deliver = Callable[[Region], None]
"""Takes a region that has been verified, while a larger one may still come."""


def _silent(kind: str, data: dict[str, Any]) -> None:
    """Hears nothing."""


@dataclass
class _Run:
    """Holds the progress of a job.

    Attributes:
        results: iteration -> pair index -> results of its parts.
        seeding_seconds: how long the seeding took.
        candidate: the last accepted candidate; None before there is one.
        made: the candidate that a region was made of last; None before there is one.
        rests_until: no region but the last one is made before this many seconds of the job.
        proposal: what the region is grown from; None before there is a candidate.
        curve: the growth curve of the manifest.
        former: the region that is certified again; None where one is grown.
        cuts: of the last stage, as :class:`certifier.growth.state.Whole` has them.
        start: when the job began.
    """

    scene: Scene
    seed: int
    tell: Tell
    processes: int = 1
    deadline_s: float | None = None
    start: float = field(default_factory=lambda: time.perf_counter())
    results: dict[int, dict[int, list[PairResult]]] = field(default_factory=dict)
    seeding_seconds: float = 0.0
    candidate: Candidate | None = None
    made: Candidate | None = None
    rests_until: float = 0.0
    proposal: SampledProposal | None = None
    curve: list[dict[str, Any]] = field(default_factory=list)
    former: Former | None = None
    cuts: dict[int, int] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """Returns for how long the job has run."""
        return time.perf_counter() - self.start

    @property
    def passed(self) -> float:
        """Returns the share of the time until the deadline that has passed; 0 without one."""
        if self.deadline_s is None:
            return 0.0
        return self.seconds / self.deadline_s if self.deadline_s > 0 else math.inf

    def accept(self, candidate: Candidate, start: Start) -> None:
        self.proposal = self.proposal or SampledProposal.of(self.scene, start.rows)
        kept = self.proposal.share(candidate.polytope)
        self.curve.append(growth_point(candidate.iteration, self.seconds, candidate.ellipsoid_volume, kept["value"]))
        self.candidate = candidate

    @property
    def has_news(self) -> bool:
        """Returns whether there is a candidate that no region was made of, and it is time to make one."""
        return self.candidate is not self.made and self.seconds >= self.rests_until

    def make_region(self, options: GrowthOptions, reason: str) -> Region:
        """Makes a region of the last candidate, which verifies its proof, and tells of it."""
        assert self.candidate is not None, "a region is made of a certified polytope"
        begun = self.seconds
        provenance, proofs = self.provenance(options, reason), self.proofs(self.candidate)
        self.tell("step", {"kind": "accept", "state": "running", "seconds": None})
        region = certified_region(self.scene, self.candidate, proofs, provenance, self.proposal, self.processes, self._tell_verified)
        taken = self.seconds - begun
        self.tell("step", {"kind": "accept", "state": "done", "seconds": taken})
        said = {name: region.manifest[name] for name in ("q_volume", "share")}
        self.tell("region", {"iteration": self.candidate.iteration, "ellipsoid_volume": self.candidate.ellipsoid_volume, **said})
        self.made, self.rests_until = self.candidate, self.seconds + REST * taken
        return region

    def _tell_note(self, text: str, part: float | None = None) -> None:
        self.tell("note", {"text": text, "part": part})

    def _tell_verified(self, done: int, total: int) -> None:
        self._tell_note(f"verifying the region: {done} of {total} cells and proofs", done / total)

    def certify(self, action: Certify) -> Outcomes:
        certify = part_certifier(self.scene, action, self.seed, self.left, None if self.former is None else self.former.carried)
        found = self.results.setdefault(action.iteration, {})
        failures, work = 0, action.work
        said = {"index": action.iteration, "label": action.label, "pairs": len(action.pairs), "parts": len(work)}
        self.tell("iteration", {**said, "state": "running"})
        # The program (11) of a pair takes milliseconds, so children would not pay.
        results = side_by_side(certify, work, 1 if action.cells == 1 else self.processes, lambda index: alike(self.scene, index))
        for (index, _), result in zip(work, results, strict=False):
            found.setdefault(index, []).append(result)
            stage = None if result.stage is None else result.stage.value
            settled = {"index": index, "state": result.outcome.value, "stage": stage, "seconds": result.seconds}
            self.tell("pairs", {"iteration": action.iteration, "pairs": [settled]})
            failures += result.outcome is not Outcome.CERTIFIED
            if failures == action.failures:
                break
        outcomes = [result.outcome for parts in found.values() for result in parts]
        self.tell("iteration", {**said, "state": combine(outcomes).value})
        reached = [(index, r.outcome, r.weakness, r.open_cells) for index, parts in found.items() for r in parts]
        # Nobody asks for these again, and they would be most of what a long growth holds.
        self.results[action.iteration] = {
            index: [replace(result, weakness=None, outline=None) for result in parts] for index, parts in found.items()
        }
        return Outcomes.of_parts(action, reached, self.passed)

    def left(self, iteration: int, index: int) -> list[bytes]:
        return [result.subtrees for result in self.results[iteration][index] if result.subtrees is not None]

    def proofs(self, candidate: Candidate) -> dict[int, bytes]:
        return {index: self.results[iteration][index][0].proof or b"" for index, iteration in candidate.proofs.items()}

    def provenance(self, options: GrowthOptions, reason: str) -> dict[str, Any]:
        """Returns what the manifest says of how a region came about."""
        assert self.candidate is not None, "a region is made of a certified polytope"
        said = {}
        if self.former is not None and self.proposal is not None:
            said["recertified"] = self.former.document(self.scene, self.cuts, self.proposal, self.candidate.polytope)
        return {
            "options": options.to_document(),
            "versions": versions(self.scene),
            "reason": reason,
            **said,
            "growth_curve": self.curve,
            "seeding_seconds": self.seeding_seconds,
            "pair_seconds": sum(result.seconds for found in self.results.values() for parts in found.values() for result in parts),
            "seconds": self.seconds,
        }

    def carry_out(self, action: Propose | Certify | Step) -> Report:
        if isinstance(action, Certify):
            return self.certify(action)
        if isinstance(action, Propose):
            self.tell("step", {"kind": "propose", "state": "running", "seconds": None})
            found = propose(self.scene, SeedOptions.from_document(action.seed))
            self.seeding_seconds = found.info["seconds"]
            self.tell("step", {"kind": "propose", "state": "done", "seconds": self.seeding_seconds})
            return found
        assert self.candidate is not None, "a step follows an accepted region"
        return step(self.scene, action.polytope, self.proofs(self.candidate), action.contain, self._tell_note)


def grow(
    scene: Scene,
    options: GrowthOptions,
    tell: Tell = _silent,
    deadline_s: float | None = None,
    processes: int = 1,
    deliver: Deliver | None = None,
) -> Region:
    """Grows a certified region in this process, or with ``processes`` children of it; the region is the same.

    Args:
        tell: receives reports of what happens.
        deadline_s: after this many seconds growth ends with the best region so far, as soon as the action under way is carried out; None
            for no deadline.
        deliver: receives regions before the last one, which is returned. It does not get all of them: verifying their proofs takes at most
            a fifth of the time (``REST``). None for the last one alone.

    Raises:
        CirisError: no region could be certified; the code is ``not_grown`` or that of the seeding's error.
    """
    return _carried_out(_Run(scene, options.random_seed, tell, processes, deadline_s), options, deliver)


def recertify(
    scene: Scene,
    data: bytes,
    keep: Sequence[Sequence[float]] | None = None,
    tell: Tell = _silent,
    deadline_s: float | None = None,
    processes: int = 1,
    random_seed: int = 0,
) -> Region:
    """Makes a region of a scene from one of the scene before it changed, in this process or with ``processes`` children of it.

    Args:
        data: the proof file of the region before.
        keep: joint positions that have to stay inside, the first of them well inside; None for the point inside that the proof names.
        tell, deadline_s, processes: as for :func:`grow`.

    Raises:
        ProofError: the file is no region's proof, or one that does not hold.
        SceneError: ``other_robot``.
        CirisError: ``revoked``, when nothing is left of the region; ``not_grown``, when time was too short.
    """
    start = time.perf_counter()
    old = RegionProof.from_bytes(data)
    former = Former.of(old, digest(data), scene)
    seed = {"C": old.C.tolist(), "d": old.d.tolist(), "q": keep or [scene.to_q(old.interior).tolist()]}
    options = GrowthOptions.from_document({"kind": "recertify", "seed": seed, "random_seed": random_seed})
    return _carried_out(_Run(scene, options.random_seed, tell, processes, deadline_s, start, former=former), options)


def _carried_out(run: _Run, options: GrowthOptions, deliver: Deliver | None = None) -> Region:
    """Carries out what the growth asks for until it ends, and returns the region."""
    scene = run.scene
    transition, late = begin(scene, options), False
    while not isinstance(transition.action, Finish):
        failure: CirisError | None = None
        try:
            report = run.carry_out(transition.action)
        except CirisError as error:
            failure = error if transition.state.start is None else ended_by(error, transition.state.start.hindrance)
            report = Failed(failure)
        transition = advance(scene, transition.state, report)
        if failure and run.candidate is None:
            raise failure
        if transition.candidate:
            assert transition.state.start is not None, "what is grown comes from a proposal"
            run.accept(transition.candidate, transition.state.start)
        run.cuts = run.cuts if transition.state.whole is None else transition.state.whole.cuts
        late = run.passed >= 1
        if late and not isinstance(transition.action, Finish):
            start = transition.state.start
            end = Finish(Outcome.CERTIFIED, DEADLINE)
            if run.candidate is None:
                end = Finish(Outcome.INCONCLUSIVE, at_deadline("" if start is None else start.hindrance))
            transition = Transition(transition.state, end)
        if deliver is not None and run.has_news and not isinstance(transition.action, Finish):
            deliver(run.make_region(options, "growing"))
    if run.candidate is None:
        raise refusal(transition.action.reason, late)
    return run.make_region(options, transition.action.reason)


def certify(
    scene: Scene,
    polytope: Polytope,
    center: Array | None = None,
    tell: Tell = _silent,
    cells: int = 1,
    processes: int = 1,
    assemble: bool = False,
    random_seed: int = 0,
) -> Verdict:
    """Certifies every pair on a polytope and the joint limits.

    Args:
        cells, random_seed: as in :class:`certifier.growth.options.CertifyOptions`.
        processes: as for :func:`grow`.
        assemble: make a region of a polytope that is certified, with its proof.

    Raises:
        RegionError: the polytope is malformed, empty or unbounded, or ``cells`` is out of range.
    """
    start = time.perf_counter()
    seed = {"C": polytope.C.tolist(), "d": polytope.d.tolist(), "center": None if center is None else center.tolist()}
    options = GrowthOptions.from_document({"kind": "certify", "seed": seed, "cells": cells, "random_seed": random_seed})
    first = begin(scene, options)
    action = first.action
    assert isinstance(action, Certify)
    run = _Run(scene, options.random_seed, tell, processes)
    report = run.certify(action)
    results = {index: result for index, (result,) in run.results[action.iteration].items()}
    run.candidate = advance(scene, first.state, report).candidate if assemble else None
    region = None if run.candidate is None else run.make_region(options, "certified")
    return Verdict(results, Guarantee.EXACT, time.perf_counter() - start, region)
