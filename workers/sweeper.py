"""The sweeper: finds work that was lost with a worker, a message or Redis itself, and sends it again.

It runs beside the control worker. Several of them, or one that is late, do no harm.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Sequence
from datetime import datetime, timedelta
from functools import partial

from kombu.exceptions import OperationalError

from db import jobs, leases
from db.models import PairRow, StepRow
from db.session import database
from db.settings import settings
from db.types import utcnow
from workers.app import SOLVE, send_coordinate, send_pairs, send_step, waiting
from workers.coordinator import batches
from workers.transaction import Afterwards, writing

log = logging.getLogger(__name__)


def run(stop: threading.Event) -> None:
    """Sweeps until ``stop`` is set. A round that fails (the database or Redis is away) is logged, and the next one tries again."""
    while not stop.wait(settings().sweep_seconds):
        try:
            sweep()
        except OperationalError as error:
            log.warning("Redis cannot be reached; nothing was sent again: %s", error)
        except Exception:
            log.exception("a round of the sweeper failed")


def sweep() -> None:
    """One round: frees what dead workers held, sends again what no message stands for any more, asks for due coordinations."""
    now = utcnow()
    _release_lost(PairRow)
    _release_lost(StepRow)
    if waiting(SOLVE) == 0:
        # With no message waiting, an open row that was sent a while ago has lost its message.
        before = now - timedelta(seconds=settings().resend_seconds)
        _send_again(PairRow, before)
        _send_again(StepRow, before)
    with database().read() as session:
        due = jobs.awaiting_coordination(session, now)
    for job_id in due:
        send_coordinate(job_id)


def _release_lost(model: type[leases.Row]) -> None:
    with database().read() as session:
        lost = leases.lost(session, model)
    for job_id, token in lost:
        with writing() as (session, afterwards):
            jobs.lock(session, job_id)
            _send(leases.release(session, model, token), afterwards)


def _send_again(model: type[leases.Row], sent_before: datetime) -> None:
    with database().read() as session:
        affected = leases.unclaimed(session, model, sent_before)
    for job_id in affected:
        with writing() as (session, afterwards):
            jobs.lock(session, job_id)
            _send(leases.resend(session, model, job_id, sent_before), afterwards)


def _send(rows: Sequence[PairRow] | Sequence[StepRow], afterwards: Afterwards) -> None:
    groups: dict[tuple[str, int], list[tuple[int, float]]] = {}
    for row in rows:
        if isinstance(row, StepRow):
            afterwards.append(partial(send_step, row.id))
        else:
            groups.setdefault((row.job_id, row.iteration), []).append((row.pair_index, row.forecast_seconds))
    for (job_id, iteration), pairs in groups.items():
        afterwards.append(partial(send_pairs, job_id, iteration, batches(pairs, settings().batch_seconds)))
