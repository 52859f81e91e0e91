"""Workers come and go. These routes list those that live with what they do, and ask them to pause, go on or end.

Workers serve all projects. Everybody sees them, and of their work what belongs to the own project. Only admins of the project
``default``, who run the service, may ask something of them.
"""

from __future__ import annotations

from collections.abc import Sequence

from fastapi import APIRouter, status

from api import held
from api.access import READ, Admin, Caller, Db
from api.reading import ReadingRoute
from api.schemas.common import Cursor, Listed, WorkerGiven
from api.schemas.workers import Worker, WorkerPage
from api.writing import writing
from certifier.errors import CirisError
from db import activity, audit, clock, jobs, leases, workers
from db.audit import Action
from db.models import PairRow, StepRow, WorkerRow
from db.session import Database
from db.states import WorkerState
from db.workers import WorkerKind

router = APIRouter(prefix="/v1/workers", tags=["workers"], dependencies=[READ], route_class=ReadingRoute)


@router.get("")
def list_workers(db: Db, after: Cursor = None, limit: Listed = 100) -> WorkerPage:
    """Lists the workers that live, with what they do at this moment, those that began last first."""
    with db.read() as session:
        page, counts = workers.page(session, after, limit), workers.counts(session)
    missing = [said for kind in WorkerKind if (said := activity.missing(counts, kind)) is not None]
    return WorkerPage(workers=_described(db, page.rows), missing=list(dict.fromkeys(missing)), next=page.next)


@router.get("/{worker_id}")
def get_worker(worker_id: WorkerGiven, db: Db) -> Worker:
    """Returns one worker with what it does at this moment."""
    with db.read() as session:
        row = workers.get(session, worker_id)
    return _described(db, [row])[0]


@router.post("/{worker_id}/pause", status_code=status.HTTP_202_ACCEPTED)
@writing
def pause_worker(worker_id: WorkerGiven, caller: Admin, db: Db) -> Worker:
    """Asks a worker to finish what it holds and to take no more until it is resumed."""
    return _ask(db, caller, worker_id, WorkerState.PAUSED)


@router.post("/{worker_id}/resume", status_code=status.HTTP_202_ACCEPTED)
@writing
def resume_worker(worker_id: WorkerGiven, caller: Admin, db: Db) -> Worker:
    """Asks a paused worker to take work again."""
    return _ask(db, caller, worker_id, WorkerState.RUNNING)


@router.post("/{worker_id}/drain", status_code=status.HTTP_202_ACCEPTED)
@writing
def drain_worker(worker_id: WorkerGiven, caller: Admin, db: Db) -> Worker:
    """Asks a worker to finish what it holds, and then to end with status 0.

    Nothing takes that back. What supervises the worker may start another one.
    """
    return _ask(db, caller, worker_id, WorkerState.DRAINING)


_NOTED = {
    WorkerState.PAUSED: Action.WORKER_PAUSED,
    WorkerState.RUNNING: Action.WORKER_RESUMED,
    WorkerState.DRAINING: Action.WORKER_DRAINED,
}


def _ask(db: Database, caller: Caller, worker_id: str, state: WorkerState) -> Worker:
    if not caller.runs_service:
        problem = f"workers serve all projects; {caller.name!r} belongs to the project {caller.project}"
        raise CirisError(
            "workers_shared", problem, field="Authorization", hint="ask those who run the service: admins of the project default"
        )
    with db.write() as session:
        row = workers.ask(session, worker_id, state)
        audit.note(session, caller.project, str(caller), _NOTED[state], row.process)
    return _described(db, [row])[0]


def _described(db: Database, rows: Sequence[WorkerRow]) -> list[Worker]:
    processes = {row.process for row in rows}
    with db.read() as session:
        now = clock.now(session)
        busy = leases.count_of_workers(session)
        pairs, steps = leases.of_workers(session, PairRow, processes), leases.of_workers(session, StepRow, processes)
        decided = [job for job in jobs.coordinated_by(session, processes) if jobs.is_coordinated(job, now)]
    return [
        Worker.of(
            row,
            busy[row.process],
            [
                *held.certifying([pair for pair in pairs if pair.parent == row.process]),
                *(held.doing(step) for step in steps if step.parent == row.process),
                *(held.deciding(job) for job in decided if job.coordinator == row.process),
            ],
        )
        for row in rows
    ]
