"""This module certifies a batch of claimed pairs, and saves their results with the proofs. The worker may die halfway without harm."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from functools import lru_cache, partial

from structlog.contextvars import bound_contextvars

from certifier import stored
from certifier.errors import CirisError
from certifier.growth.actions import Certify
from certifier.growth.options import GrowthOptions
from certifier.jobs.pairs import CertifyPart, part_certifier
from certifier.outcome import Outcome
from certifier.pair.result import PairResult
from db import jobs, leases, pairs, subtrees, traces, work
from db.models import IterationRow, PairRow
from db.session import database
from db.settings import settings
from db.states import JobState
from db.transaction import persistently
from jobs.failures import IN_LOG, LOST, ON_LOSS
from jobs.former import former_of
from jobs.scenes import load_scene
from workers.app import send_work

log = logging.getLogger(__name__)

SAVE_SECONDS = 2.0
"""Results are saved together once this much time has passed since the last saving."""
HELD_SECONDS = 5.0
"""The rest of a batch is given back when others wait and this much time has passed since its first pair was done, and for a job that nobody
has begun after the first saving. Forecasts may be far too short. Before the first pair, a process may have to load the scene and the
polytope."""

CertifyPair = Callable[[pairs.Claim, pairs.Claimed], PairResult]


def certify_pairs(claim: pairs.Claim) -> bool:
    """Certifies and saves the claimed pairs while any of them is held. Says whether that finished the iteration."""
    return settle(claim, _certify)


def settle(claim: pairs.Claim, certify: CertifyPair) -> bool:
    """Does as :func:`certify_pairs` with what ``certify`` finds of each pair."""
    bound = bound_contextvars(job=claim.job_id, iteration=claim.iteration)
    with bound, leases.kept(database(), PairRow, claim.token, settings().lease_seconds, [JobState.RUNNING]):
        return _certify_and_save(claim, certify)


def _certify_and_save(claim: pairs.Claim, certify: CertifyPair) -> bool:
    """Certifies the claimed pairs and saves their results now and then. Says whether that finished the iteration."""
    results: dict[tuple[int, int], PairResult] = {}
    since = time.monotonic()
    first_done: float | None = None
    for place, pair in enumerate(claim.pairs, start=1):
        place_of = {"iteration": claim.iteration, "pair": pair.index, "part": pair.part, "attempt": pair.attempt}
        traced = traces.span("certify", claim.traceparent, job=claim.job_id, **place_of)
        with bound_contextvars(pair=pair.index), traced as span:
            result = results[pair.index, pair.part] = certify(claim, pair)
            traces.note(span, outcome=result.outcome.value)
        first_done = first_done or time.monotonic()
        failed = result.outcome is not Outcome.CERTIFIED
        if failed or place == len(claim.pairs) or time.monotonic() - since >= SAVE_SECONDS:
            saved = persistently(partial(_save, claim, results))
            if saved.finished or not saved.held:
                return saved.finished
            results, since = {}, time.monotonic()
            if persistently(partial(_give_back, claim, since - first_done)):
                send_work()
                return False
    return False


def _certify(claim: pairs.Claim, pair: pairs.Claimed) -> PairResult:
    start = time.perf_counter()
    if leases.is_poison(pair.deaths, pair.attempt, settings().max_attempts):
        problem = f"{LOST.format(deaths=pair.deaths, attempts=pair.attempt - 1)} this pair"
        return _error(CirisError("worker_lost", problem, hint=ON_LOSS), start)
    try:
        return _certification(claim.scene_id, claim.job_id, claim.iteration)(pair.index, pair.part)
    except CirisError as error:
        return _error(error, start)
    except Exception:
        log.exception("the pair failed")
        return _error(CirisError("internal_error", "certifying the pair went wrong in the service", hint=IN_LOG), start)


def _error(error: CirisError, start: float) -> PairResult:
    seconds = time.perf_counter() - start
    return PairResult(Outcome.ERROR, None, seconds=seconds, detail=str(error), error=error.to_document())


@lru_cache(maxsize=2)
def _certification(scene_id: str, job_id: str, iteration: int) -> CertifyPart:
    """Returns the function that certifies a part of a pair of an iteration.

    An iteration's polytope never changes, so the process keeps the last two.
    """

    def read() -> tuple[Certify, GrowthOptions]:
        with database().read() as session:
            action = stored.value(Certify, session.get_one(IterationRow, (job_id, iteration)).action)
            return action, GrowthOptions.from_document(jobs.get(session, job_id).options)

    action, options = persistently(read)
    scene = load_scene(scene_id)
    # Proofs are taken over in the round in which partitions begin, and the rounds after it go on with what it left.
    former = None if action.begun else former_of(scene, options)
    return part_certifier(scene, action, options.random_seed, partial(_left, job_id), None if former is None else former.carried)


def _left(job_id: str, iteration: int, index: int) -> list[bytes]:
    """Returns the subtrees that an iteration has left of a pair, in the order of its parts."""

    def read() -> list[bytes]:
        with database().read() as session:
            return subtrees.left_of(session, job_id, index, iteration)

    return persistently(read)


def _give_back(claim: pairs.Claim, held_seconds: float) -> bool:
    """Gives the rest of a claim back when others wait, and says whether it did.

    Args:
        held_seconds: seconds since its first pair was done.
    """
    with database().read() as session:
        new = work.newcomer_waits(session, claim.job_id)
        if not new and (held_seconds < HELD_SECONDS or not work.others_wait(session, claim.job_id)):
            return False
    with database().write() as session:
        pairs.give_back(session, claim)
    return True


def _save(claim: pairs.Claim, results: dict[tuple[int, int], PairResult]) -> pairs.Saved:
    with database().write() as session:
        return pairs.save(session, claim, results)
