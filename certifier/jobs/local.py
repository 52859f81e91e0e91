"""Jobs are carried out in this process, without the service: their store is its memory."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import Any

from certifier import stored
from certifier.errors import CirisError
from certifier.growth.actions import Action, Candidate, Certify, Failed, Finish, Outcomes, Propose, Report, Step, Transition
from certifier.growth.machine import NEARBY
from certifier.growth.options import GrowthOptions
from certifier.growth.pairs import alike
from certifier.growth.state import GrowthState
from certifier.isolation.child import run_in_child
from certifier.jobs.driver import drive
from certifier.jobs.former import Former
from certifier.jobs.growing import REST, Account, Certified, decided, failure, late, make_region, proposing, refused
from certifier.jobs.pairs import part_certifier
from certifier.jobs.parallel import side_by_side
from certifier.jobs.region import Region
from certifier.jobs.share import SampledProposal
from certifier.jobs.verdict import Verdict
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Guarantee, Outcome, combine
from certifier.pair.result import PairResult
from certifier.proof.region import RegionProof
from certifier.proof.separation import digest
from certifier.seeding import PROPOSE
from certifier.seeding.proposal import Proposal
from certifier.step.step import step

Tell = Callable[[str, dict[str, Any]], None]
"""Hears of what happens, as the events of the service say it (docs/architecture.md): their kind and their data."""
Deliver = Callable[[Region], None]
"""Takes a region that has been verified, while a larger one may still come."""

LONGEST_S, MEMORY_BYTES = 7 * 86400.0, 2**36
"""A proposal is given up after this time without a deadline, or when it needs more memory."""


def _silent(kind: str, data: dict[str, Any]) -> None:
    """Hears nothing."""


@dataclass(frozen=True)
class _Turn:
    """Holds the report on the present action; None before the first one."""

    report: Report | None


@dataclass
class _Memory:
    """Holds a job in memory: a store of :mod:`certifier.jobs.driver`.

    Attributes:
        former: the region that is certified again; None where one is grown.
        deliver: takes regions before the last one; None for the last one alone.
        start: when the job began.
        state, action: after the last decision; None before the first.
        error: what went wrong, if something did.
        results: iteration -> pair index -> results of its parts.
        seeding_seconds: how long the seeding took.
        certified: the polytopes that were certified, in order.
        candidate: the last certified polytope; None before there is one.
        made: the candidate that a region was made of last; None before there is one.
        last: this region.
        rests_until: no region but the last one is made before this many seconds of the job.
        proposal: what regions are grown from; None before one is made of it.
        told: what the child process that makes the proposal has told last.
    """

    scene: Scene
    options: GrowthOptions
    tell: Tell
    processes: int = 1
    deadline_s: float | None = None
    former: Former | None = None
    deliver: Deliver | None = None
    propose: Callable[[Propose], Proposal] | None = None
    start: float = field(default_factory=lambda: time.perf_counter())
    state: GrowthState | None = None
    action: Action | None = None
    error: CirisError | None = None
    results: dict[int, dict[int, list[PairResult]]] = field(default_factory=dict)
    seeding_seconds: float = 0.0
    certified: list[Certified] = field(default_factory=list)
    candidate: Candidate | None = None
    made: Candidate | None = None
    last: Region | None = None
    rests_until: float = 0.0
    proposal: SampledProposal | None = None
    told: dict[str, Any] = field(default_factory=dict)

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

    @property
    def finish(self) -> Finish:
        """Returns the end of the job."""
        assert isinstance(self.action, Finish), "the job has ended"
        return self.action

    def turn(self) -> _Turn | None:
        """Carries out the present action."""
        if isinstance(self.action, Finish):
            return None
        return _Turn(None if self.action is None else self._carry_out(self.action))

    def decide(self, turn: _Turn) -> Transition:
        if isinstance(turn.report, Failed):
            self.error = failure(self.state, turn.report) or self.error
        return decided(self.scene, self.options, self.state, turn.report)

    def save(self, turn: _Turn, decision: Transition | CirisError) -> bool:
        if isinstance(decision, CirisError):
            raise decision
        self.state, self.action = decision.state, decision.action
        if decision.candidate is not None:
            self._accept(decision.candidate)
        out_of_time = isinstance(turn.report, Failed) and turn.report.error.code == "child_timeout"
        if isinstance(self.action, Finish) and not out_of_time:
            return False
        if self.passed >= 1 or out_of_time:
            self.action = late(self.scene, self.state, self.candidate is not None, self.told)
            return False
        if self.deliver is not None and self.candidate is not self.made and self.seconds >= self.rests_until:
            self.deliver(self.region())
        return True

    def _accept(self, candidate: Candidate) -> None:
        self.certified.append(Certified(candidate.iteration, candidate.polytope, candidate.ellipsoid_volume, self.seconds))
        self.candidate = candidate

    def region(self) -> Region:
        """Makes a region of the last candidate, which verifies its proof, and tells of it."""
        assert self.candidate is not None, "a region is made of a certified polytope"
        assert self.state is not None
        begun = self.seconds
        if self.proposal is None and self.state.start is not None:
            self.proposal = SampledProposal.of(self.scene, self.state.start.rows)
        spent = sum(result.seconds for found in self.results.values() for parts in found.values() for result in parts)
        account = Account(self.certified, self.seeding_seconds, spent, self.seconds)
        self.tell("step", {"kind": "accept", "state": "running", "seconds": None})
        proofs = self.proofs(self.candidate)
        region = make_region(
            self.scene,
            self.state,
            self.candidate,
            proofs,
            account,
            self.proposal,
            self.former,
            self.processes,
            self._tell_verified,
            self.last,
        )
        taken = self.seconds - begun
        self.tell("step", {"kind": "accept", "state": "done", "seconds": taken})
        self.tell("region", {"iteration": self.candidate.iteration, "ellipsoid_volume": self.candidate.ellipsoid_volume, **region.summary})
        self.made, self.last, self.rests_until = self.candidate, region, self.seconds + REST * taken
        return region

    def _tell_note(self, text: str, part: float | None = None) -> None:
        self.tell("note", {"text": text, "part": part})

    def _tell_verified(self, done: int, total: int) -> None:
        self._tell_note(f"verifying the region: {done} of {total} cells and proofs", done / total)

    def _carry_out(self, action: Propose | Certify | Step) -> Report:
        try:
            if isinstance(action, Certify):
                return self._certify(action)
            if isinstance(action, Propose):
                self.tell("step", {"kind": "propose", "state": "running", "seconds": None})
                found = (self.propose or self._proposed)(action)
                self.seeding_seconds = found.info["seconds"]
                self.tell("step", {"kind": "propose", "state": "done", "seconds": self.seeding_seconds})
                return found
            assert self.candidate is not None, "a step follows a certified polytope"
            return step(self.scene, action.polytope, self.proofs(self.candidate), action.contain, self._tell_note)
        except CirisError as error:
            return Failed(error)

    def _proposed(self, action: Propose) -> Proposal:
        """Makes a proposal in a child process, which ends with the deadline: Drake's IRIS does not hear of it, nor of interrupts."""
        left = LONGEST_S if self.deadline_s is None else max(self.deadline_s - self.seconds, 0.0)
        payload, begun = {"scene": self.scene.to_document(), "seed": action.seed}, self.seconds

        def tell(told: dict[str, Any]) -> None:
            self.told = told
            self._tell_note(proposing(self.seconds - begun, told))

        try:
            return stored.value(Proposal, run_in_child(PROPOSE, payload, timeout_s=left, memory_bytes=MEMORY_BYTES, tell=tell))
        except CirisError as error:
            if error.code != "child_timeout":
                raise
            raise self._ended(error) from None

    def _ended(self, error: CirisError) -> CirisError:
        """Returns why growth ends where its time has run out: the reason if there is no region yet, the error otherwise."""
        return refused(late(self.scene, self.state, self.candidate is not None, self.told), None) or error

    def _certify(self, action: Certify) -> Outcomes:
        carried = None if self.former is None else self.former.carried
        certify = part_certifier(self.scene, action, self.options.random_seed, self._left, carried)
        found = self.results.setdefault(action.iteration, {})
        failures, work = 0, action.work
        said = {"index": action.iteration, "label": action.label, "pairs": len(action.pairs), "parts": len(work)}
        self.tell("iteration", {**said, "state": "running"})
        # The program (11) of a pair takes milliseconds, so children would not pay.
        processes = 1 if action.cells == 1 else self.processes
        # An interrupt that comes while children end would be lost if the results were only dropped.
        with closing(side_by_side(certify, work, processes, lambda index: alike(self.scene, index))) as results:
            for (index, _), result in zip(work, results, strict=False):
                found.setdefault(index, []).append(result)
                stage = None if result.stage is None else result.stage.value
                settled = {"index": index, "state": result.outcome.value, "stage": stage, "seconds": result.seconds}
                self.tell("pairs", {"iteration": action.iteration, "pairs": [settled]})
                failures += result.outcome is not Outcome.CERTIFIED
                if failures == action.failures:
                    break
                if self.passed >= 1 and action.label != NEARBY:
                    raise self._ended(CirisError("child_timeout", "the deadline was reached", field="deadline", hint="give it more time"))
        outcomes = [result.outcome for parts in found.values() for result in parts]
        self.tell("iteration", {**said, "state": combine(outcomes).value})
        reached = [(index, r.outcome, r.weakness, r.open_cells) for index, parts in found.items() for r in parts]
        # Nobody asks for these again, and they would be most of what a long growth holds.
        self.results[action.iteration] = {
            index: [replace(result, weakness=None, outline=None) for result in parts] for index, parts in found.items()
        }
        return Outcomes.of_parts(action, reached, self.passed)

    def _left(self, iteration: int, index: int) -> list[bytes]:
        return [result.subtrees for result in self.results[iteration][index] if result.subtrees is not None]

    def proofs(self, candidate: Candidate) -> dict[int, bytes]:
        return {index: self.results[iteration][index][0].proof or b"" for index, iteration in candidate.proofs.items()}


def grow(
    scene: Scene,
    options: GrowthOptions,
    tell: Tell = _silent,
    deadline_s: float | None = None,
    processes: int = 1,
    deliver: Deliver | None = None,
    propose: Callable[[Propose], Proposal] | None = None,
) -> Region:
    """Grows a certified region in this process, or with ``processes`` children of it; the region is the same.

    Args:
        tell: receives reports of what happens.
        deadline_s: after this many seconds growth ends with the best region so far, as soon as the pairs that are being certified are
            done; None for no deadline. The box about the seed is certified in any case.
        deliver: receives regions before the last one, which is returned. It does not get all of them: verifying their proofs takes at most
            a fifth of the time (``REST``). None for the last one alone.

    Raises:
        CirisError: no region could be certified; the code is ``not_grown`` or that of the seeding's error.
    """
    return _grown(_Memory(scene, options, tell, processes, deadline_s, deliver=deliver, propose=propose))


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
    return _grown(_Memory(scene, options, tell, processes, deadline_s, former, start=start))


def _grown(job: _Memory) -> Region:
    """Drives a growth to its end, and returns its last region."""
    drive(job)
    if error := refused(job.finish, job.error):
        raise error
    return replace(job.region(), reason=job.finish.reason)


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
    seed = {"C": polytope.C.tolist(), "d": polytope.d.tolist(), "center": None if center is None else center.tolist()}
    options = GrowthOptions.from_document({"kind": "certify", "seed": seed, "cells": cells, "random_seed": random_seed})
    job = _Memory(scene, options, tell, processes)
    drive(job)
    if job.error is not None:
        raise job.error
    (found,) = job.results.values()
    results = {index: result for index, (result,) in found.items()}
    region = job.region() if assemble and job.candidate is not None else None
    return Verdict(results, Guarantee.EXACT, job.seconds, region)
