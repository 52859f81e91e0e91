"""This module registers the thin Celery tasks by name. They return nothing.

A worker registers the tasks of the queue that it serves, and imports only what they need.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from celery import Celery, Task
from structlog.contextvars import bound_contextvars

from db.session import UNAVAILABLE
from db.settings import settings
from workers.app import CONTROL, COORDINATE, WORK
from workers.messages import Acknowledged

log = logging.getLogger(__name__)


def register(app: Celery, queue: str) -> None:
    """Registers the tasks of one queue. It imports their code now, before the worker forks."""
    if queue == CONTROL:
        from workers.turns import coordinate

        @app.task(name=COORDINATE, Request=Acknowledged)
        def _coordinate(job_id: str) -> None:
            with bound_contextvars(job=job_id), _left_to_the_sweeper():
                coordinate(job_id)

        return

    from workers.slots import Slots
    from workers.solver import work
    from workers.spare import work_for_newcomer
    from workers.sweeper import release_lost
    from workers.turns import coordinate

    slots = Slots(settings().solve_processes)

    @app.task(name=WORK, bind=True, Request=Acknowledged)
    def _work(self: Task) -> None:
        with _left_to_the_sweeper(), slots.one() as mine:
            if self.request.delivery_info.get("redelivered"):
                release_lost(by_time=False)  # the worker that had this message has died
            piece = work() if mine else work_for_newcomer(slots)
            if piece is not None and piece.settles:
                coordinate(piece.job_id)


@contextmanager
def _left_to_the_sweeper() -> Iterator[None]:
    """Ends a task early whose database cannot be used. Nothing was begun then, and the sweeper asks again."""
    try:
        yield
    except UNAVAILABLE as error:
        log.warning("the database cannot be used; the sweeper asks again: %s", error)
