"""What a test does in the place of workers: all the work there is, a deadline that has passed, and errors."""

from __future__ import annotations

from datetime import timedelta

from db import jobs
from db.session import database
from db.types import utcnow
from tests.workers.options import grow_box
from workers.solver import Piece, work

ELSEWHERE = "elsewhere:1:1"
WHOLE = grow_box([0.0], 0.9, cells=600)


class Away(Exception):
    """What SQLAlchemy's error wraps."""


def work_all() -> list[Piece]:
    """Does what is to be done until nothing is, and coordinates nothing."""
    return list(iter(work, None))


def late(job_id: str) -> None:
    with database().write() as session:
        jobs.lock(session, job_id).deadline_at = utcnow() - timedelta(seconds=1)


def raise_(error: Exception, *_given: object, **_: object) -> None:
    raise error
