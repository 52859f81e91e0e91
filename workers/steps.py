"""This module does a claimed step: seeding, the polytope step, accepting a region, a look for a cover, or a motion.

The worker may die halfway without harm.
"""

from __future__ import annotations

import base64
import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import timedelta
from functools import lru_cache
from typing import Any

import numpy as np
from sqlalchemy.orm import Session
from structlog.contextvars import bound_contextvars

from certifier.errors import CirisError
from certifier.growth.actions import Candidate
from certifier.growth.machine import stored_state
from certifier.growth.obstacles import Obstacle
from certifier.growth.options import GrowthOptions
from certifier.growth.state import GrowthState
from certifier.isolation.child import run_in_child
from certifier.jobs.region import REST, certified_region, growth_point, versions
from certifier.jobs.share import SampledProposal
from certifier.model import Array, Polytope, Scene
from certifier.step.step import step as polytope_step
from db import jobs, leases, pairs, proofs, regions, steps, traces
from db.models import IterationRow, JobRow, StepRow
from db.session import database
from db.settings import settings
from db.states import JobState, StepKind, StepState
from db.types import utcnow
from workers.app import send_work
from workers.failures import IN_LOG, LOST, ON_LOSS
from workers.former import former_of
from workers.scenes import load_scene
from workers.scouting import scout
from workers.transaction import persistently

log = logging.getLogger(__name__)

SEEDING = "certifier.seeding.propose:propose_in_child"
MOTION = "certifier.jobs.motion:certify_in_child"


@dataclass(frozen=True)
class Done:
    """Says what a step found, and what else to save with it in the same transaction."""

    report: dict[str, Any]
    save: Callable[[Session, JobRow], None] = lambda session, job: None


def carry_out(claim: steps.Claim) -> bool:
    """Does a claimed step and saves its result. Returns False when the step was not held any more."""
    wanted = [JobState.RUNNING, JobState.CANCELLING] if claim.kind == StepKind.ACCEPT else [JobState.RUNNING]
    start = time.perf_counter()
    bound = bound_contextvars(job=claim.job_id, step=claim.kind.value)
    traced = traces.span(claim.kind.value, claim.traceparent, job=claim.job_id, attempt=claim.attempt)
    with bound, traced as span, leases.kept(database(), StepRow, claim.token, settings().lease_seconds, wanted):
        try:
            state, done = StepState.DONE, _do(claim)
        except CirisError as error:
            state, done = StepState.FAILED, Done(error.to_document())
        except Exception:
            log.exception("the step failed")
            problem = CirisError("internal_error", f"the step {claim.kind} went wrong in the service", hint=IN_LOG)
            state, done = StepState.FAILED, Done(problem.to_document())
        traces.note(span, state=state.value)
        saved = persistently(lambda: _save(claim, state, done, time.perf_counter() - start))
    if saved and claim.kind == StepKind.ACCEPT and state == StepState.FAILED:
        send_work()  # a region that was certified earlier may be accepted instead
    return saved


def _save(claim: steps.Claim, state: StepState, done: Done, seconds: float) -> bool:
    with database().write() as session:
        job = jobs.lock(session, claim.job_id)
        if not steps.save(session, claim, state, done.report, seconds):
            return False
        if claim.kind == StepKind.ACCEPT and state == StepState.DONE:
            job.accept_after = utcnow() + timedelta(seconds=REST * seconds)
        done.save(session, job)
        return True


def _do(claim: steps.Claim) -> Done:
    if leases.is_poison(claim.deaths, claim.attempt, settings().max_attempts):
        problem = f"{LOST.format(deaths=claim.deaths, attempts=claim.attempt - 1)} the step {claim.kind}"
        raise CirisError("worker_lost", problem, hint=ON_LOSS)
    scene = load_scene(claim.scene_id)
    match claim.kind:
        case StepKind.PROPOSE:
            return _propose(scene, claim)
        case StepKind.STEP:
            return _step(scene, claim)
        case StepKind.ACCEPT:
            return _accept(scene, claim)
        case StepKind.SCOUT:
            return Done(scout(scene, claim.scene_id, claim.job_id))
        case StepKind.MOTION:
            return _motion(scene, claim)


def _propose(scene: Scene, claim: steps.Claim) -> Done:
    """Seeds in a separate process. If Drake aborts that process, hangs or wants too much memory, only the step fails."""
    return Done(_in_child(SEEDING, {"scene": scene.to_document(), "seed": claim.input["seed"]}))


def _motion(scene: Scene, claim: steps.Claim) -> Done:
    """Certifies the motion of the job in a separate process, which also verifies the proof."""

    def read() -> dict[str, Any]:
        with database().read() as session:
            return jobs.get(session, claim.job_id).options

    found = _in_child(MOTION, {"scene": scene.to_document(), "space": None, **persistently(read), "prove": True})
    if found["proof"] is None:
        return Done(found)
    proof = base64.b64decode(found["proof"])

    def save(session: Session, job: JobRow) -> None:
        steps.keep_proof(session, claim, proof)

    return Done({**found, "proof": proofs.digest(proof)}, save)


def _in_child(function: str, payload: dict[str, Any]) -> dict[str, Any]:
    limits = settings()
    found: dict[str, Any] = run_in_child(function, payload, timeout_s=limits.time_limit_seconds, memory_bytes=limits.child_memory_bytes)
    return found


def _step(scene: Scene, claim: steps.Claim) -> Done:
    """Does the polytope step on an accepted polytope with its proofs."""
    iteration = claim.input["iteration"]

    def read() -> tuple[Polytope, dict[int, bytes]]:
        with database().read() as session:
            rows = steps.accepted(session, claim.job_id)
            accepted = next(row.input for row in rows if row.input["iteration"] == iteration)
            return _polytope(session, claim.job_id, iteration)[0], _proofs(session, claim.job_id, accepted["proofs"])

    return Done(polytope_step(scene, *persistently(read), contain=np.array(claim.input["contain"])).to_document())


def _accept(scene: Scene, claim: steps.Claim) -> Done:
    """Assembles and verifies the proof of a region. If the verifier refuses it, its ProofError is raised and nothing is stored."""
    accepted, proposal = claim.input, _sampled_proposal(claim.scene_id, claim.job_id)

    def read() -> tuple[Candidate, dict[int, bytes], dict[str, Any]]:
        with database().read() as session:
            polytope, center = _polytope(session, claim.job_id, accepted["iteration"])
            candidate = Candidate(
                iteration=accepted["iteration"],
                polytope=polytope,
                center=center,
                seed=None if accepted["seed"] is None else np.array(accepted["seed"]),
                ellipsoid_volume=accepted["ellipsoid_volume"],
                proofs={int(index): iteration for index, iteration in accepted["proofs"].items()},
                together={int(index): tuple(others) for index, others in accepted.get("together", {}).items()},
                obstacles={int(index): Obstacle.from_document(one) for index, one in accepted.get("obstacles", {}).items()},
            )
            held = _proofs(session, claim.job_id, accepted["proofs"])
            return candidate, held, _provenance(session, scene, jobs.get(session, claim.job_id), proposal)

    candidate, held, provenance = persistently(read)
    state = _growth(claim.job_id)
    former = former_of(scene, state.options)
    if former is not None and proposal is not None:
        cut = {} if state.whole is None else state.whole.cuts
        provenance["recertified"] = former.document(scene, cut, proposal, candidate.polytope)
    region = certified_region(scene, candidate, held, provenance, proposal)

    def save(session: Session, job: JobRow) -> None:
        regions.add(session, job, candidate.iteration, region.manifest, region.proof)

    return Done({"iteration": candidate.iteration}, save)


@lru_cache(maxsize=8)
def _sampled_proposal(scene_id: str, job_id: str) -> SampledProposal | None:
    """Returns what the job grows its regions from, sampled; None for a given polytope. It is kept, since a job may accept many regions."""

    start = _growth(job_id).start
    return None if start is None else SampledProposal.of(load_scene(scene_id), start.rows)


def _growth(job_id: str) -> GrowthState:
    """Returns what the growth of the job knows now."""

    def read() -> GrowthState:
        with database().read() as session:
            job = jobs.get(session, job_id)
            growth = jobs.growth(session, job_id)
            assert growth is not None, "a job with a certified polytope has begun to grow"
            return stored_state(growth, GrowthOptions.from_document(job.options))

    return persistently(read)


def _polytope(session: Session, job_id: str, iteration: int) -> tuple[Polytope, Array | None]:
    """Returns the polytope of an iteration, joint limits included, and the interior point that came with it, if any."""
    arrays = session.get_one(IterationRow, (job_id, iteration)).arrays
    return Polytope(arrays["C"], arrays["d"]), arrays.get("center")


def _proofs(session: Session, job_id: str, iteration_of: Mapping[str, int]) -> dict[int, bytes]:
    """Returns pair index -> proof file, from the iterations that hold the proofs.

    The order is the one given, because the last digits of a sum depend on it.
    """
    rows = pairs.proving(session, job_id, {int(index): iteration for index, iteration in iteration_of.items()})
    return {index: proofs.get(session, rows[index].proof_digest or "") for index in map(int, iteration_of)}


def _provenance(session: Session, scene: Scene, job: JobRow, proposal: SampledProposal | None) -> dict[str, Any]:
    started = job.started_at or job.created_at
    finished = {row.index: row.finished_at or started for row in pairs.iterations(session, job.id)}
    seeded = [step.report for step in steps.of_job(session, job.id) if step.kind == StepKind.PROPOSE and step.report is not None]

    def point(iteration: int, ellipsoid_volume: float | None, **_: Any) -> dict[str, Any]:
        share = None if proposal is None else proposal.share(_polytope(session, job.id, iteration)[0])["value"]
        return growth_point(iteration, (finished[iteration] - started).total_seconds(), ellipsoid_volume, share)

    return {
        "job": job.id,
        "options": job.options,
        "versions": versions(scene),
        "growth_curve": [point(**step.input) for step in steps.accepted(session, job.id)],
        "seeding_seconds": sum(report["info"]["seconds"] for report in seeded),
        "pair_seconds": pairs.seconds(session, job.id),
        "seconds": (utcnow() - started).total_seconds(),
    }
