"""Doing a claimed step: seeding, the polytope step, accepting a region. The worker may die halfway without harm."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from sqlalchemy.orm import Session
from structlog.contextvars import bound_contextvars

from certifier.errors import CirisError
from certifier.growth.actions import Accepted
from certifier.isolation.child import run_in_child
from certifier.jobs.region import certified_region, versions
from certifier.jobs.reports import stepped
from certifier.model import Polytope, Scene
from certifier.step.step import step as polytope_step
from db import jobs, leases, pairs, proofs, regions, steps
from db.models import JobRow, StepRow
from db.session import database
from db.settings import settings
from db.states import IterationState, JobState, StepKind, StepState
from db.types import utcnow
from workers.app import send_work
from workers.pairs import LOST
from workers.scenes import load_scene
from workers.transaction import persistently

log = logging.getLogger(__name__)

SEEDING = "certifier.seeding.propose:propose_in_child"


@dataclass(frozen=True)
class Done:
    """What a step found, and what else to save with it (in the same transaction)."""

    report: dict[str, Any]
    save: Callable[[Session, JobRow], None] = lambda session, job: None


def carry_out(claim: steps.Claim) -> bool:
    """Does a claimed step and saves what came of it; False when it was not held any more."""
    wanted = [JobState.RUNNING, JobState.CANCELLING] if claim.kind == StepKind.ACCEPT else [JobState.RUNNING]
    start = time.perf_counter()
    bound = bound_contextvars(job=claim.job_id, step=claim.kind.value)
    with bound, leases.kept(database(), StepRow, claim.token, settings().lease_seconds, wanted):
        try:
            state, done = StepState.DONE, _do(claim)
        except CirisError as error:
            state, done = StepState.FAILED, Done(error.to_document())
        except Exception as error:
            log.exception("the step failed")
            problem = CirisError("internal_error", f"{claim.kind}: {type(error).__name__}: {error}")
            state, done = StepState.FAILED, Done(problem.to_document())
        saved = persistently(lambda: _save(claim, state, done, time.perf_counter() - start))
    if saved and claim.kind == StepKind.ACCEPT and state == StepState.FAILED:
        send_work()  # a region certified earlier may be had instead
    return saved


def _save(claim: steps.Claim, state: StepState, done: Done, seconds: float) -> bool:
    with database().write() as session:
        job = jobs.lock(session, claim.job_id)
        if not steps.save(session, claim, state, done.report, seconds):
            return False
        done.save(session, job)
        return True


def _do(claim: steps.Claim) -> Done:
    if leases.is_poison(claim.deaths, claim.attempt, settings().max_attempts):
        problem = f"{LOST.format(deaths=claim.deaths, attempts=claim.attempt - 1)} the step {claim.kind}"
        raise CirisError("worker_lost", problem)
    scene = load_scene(claim.scene_id)
    match claim.kind:
        case StepKind.PROPOSE:
            return _propose(scene, claim)
        case StepKind.STEP:
            return _step(scene, claim)
        case StepKind.ACCEPT:
            return _accept(scene, claim)


def _propose(scene: Scene, claim: steps.Claim) -> Done:
    """Seeds in a process of its own: Drake may abort the process, hang, or want too much memory, and that fails the step, nothing else."""
    limits, payload = settings(), {"scene": scene.to_document(), "seed": claim.input["seed"]}
    timeout, memory = limits.time_limit_seconds, limits.child_memory_bytes
    return Done(run_in_child(SEEDING, payload, timeout_s=timeout, memory_bytes=memory))


def _step(scene: Scene, claim: steps.Claim) -> Done:
    """The polytope step on an accepted polytope with its proofs."""
    action = claim.input

    def read() -> dict[int, bytes]:
        with database().read() as session:
            rows = steps.accepted(session, claim.job_id)
            accepted = next(row.input for row in rows if row.input["iteration"] == action["iteration"])
            return _proofs(session, claim.job_id, accepted["proofs"])

    polytope = Polytope(np.array(action["C"]), np.array(action["d"]))
    return Done(asdict(stepped(polytope_step(scene, polytope, persistently(read), witnesses=np.array(action["contain"])))))


def _accept(scene: Scene, claim: steps.Claim) -> Done:
    """Assembles and verifies the proof of a region; what the verifier refuses is raised as its ProofError and never stored."""
    accepted = claim.input

    def read() -> tuple[dict[int, bytes], dict[str, Any]]:
        with database().read() as session:
            return _proofs(session, claim.job_id, accepted["proofs"]), _provenance(session, scene, jobs.get(session, claim.job_id))

    held, provenance = persistently(read)
    region = certified_region(scene, Accepted(**accepted), held, provenance)

    def save(session: Session, job: JobRow) -> None:
        regions.add(session, job, accepted["iteration"], region.manifest, region.proof)

    return Done({"iteration": accepted["iteration"]}, save)


def _proofs(session: Session, job_id: str, iteration_of: Mapping[str, int]) -> dict[int, bytes]:
    """Pair index -> proof file, from the iterations that hold them, in the order given: the last digits of a sum depend on its order."""
    rows = pairs.proving(session, job_id, {int(index): iteration for index, iteration in iteration_of.items()})
    return {index: proofs.get(session, rows[index].proof_digest or "") for index in map(int, iteration_of)}


def _provenance(session: Session, scene: Scene, job: JobRow) -> dict[str, Any]:
    started = job.started_at or job.created_at
    certified = [row for row in pairs.iterations(session, job.id) if row.state == IterationState.CERTIFIED]
    seeded = [step.report for step in steps.of_job(session, job.id) if step.kind == StepKind.PROPOSE and step.report is not None]
    return {
        "job": job.id,
        "options": job.options,
        "versions": versions(scene),
        "growth_curve": [
            {"iteration": row.index, "seconds": ((row.finished_at or started) - started).total_seconds()} for row in certified
        ],
        "seeding_seconds": sum(report["info"]["seconds"] for report in seeded),
        "pair_seconds": pairs.seconds(session, job.id),
        "seconds": (utcnow() - started).total_seconds(),
    }
