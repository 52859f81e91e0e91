"""One piece of work: whatever is next for anybody, claimed and done."""

from __future__ import annotations

from db import pairs, steps
from db import work as queue
from db.session import database
from db.settings import settings
from workers.pairs import certify_pairs
from workers.steps import carry_out


def work() -> bool:
    """Does the next piece of work; False when there is none. Harmless however often it is called."""
    claim = _claim()
    if claim is None:
        return False
    if isinstance(claim, steps.Claim):
        carry_out(claim)
    else:
        certify_pairs(claim)
    return True


def _claim() -> pairs.Claim | steps.Claim | None:
    claim, limits = None, settings()
    while claim is None:
        with database().read() as session:
            job_id = queue.next_job(session)
        if job_id is None:
            return None
        with database().write() as session:
            claim = queue.claim(session, job_id, lease_seconds=limits.lease_seconds, batch_seconds=limits.batch_seconds)
    return claim
