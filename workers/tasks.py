"""The tasks by name: thin, ids in, nothing out. A worker registers those of the queue that it serves and imports only what they need."""

from __future__ import annotations

from celery import Celery, Task
from structlog.contextvars import bound_contextvars

from workers.app import CONTROL, COORDINATE, RUN_STEP, SOLVE_PAIRS


def register(app: Celery, queue: str) -> None:
    """Registers the tasks of one queue, importing their code now (before the worker forks)."""
    if queue == CONTROL:
        from workers.turns import coordinate

        @app.task(name=COORDINATE)
        def _coordinate(job_id: str) -> None:
            with bound_contextvars(job=job_id):
                coordinate(job_id)

        return

    from workers.pairs import solve_pairs
    from workers.steps import run_step

    @app.task(name=SOLVE_PAIRS, bind=True)
    def _solve_pairs(self: Task, job_id: str, iteration: int, indices: list[int]) -> None:
        solve_pairs(job_id, iteration, indices, self.request.id)

    @app.task(name=RUN_STEP, bind=True)
    def _run_step(self: Task, step_id: int) -> None:
        run_step(step_id, self.request.id)
