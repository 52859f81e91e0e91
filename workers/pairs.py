"""Certifying pairs: claim a batch, certify, save with the proofs. A message may come twice, or its worker die halfway, without harm."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from functools import lru_cache, partial

from certifier.errors import CirisError
from certifier.growth import GrowthOptions
from certifier.local import weakness
from certifier.model import Polytope
from certifier.pair import Certification
from db import jobs, leases, pairs
from db.models import IterationRow, PairRow
from db.session import database
from db.settings import settings
from db.states import PairState
from workers.app import send_coordinate, stop_messages
from workers.scenes import load_scene
from workers.transaction import writing

log = logging.getLogger(__name__)

SAVE_SECONDS = 0.5
"""Results are saved together until this much time has gone into them."""


def solve_pairs(job_id: str, iteration: int, indices: Sequence[int], task_id: str | None = None) -> None:
    """Certifies these pairs of an iteration, as far as they are still wanted and nobody else is at them."""
    lease, left = settings().lease_seconds, set(indices)
    while left:
        with database().write() as session:
            wanted = [index for index in indices if index in left]
            claim = pairs.claim(session, job_id, iteration, wanted, task_id=task_id, lease_seconds=lease)
        if claim is None:
            return
        with leases.renewed(database(), PairRow, claim.token, lease):
            _certify_claimed(claim)
        left -= {pair.index for pair in claim.pairs}


def _certify_claimed(claim: pairs.Claim) -> None:
    """Certifies and saves the claimed pairs, until one of them turns out not to be held any more."""
    results: list[pairs.Result] = []
    since = time.monotonic()
    for place, pair in enumerate(claim.pairs, start=1):
        results.append(_certify(claim, pair))
        failed = results[-1].state != PairState.CERTIFIED
        if failed or place == len(claim.pairs) or time.monotonic() - since >= SAVE_SECONDS:
            if not _save_results(claim, results):
                return
            results, since = [], time.monotonic()


def _certify(claim: pairs.Claim, pair: pairs.Claimed) -> pairs.Result:
    limit, start = settings().max_attempts, time.perf_counter()
    if pair.attempt > limit:
        problem = f"the worker died {limit} times while certifying this pair (killed, crashed or out of memory)"
        return _error(pair, CirisError("worker_lost", problem), start)
    try:
        found = _certification(claim.scene_id, claim.job_id, claim.iteration).certify(pair.index)
    except CirisError as error:
        return _error(pair, error, start)
    except Exception as error:
        log.exception("job %s, iteration %d: pair %d failed", claim.job_id, claim.iteration, pair.index)
        return _error(pair, CirisError("internal_error", f"{type(error).__name__}: {error}"), start)
    return pairs.Result(
        index=pair.index,
        state=PairState(found.outcome.value),
        stage=found.stage.value,
        margin=found.margin,
        seconds=found.seconds,
        detail=found.detail,
        witness_s=None if found.witness_s is None else found.witness_s.tolist(),
        weak_points=weakness(found),
        proof=found.proof,
    )


def _error(pair: pairs.Claimed, error: CirisError, start: float) -> pairs.Result:
    return pairs.Result(pair.index, PairState.ERROR, seconds=time.perf_counter() - start, detail=str(error), error=error.to_document())


@lru_cache(maxsize=2)
def _certification(scene_id: str, job_id: str, iteration: int) -> Certification:
    """What the pairs of an iteration share; its polytope never changes, so the last two are kept."""
    with database().read() as session:
        arrays = session.get_one(IterationRow, (job_id, iteration)).arrays
        seed = GrowthOptions.from_document(jobs.get(session, job_id).options).random_seed
    return Certification(load_scene(scene_id), Polytope(arrays["C"], arrays["d"]), arrays.get("center"), seed)


def _save_results(claim: pairs.Claim, results: Sequence[pairs.Result]) -> bool:
    """Saves, then tells the others what follows from it. False when some of the pairs are not held any more."""
    with writing() as (session, afterwards):
        saved = pairs.save(session, claim, results, worth_stopping=settings().batch_seconds)
        afterwards.append(partial(stop_messages, saved.stopped))
        if saved.finished:
            afterwards.append(partial(send_coordinate, claim.job_id))
    return saved.held
