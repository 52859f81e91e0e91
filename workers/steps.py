"""A claimed step of a job is carried out by its kind. The worker may die halfway without harm."""

from __future__ import annotations

import logging
import time
from datetime import timedelta

from structlog.contextvars import bound_contextvars

from certifier.errors import CirisError
from certifier.jobs.growing import REST
from db import jobs, leases, solver_time, steps, traces
from db.models import StepRow
from db.session import database
from db.settings import settings
from db.states import ACCEPT, JobState, StepState
from db.transaction import persistently
from db.types import utcnow
from jobs.failures import IN_LOG, LOST, ON_LOSS
from jobs.kind import Done, GivesWay
from jobs.registry import KINDS
from jobs.scenes import load_scene
from workers.app import send_work
from workers.sweeper import give_up

log = logging.getLogger(__name__)


def carry_out(claim: steps.Claim) -> bool:
    """Does a claimed step and saves its result. Returns False when the step was not held any more."""
    wanted = [JobState.RUNNING, JobState.CANCELLING] if claim.kind == ACCEPT else [JobState.RUNNING]
    start = time.perf_counter()
    bound = bound_contextvars(job=claim.job_id, step=claim.kind)
    traced = traces.span(claim.kind, claim.traceparent, job=claim.job_id, attempt=claim.attempt)
    with bound, traced as span, leases.kept(database(), StepRow, claim.token, settings().lease_seconds, wanted):
        try:
            state, done = StepState.DONE, _do(claim)
        except GivesWay:
            give_up(leases.Lost(claim.job_id, claim.token, leases.this_worker(), "new jobs waited", alone=False))
            return False
        except CirisError as error:
            state, done = StepState.FAILED, Done(error.to_document())
        except Exception:
            log.exception("the step failed")
            problem = CirisError("internal_error", f"the step {claim.kind} went wrong in the service", hint=IN_LOG)
            state, done = StepState.FAILED, Done(problem.to_document())
        traces.note(span, state=state.value)
        saved = persistently(lambda: _save(claim, state, done, time.perf_counter() - start))
    if saved and claim.kind == ACCEPT and state == StepState.FAILED:
        send_work()  # a region that was certified earlier may be accepted instead
    return saved


def _save(claim: steps.Claim, state: StepState, done: Done, seconds: float) -> bool:
    with database().write() as session:
        job = jobs.lock(session, claim.job_id)
        if not steps.save(session, claim, state, done.report, seconds):
            return False
        if claim.kind == ACCEPT and state == StepState.DONE:
            job.accept_after = utcnow() + timedelta(seconds=REST * seconds)
        done.save(session, job)
        solver_time.add(session, job.project, seconds, job.key_id)
        return True


def _do(claim: steps.Claim) -> Done:
    if leases.is_poison(claim.deaths, claim.attempt, settings().max_attempts):
        problem = f"{LOST.format(deaths=claim.deaths, attempts=claim.attempt - 1)} the step {claim.kind}"
        raise CirisError("worker_lost", problem, hint=ON_LOSS)
    return KINDS[claim.job_kind].do(claim, load_scene(claim.scene_id))
