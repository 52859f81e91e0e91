"""A solver claims whatever piece of work is next, and does it.

A solver that claims a piece and leaves more work sends a message for the next solver before it begins. So there is always a message
while something is open, and hardly any message comes for nothing, however early an iteration ends.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

from db import pairs, steps
from db import work as queue
from db.session import database
from db.settings import settings
from workers.app import send_work
from workers.pairs import certify_pairs
from workers.steps import carry_out

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Piece:
    """Says which job a piece of work belonged to, and whether the job waits for nothing more before its next decision."""

    job_id: str
    settles: bool


def work() -> Piece | None:
    """Does the next piece of work. It does no harm to call it too often.

    It returns None when there is none, or no room for what it would find. The sweeper asks again as long as work is open.
    """
    if trouble := database().disk.trouble():
        log.warning("no work is begun: %s", trouble)
        return None
    claim, more = claim_piece()
    if claim is None:
        return None
    if more:
        send_work()
    return do(claim)


def do(claim: pairs.Claim | steps.Claim) -> Piece:
    """Does a claimed piece of work."""
    settles = carry_out(claim) if isinstance(claim, steps.Claim) else certify_pairs(claim)
    return Piece(claim.job_id, settles)


def claim_piece() -> tuple[pairs.Claim | steps.Claim | None, bool]:
    """Claims the next piece, and says whether work is left for others."""
    claim, more, limits = None, False, settings()
    while claim is None:
        with database().read() as session:
            job_id = queue.next_job(session)
        if job_id is None:
            break
        with database().write() as session:
            claim = queue.claim(session, job_id, lease_seconds=limits.lease_seconds, batch_seconds=limits.batch_seconds)
        with database().read() as session:  # when others may claim already
            more = queue.is_there(session)
    return claim, more
