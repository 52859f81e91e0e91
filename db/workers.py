"""This module knows the workers that live: what each of them is, and what people want of it.

A worker writes its row and tells again and again that it lives. Times are those of the database's clock. A worker that has said nothing
for ``GONE_SECONDS`` is gone, and its row with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import timedelta
from enum import StrEnum
from uuid import uuid4

from sqlalchemy import ColumnElement, delete, func, select, update
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import clock, leases, pages
from db.ids import expanded
from db.models import WorkerRow
from db.pages import Page
from db.states import WORKER, WorkerState, sources

GONE_SECONDS = 60.0
"""A worker that has said nothing for this many seconds is gone."""
COMING = frozenset({WorkerState.STARTING, WorkerState.COMPILING})
"""A worker in one of these states takes no work yet, and will by itself."""
REACHING_QUEUE = "reaching the queue"
"""What a control worker that the queue does not answer says that fails."""


class WorkerKind(StrEnum):
    """Says which queue a worker serves."""

    CONTROL = "control"
    """It coordinates jobs, sweeps and delivers webhooks."""
    SOLVE = "solve"
    """It certifies pairs and does steps."""


@dataclass(frozen=True)
class Made:
    """Says what a worker is made of, which does not change while it lives.

    Attributes:
        process: ``host:pid:start``.
        version: version of ciris.
        processes: how many pieces of work it does at the same time.
    """

    process: str
    kind: WorkerKind
    version: str
    processes: int
    cores: int
    memory_bytes: int


@dataclass(frozen=True)
class Alike:
    """Counts the workers of one kind, version and state, and the pieces of work that they do at the same time."""

    kind: WorkerKind
    version: str
    state: WorkerState
    workers: int
    processes: int


def tell(session: Session, made: Made, state: WorkerState, trouble: str | None = None) -> WorkerState:
    """Says that a worker lives, what it does and what fails, and returns what is wanted of it.

    A worker without a row, because it is new or was believed gone, gets one, and is wanted to go on with what it does, or to run if it
    starts.
    """
    now = clock.now(session)
    known = update(WorkerRow).where(WorkerRow.process == made.process).values(state=state, trouble=trouble, seen_at=now)
    wanted = session.scalar(known.returning(WorkerRow.wanted))
    if wanted is None:
        wanted = WorkerState.RUNNING if state in COMING else state
        new = WorkerRow(id=str(uuid4()), **asdict(made), wanted=wanted, state=state, trouble=trouble, created_at=now, seen_at=now)
        session.add(new)
    return WorkerState(wanted)


def wanted(session: Session, process: str) -> WorkerState | None:
    """Returns what is wanted of the worker; None where it has no row."""
    found = session.scalar(select(WorkerRow.wanted).where(WorkerRow.process == process))
    return None if found is None else WorkerState(found)


def state(session: Session, process: str) -> WorkerState | None:
    """Returns what the worker does, as it said last; None where it has no row."""
    found = session.scalar(select(WorkerRow.state).where(WorkerRow.process == process))
    return None if found is None else WorkerState(found)


def leave(session: Session, process: str) -> None:
    """Deletes the row of a worker that ends."""
    session.execute(delete(WorkerRow).where(WorkerRow.process == process))


def page(session: Session, after: str | None = None, limit: int = 100) -> Page[WorkerRow]:
    """Returns one page of the workers that live, those that began last first.

    Raises:
        CirisError: cursor.
    """
    return pages.page(session, WorkerRow, select(WorkerRow).where(_lives(session)), after, limit)


def get(session: Session, worker_id: str) -> WorkerRow:
    """Returns the worker with this id, or with the only id that begins like this.

    Raises:
        CirisError: worker_not_found, also for one that is gone; ambiguous_id.
    """
    row = session.scalar(select(WorkerRow).where(WorkerRow.id == expanded(session, WorkerRow.id, worker_id), _lives(session)))
    if row is None:
        raise CirisError(
            "worker_not_found", f"there is no worker {worker_id!r}", field="worker", hint="GET /v1/workers lists those that live"
        )
    return row


def ask(session: Session, worker_id: str, state: WorkerState) -> WorkerRow:
    """Asks a worker to run, pause or drain, and returns it as it is now. It learns of it within seconds.

    Raises:
        CirisError: worker_not_found; ambiguous_id; worker_draining, because that cannot be taken back.
    """
    row = get(session, worker_id)
    may = (WorkerRow.id == row.id, WorkerRow.wanted.in_({state, *sources(WORKER, state)}))
    if not session.scalars(update(WorkerRow).where(*may).values(wanted=state).returning(WorkerRow.id)).all():
        raise CirisError("worker_draining", "the worker is ending", field="worker", hint="start another one")
    session.refresh(row)
    return row


def gone(session: Session) -> Sequence[str]:
    """Returns the ids of the workers that have ended without leaving: those that say nothing, and those seen to be dead on this host."""
    rows = session.execute(select(WorkerRow.id, WorkerRow.process, _lives(session)))
    return [id for id, process, lives in rows if not lives or leases.is_alive(process) is False]


def living(session: Session) -> list[str]:
    """Returns the processes of the workers that live, with their versions. It reads columns that the table has had at every revision."""
    rows = session.execute(select(WorkerRow.process, WorkerRow.version).where(_lives(session)).order_by(WorkerRow.process))
    return [f"{process} (version {of})" for process, of in rows if leases.is_alive(process) is not False]


def forget(session: Session, ids: Sequence[str]) -> None:
    """Deletes the rows of workers that are gone."""
    session.execute(delete(WorkerRow).where(WorkerRow.id.in_(ids)))


def counts(session: Session) -> dict[tuple[str, str], int]:
    """Returns how many workers of each kind are in each state. One that no worker is in counts zero."""
    found = session.execute(
        select(WorkerRow.kind, WorkerRow.state, func.count()).where(_lives(session)).group_by(WorkerRow.kind, WorkerRow.state)
    )
    return {(kind.value, state.value): 0 for kind in WorkerKind for state in WorkerState} | {(kind, state): n for kind, state, n in found}


def alike(session: Session) -> list[Alike]:
    """Returns the workers that live, those of one kind, version and state together."""
    what = (WorkerRow.kind, WorkerRow.version, WorkerRow.state)
    found = session.execute(
        select(*what, func.count(), func.sum(WorkerRow.processes)).where(_lives(session)).group_by(*what).order_by(*what)
    )
    return [Alike(WorkerKind(kind), version, WorkerState(state), workers, processes) for kind, version, state, workers, processes in found]


def solvers(session: Session) -> int:
    """Returns how many pieces of work the workers that take work do at the same time."""
    taking = (_lives(session), WorkerRow.kind == WorkerKind.SOLVE, WorkerRow.state == WorkerState.RUNNING)
    return session.scalar(select(func.sum(WorkerRow.processes)).where(*taking)) or 0


def in_trouble(session: Session) -> int:
    """Returns how many of the workers that live say that something fails."""
    return session.scalar(select(func.count()).select_from(WorkerRow).where(_lives(session), WorkerRow.trouble.is_not(None))) or 0


def miss_queue(session: Session) -> bool:
    """Says whether the queue does not answer a worker that lives."""
    said = select(WorkerRow.id).where(_lives(session), WorkerRow.trouble.contains(REACHING_QUEUE))
    return session.scalar(said.limit(1)) is not None


def _lives(session: Session) -> ColumnElement[bool]:
    return WorkerRow.seen_at > clock.now(session) - timedelta(seconds=GONE_SECONDS)
