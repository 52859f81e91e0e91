"""What grow, certify and recertify have in common: the state machine of :mod:`certifier.growth.machine`, over the rows of the database."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from functools import lru_cache, partial
from typing import Any

from sqlalchemy.orm import Session

from certifier import stored
from certifier.errors import CirisError
from certifier.growth.actions import Action, Candidate, Certify, Failed, Finish, Outcomes, Propose, Report, Step, Transition
from certifier.growth.machine import stored_state
from certifier.growth.options import GrowthOptions
from certifier.growth.state import GrowthState
from certifier.isolation.child import Tell
from certifier.jobs import growing
from certifier.jobs.growing import Account, Certified
from certifier.jobs.share import SampledProposal
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.pair.forecast import PairCost, forecast
from certifier.pair.result import Weakness
from certifier.seeding import PROPOSE
from certifier.seeding.proposal import Proposal
from certifier.step.step import step as polytope_step
from certifier.step.stepped import Stepped
from db import events, jobs, pairs, proofs, regions, steps, subtrees
from db.models import IterationRow, JobRow
from db.session import UNAVAILABLE, database
from db.settings import settings
from db.states import ACCEPT, IterationState, JobState
from db.transaction import Afterwards, persistently
from db.types import utcnow
from jobs import admission, obstacles
from jobs.former import former_of
from jobs.kind import Done, Held, Kind, Turn, between_parts, in_child, report_of
from jobs.scenes import load_scene
from workers.app import send_work

NOTE_S = 5.0
"""Events tell this often how far a proposal is."""


class Growing(Kind):
    """A kind of job whose state is a GrowthState, and whose work is seedings, polytope steps, iterations of pairs, and acceptances."""

    def decide(self, turn: Turn) -> Transition:
        options, scene = GrowthOptions.from_document(turn.options), load_scene(turn.scene_id)
        if turn.state is None and not options.by_cells:  # the forecast is about the program (11)
            left = None if turn.deadline_at is None else (turn.deadline_at - utcnow()).total_seconds()
            admission.check(_forecast(turn.scene_id), settings(), left)
        return growing.decided(scene, options, _state(turn.state), turn.report)

    def report(self, session: Session, job: JobRow, state: dict[str, Any] | None) -> Report | None:
        action = job.action or {}
        if action["kind"] == Certify.kind:
            iteration = session.get_one(IterationRow, (job.id, action["iteration"]))
            return None if iteration.state == IterationState.RUNNING else _outcomes(session, job, iteration)
        found = report_of(session, job, action["kind"])
        if found is None or isinstance(found, CirisError):
            return None if found is None else Failed(found)
        return stored.value(Proposal, found) if action["kind"] == Propose.kind else stored.value(Stepped, found)

    def save(self, session: Session, job: JobRow, turn: Turn, decision: Transition, afterwards: Afterwards) -> bool:
        action, report = decision.action, turn.report
        if isinstance(report, Outcomes):
            pairs.forget_weaknesses(session, job.id, report.action.iteration)
        if isinstance(report, Failed) and (error := growing.failure(_state(turn.state), report)):
            job.error = error.to_document()
        jobs.next_turn(job, _waiting_for(action))
        jobs.keep_growth(session, job, stored.document(decision.state))
        if isinstance(action, Certify):
            _add_iteration(session, job, action, afterwards)
        elif not isinstance(action, Finish):
            steps.add(session, job, action.kind, stored.document(action))
            afterwards.append(send_work)
        if decision.candidate is not None:
            steps.add(session, job, ACCEPT, stored.document(decision.candidate))
            afterwards.append(send_work)
        return isinstance(action, Finish) or (isinstance(action, Certify) and not action.pairs)

    def late(self, session: Session, job: JobRow) -> Finish:
        scene = load_scene(job.scene_id)
        try:
            state = _state(jobs.growth(session, job.id))
        except CirisError:  # Another version of ciris stored it. The job ends at its deadline anyway.
            state = None
        return growing.late(scene, state, bool(steps.accepted(session, job.id)), events.last(session, job.id, events.NOTE) or {})

    def do(self, claim: steps.Claim, scene: Scene) -> Done:
        if claim.kind == Propose.kind:
            payload = {"scene": scene.to_document(), "seed": claim.input["seed"]}
            return Done(in_child(PROPOSE, payload, tell=_noting(claim.job_id)))
        return _accept(claim, scene) if claim.kind == ACCEPT else _step(claim, scene)

    def failure(self, finish: Finish, error: dict[str, Any] | None) -> dict[str, Any] | None:
        refused = growing.refused(finish, None if error is None else CirisError.from_document(error))
        return None if refused is None else refused.to_document()

    def held(self, session: Session, scene: Scene, job: JobRow) -> list[Held]:
        return obstacles.of_growth(session, scene, job)


def _noting(job_id: str) -> Tell:
    """Returns what tells in the events of a job, and of the cover that it is a part of, how far its proposal is."""
    begun, noted = time.monotonic(), 0.0

    def tell(told: dict[str, Any]) -> None:
        nonlocal noted
        seconds = time.monotonic() - begun
        if seconds < noted + NOTE_S and not (noted == 0.0 and told.get("hindrance")):
            return
        noted, text = seconds, growing.proposing(seconds, told)
        with suppress(*UNAVAILABLE):
            with database().read() as session:
                job = jobs.get(session, job_id)
                parent, number = job.parent_id, job.number
            _note(job_id, {"text": text, "part": None, **{name: value for name, value in told.items() if value}})
            if parent is not None:
                _note(parent, {"text": f"region {number}: {text}", "part": None})

    return tell


def _note(job_id: str, data: dict[str, Any]) -> None:
    """Says in the events of a job that runs how far its work is."""
    with database().write() as session:
        job = jobs.lock(session, job_id)
        if job.state == JobState.RUNNING:
            events.emit(session, job, events.NOTE, data)


def _state(document: dict[str, Any] | None) -> GrowthState | None:
    return None if document is None else stored_state(document)


@lru_cache(maxsize=8)
def _forecast(scene_id: str) -> list[PairCost]:
    return forecast(load_scene(scene_id))


def _waiting_for(action: Action) -> dict[str, Any]:
    """Returns what the job's row says of an action. An iteration has a row of its own, and a step its input."""
    if isinstance(action, Finish):
        return jobs.finishing(action.outcome, action.reason)
    return {"kind": action.kind, "iteration": action.iteration} if isinstance(action, Certify) else {"kind": action.kind}


def _outcomes(session: Session, job: JobRow, iteration: IterationRow) -> Outcomes:
    """Returns the report on a certification that has ended, from its rows."""
    rows = pairs.reached(session, iteration)
    weaknesses = (None if row.weakness is None else stored.value(Weakness, row.weakness) for row in rows)
    reached = ((row.pair_index, Outcome(row.state), weakness, row.open_cells) for row, weakness in zip(rows, weaknesses, strict=True))
    passed = 0.0 if job.deadline_at is None else (utcnow() - job.created_at) / (job.deadline_at - job.created_at)
    return Outcomes.of_parts(stored.value(Certify, iteration.action), reached, passed)


def _add_iteration(session: Session, job: JobRow, action: Certify, afterwards: Afterwards) -> None:
    costs = _forecast(job.scene_id)
    # A pair takes about as long as the last time. The forecast by its size alone may be far from that.
    expected = pairs.expected_seconds(session, job.id, action.iteration - 1)
    new = [pairs.NewPair(i, costs[i].a, costs[i].b, expected.get(i, costs[i].seconds), part) for i, part in action.work]
    pairs.add_iteration(session, job, stored.document(action), new)
    # A certified pair is not asked for again, and partitions that begin anew have nothing to go on with.
    subtrees.drop(session, job.id, [] if action.begun is None else action.pairs)
    # Each solver that finds work wakes the next one. Where there is much work, this many solvers begin at once.
    pieces = math.ceil(sum(pair.forecast_seconds for pair in new) / settings().batch_seconds)
    afterwards.append(partial(send_work, min(max(pieces, 1), settings().solve_processes)))


def _step(claim: steps.Claim, scene: Scene) -> Done:
    """Does the polytope step on a certified polytope with its proofs."""
    action = stored.value(Step, claim.input)

    def read() -> dict[int, bytes]:
        with database().read() as session:
            candidates = [stored.value(Candidate, row.input) for row in steps.accepted(session, claim.job_id)]
            return _proofs(session, claim.job_id, next(one for one in candidates if one.iteration == action.iteration))

    return Done(stored.document(polytope_step(scene, action.polytope, persistently(read), contain=action.contain)))


def _accept(claim: steps.Claim, scene: Scene) -> Done:
    """Assembles and verifies the proof of a region. If the verifier refuses it, its ProofError is raised and nothing is stored."""
    candidate = stored.value(Candidate, claim.input)

    def read() -> tuple[GrowthState, dict[int, bytes], Account]:
        with database().read() as session:
            return (
                _known(session, claim.job_id),
                _proofs(session, claim.job_id, candidate),
                _account(session, jobs.get(session, claim.job_id)),
            )

    state, held, account = persistently(read)
    proposal = None if state.start is None else _sampled_proposal(claim.scene_id, claim.job_id)
    former = former_of(scene, state.options)
    region = growing.make_region(scene, state, candidate, held, account, proposal, former, progress=between_parts)

    def save(session: Session, job: JobRow) -> None:
        regions.add(session, job, candidate.iteration, region.manifest, region.summary, region.proof)

    return Done({"iteration": candidate.iteration}, save)


@lru_cache(maxsize=8)
def _sampled_proposal(scene_id: str, job_id: str) -> SampledProposal:
    """Returns what the job grows its regions from, sampled. It is kept, since a job may accept many regions."""

    def read() -> GrowthState:
        with database().read() as session:
            return _known(session, job_id)

    start = persistently(read).start
    assert start is not None, "the job has a proposal"
    return SampledProposal.of(load_scene(scene_id), start.rows)


def _known(session: Session, job_id: str) -> GrowthState:
    state = _state(jobs.growth(session, job_id))
    assert state is not None, "a job with a certified polytope has begun to grow"
    return state


def _proofs(session: Session, job_id: str, candidate: Candidate) -> dict[int, bytes]:
    """Returns pair index -> proof file, from the iterations that hold the proofs.

    The order is that of the candidate, because the last digits of a sum depend on it.
    """
    rows = pairs.proving(session, job_id, candidate.proofs)
    return {index: proofs.get(session, rows[index].proof_digest or "") for index in candidate.proofs}


def _account(session: Session, job: JobRow) -> Account:
    started = job.started_at or job.created_at
    finished = {row.index: row.finished_at or started for row in pairs.iterations(session, job.id)}
    seeded = [step.report for step in steps.of_job(session, job.id) if step.kind == Propose.kind and step.report is not None]
    candidates = [stored.value(Candidate, step.input) for step in steps.accepted(session, job.id)]
    certified = [
        Certified(one.iteration, one.polytope, one.ellipsoid_volume, (finished[one.iteration] - started).total_seconds())
        for one in candidates
    ]
    seeding = sum(report["info"]["seconds"] for report in seeded)
    return Account(certified, seeding, pairs.seconds(session, job.id), (utcnow() - started).total_seconds(), job.id)
