"""Doing a step: seeding, the polytope step, accepting a region. A message may come twice, or its worker die halfway, without harm."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from certifier.child import run_in_child
from certifier.errors import CirisError
from certifier.growth import Accepted, Proposed
from certifier.local import stepped, versions
from certifier.model import Polytope, Scene
from certifier.polytope_step import step as polytope_step
from certifier.region import certified_region
from certifier.seeding import SeedOptions, propose
from db import jobs, leases, pairs, proofs, regions, steps
from db.models import JobRow, StepRow
from db.session import database
from db.settings import settings
from db.states import IterationState, StepKind, StepState
from db.types import utcnow
from workers.app import send_coordinate
from workers.scenes import load_scene
from workers.transaction import writing

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Done:
    """What a step found, and what else to save with it (in the same transaction)."""

    report: dict[str, Any]
    save: Callable[[Session, JobRow], None] = lambda session, job: None


def run_step(step_id: int, task_id: str | None = None) -> None:
    """Does a step, unless it is done, not wanted any more, or being done by someone else."""
    lease = settings().lease_seconds
    with database().write() as session:
        claim = steps.claim(session, step_id, task_id=task_id, lease_seconds=lease)
    if claim is None:
        return
    start = time.perf_counter()
    with leases.renewed(database(), StepRow, claim.token, lease):
        try:
            state, done = StepState.DONE, _do(claim)
        except CirisError as error:
            state, done = StepState.FAILED, Done(error.to_document())
        except Exception as error:
            log.exception("job %s: step %s failed", claim.job_id, claim.kind)
            problem = CirisError("internal_error", f"{claim.kind}: {type(error).__name__}: {error}")
            state, done = StepState.FAILED, Done(problem.to_document())
        with writing() as (session, afterwards):
            job = jobs.lock(session, claim.job_id)
            if steps.save(session, claim, state, done.report, time.perf_counter() - start):
                done.save(session, job)
                afterwards.append(partial(send_coordinate, claim.job_id))


def _do(claim: steps.Claim) -> Done:
    limit = settings().max_attempts
    if claim.attempt > limit:
        raise CirisError("worker_lost", f"the worker died {limit} times during the step {claim.kind} (killed, crashed or out of memory)")
    scene = load_scene(claim.scene_id)
    match claim.kind:
        case StepKind.PROPOSE:
            return _propose(scene, claim)
        case StepKind.STEP:
            return _step(scene, claim)
        case StepKind.ACCEPT:
            return _accept(scene, claim)


def _propose(scene: Scene, claim: steps.Claim) -> Done:
    return Done(_in_child("propose_in_child", {"scene": scene.to_document(), "seed": claim.input["seed"]}))


def propose_in_child(payload: dict[str, Any]) -> dict[str, Any]:
    """The seeding, as its child process runs it: documents in, the report out."""
    found = propose(Scene.from_document(payload["scene"]), SeedOptions.from_document(payload["seed"]))
    return asdict(Proposed(found.C.tolist(), found.d.tolist(), found.center.tolist(), found.info))


def _step(scene: Scene, claim: steps.Claim) -> Done:
    return Done(_in_child("step_in_child", {"job_id": claim.job_id, "scene_id": claim.scene_id, **claim.input}))


def step_in_child(payload: dict[str, Any]) -> dict[str, Any]:
    """The polytope step on an accepted polytope, as its child process runs it: the action and ids in, the report out."""
    job_id, iteration = payload["job_id"], payload["iteration"]
    with database().read() as session:
        accepted = next(row.input for row in steps.accepted(session, job_id) if row.input["iteration"] == iteration)
        held = _proofs(session, job_id, accepted["proofs"])
    return asdict(stepped(polytope_step(load_scene(payload["scene_id"]), Polytope(np.array(payload["C"]), np.array(payload["d"])), held)))


def _in_child(function: str, payload: dict[str, Any]) -> dict[str, Any]:
    """A report computed by a process of its own: native code that dies, hangs or wants too much memory fails the step, nothing else."""
    limits = settings()
    report: dict[str, Any] = run_in_child(
        f"workers.steps:{function}", payload, timeout_s=limits.step_timeout_seconds, memory_bytes=limits.child_memory_bytes
    )
    return report


def _accept(scene: Scene, claim: steps.Claim) -> Done:
    """Assembles and verifies the proof of a region; what the verifier refuses is raised as its ProofError and never stored."""
    accepted = claim.input
    with database().read() as session:
        held = _proofs(session, claim.job_id, accepted["proofs"])
        provenance = _provenance(session, scene, jobs.get(session, claim.job_id))
    region = certified_region(scene, Accepted(**accepted), held, provenance)

    def save(session: Session, job: JobRow) -> None:
        regions.add(session, job, accepted["iteration"], region.manifest, region.proof)

    return Done({"iteration": accepted["iteration"]}, save)


def _proofs(session: Session, job_id: str, iteration_of: Mapping[str, int]) -> dict[int, bytes]:
    """Pair index -> proof file, from the iterations that hold them."""
    rows = pairs.proving(session, job_id, {int(index): iteration for index, iteration in iteration_of.items()})
    return {index: proofs.get(session, row.proof_digest or "") for index, row in rows.items()}


def _provenance(session: Session, scene: Scene, job: JobRow) -> dict[str, Any]:
    started = job.started_at or job.created_at
    certified = [row for row in pairs.iterations(session, job.id) if row.state == IterationState.CERTIFIED]
    return {
        "job": job.id,
        "options": job.options,
        "versions": versions(scene),
        "growth_curve": [
            {"iteration": row.index, "seconds": ((row.finished_at or started) - started).total_seconds()} for row in certified
        ],
        "seconds": (utcnow() - started).total_seconds(),
    }
