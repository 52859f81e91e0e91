"""This module holds the states of jobs, pairs, steps, iterations and webhooks, and their legal transitions as data.

:func:`transition` is the one function that changes a state. It is a conditional update: it changes only rows in a state from which
the new one may be reached, and returns how many those were. So of two processes that race for one transition only one wins.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Any, cast

import sqlalchemy
from sqlalchemy import ColumnElement, CursorResult, bindparam, update
from sqlalchemy.orm import Session

if TYPE_CHECKING:
    from db.models import IterationRow, JobRow, PairRow, StepRow, WebhookRow


class JobState(StrEnum):
    QUEUED = "queued"
    """The job is committed, but no coordinator has looked at it yet."""
    RUNNING = "running"
    """The job has work that is open or running, or soon will have some."""
    CANCELLING = "cancelling"
    """Someone asked to cancel the job; its work is being stopped."""
    SUCCEEDED = "succeeded"
    """The job has its answer: a certified region (grow, recertify), a verdict for the polytope (certify) or the motion
    (certify-path), or what it covers (cover)."""
    FAILED = "failed"
    """The job ended without an answer; ``error`` says why. Regions certified before remain."""
    CANCELLED = "cancelled"
    """The job ended by request. Regions certified before remain."""


class PairState(StrEnum):
    OPEN = "open"
    """The pair is to be certified; no worker has claimed it."""
    RUNNING = "running"
    """A worker has claimed the pair, until ``lease_until``."""
    CERTIFIED = "certified"
    """The pair has a verified proof (``proof_digest``)."""
    REFUTED = "refuted"
    """A configuration in collision is known (``witness_s``)."""
    NOT_CERTIFIABLE = "not_certifiable"
    """No certificate of this degree exists in this frame."""
    TOO_CLOSE = "too_close"
    """The bodies come so close that no plane was found in a narrow cell; ``witness_s`` names a configuration, ``detail`` the distance."""
    INCONCLUSIVE = "inconclusive"
    """The search stopped before an answer; ``detail`` says why."""
    ERROR = "error"
    """The program failed, or its worker died too often; ``detail`` says why."""
    SKIPPED = "skipped"
    """The pair is not needed any more: another pair failed first, or the job ended."""


class StepState(StrEnum):
    OPEN = "open"
    """The step waits; no worker has claimed it."""
    RUNNING = "running"
    """A worker has claimed the step, until ``lease_until``."""
    DONE = "done"
    """The step has its report."""
    FAILED = "failed"
    """The step failed; ``report`` says why. After a failed ``accept`` the region is not served: its proof was refused."""
    SKIPPED = "skipped"
    """The step is not needed any more: the job ended, or (``accept``) a later region was accepted."""


ACCEPT = "accept"
"""The kind of the step that assembles, verifies and stores the region of a certified polytope. The job does not wait for it."""


LEAD = "map"
"""The kind of the step that leads the job of a map. It gives way to other jobs by itself."""


PIECE = "piece"
"""The kind of the steps that share one round of a map (db.maps). They have no events, because there are thousands of them."""


class IterationState(StrEnum):
    RUNNING = "running"
    """Some pairs of the iteration are open or running."""
    CERTIFIED = "certified"
    """Every pair has a verified proof."""
    FAILED = "failed"
    """At least one pair was not certified."""
    SKIPPED = "skipped"
    """The job ended before the iteration did."""


class WebhookState(StrEnum):
    WAITING = "waiting"
    """The job has not ended, or the receiver has not confirmed its end yet."""
    DELIVERED = "delivered"
    """The receiver has answered with a status of success."""
    FAILED = "failed"
    """The service has given up; ``error`` says why."""


class WorkerState(StrEnum):
    STARTING = "starting"
    """The worker loads what it calls, and takes no work yet. Nobody can want that of it."""
    COMPILING = "compiling"
    """It starts, and some of what it calls has to be compiled first, which takes minutes, once on a machine."""
    RUNNING = "running"
    """The worker takes work."""
    PAUSED = "paused"
    """The worker finishes what it holds, and takes no more until somebody resumes it."""
    DRAINING = "draining"
    """The worker finishes what it holds, and then ends. Nothing takes that back."""


Table = Mapping[str, frozenset[str]]


def _table(states: type[StrEnum], moves: dict[StrEnum, set[StrEnum]]) -> Table:
    return {state: frozenset(moves.get(state, ())) for state in states}


JOB: Table = _table(
    JobState,
    {
        JobState.QUEUED: {JobState.RUNNING, JobState.CANCELLED},
        JobState.RUNNING: {JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLING},
        JobState.CANCELLING: {JobState.CANCELLED},
    },
)
_SETTLED_PAIR: set[StrEnum] = {
    PairState.CERTIFIED,
    PairState.REFUTED,
    PairState.NOT_CERTIFIABLE,
    PairState.TOO_CLOSE,
    PairState.INCONCLUSIVE,
    PairState.ERROR,
}
PAIR: Table = _table(
    PairState,
    {
        PairState.OPEN: {PairState.RUNNING, PairState.SKIPPED},
        PairState.RUNNING: {PairState.OPEN, PairState.SKIPPED} | _SETTLED_PAIR,
    },
)
STEP: Table = _table(
    StepState,
    {
        StepState.OPEN: {StepState.RUNNING, StepState.SKIPPED},
        StepState.RUNNING: {StepState.OPEN, StepState.DONE, StepState.FAILED, StepState.SKIPPED},
    },
)
ITERATION: Table = _table(
    IterationState,
    {IterationState.RUNNING: {IterationState.CERTIFIED, IterationState.FAILED, IterationState.SKIPPED}},
)
WEBHOOK: Table = _table(
    WebhookState,
    {
        WebhookState.WAITING: {WebhookState.DELIVERED, WebhookState.FAILED},
        WebhookState.DELIVERED: {WebhookState.WAITING},
        WebhookState.FAILED: {WebhookState.WAITING},
    },
)
WORKER: Table = _table(
    WorkerState,
    {
        WorkerState.RUNNING: {WorkerState.PAUSED, WorkerState.DRAINING},
        WorkerState.PAUSED: {WorkerState.RUNNING, WorkerState.DRAINING},
    },
)


def sources(table: Table, target: str) -> frozenset[str]:
    """Returns the states from which ``target`` may be reached in one transition."""
    return frozenset(state for state, targets in table.items() if target in targets)


def unfinished(table: Table) -> frozenset[str]:
    """Returns the states that some transition leaves."""
    return frozenset(state for state, targets in table.items() if targets)


def transition(
    session: Session,
    model: type[JobRow | PairRow | StepRow | IterationRow | WebhookRow],
    target: str,
    *where: ColumnElement[bool],
    **values: Any,
) -> int:
    """Moves the rows of ``model`` that match ``where`` to ``target``, if the model's table allows it.

    Args:
        values: further columns to set on the rows that move.

    Returns:
        How many rows moved. Rows in a state that does not lead to ``target`` stay as they are.
    """
    moved = update(model).where(*where, model.state.in_(sources(model.transitions, target))).values(state=target, **values)
    return cast("CursorResult[Any]", session.execute(moved)).rowcount


def transition_each(session: Session, model: type[PairRow], source: str, moves: Mapping[int, tuple[str, Mapping[str, Any]]]) -> None:
    """Moves each of these rows from ``source`` to a state of its own, all by one message to the database.

    Rows that the session has loaded do not learn of it.

    Args:
        moves: id -> the state, and further columns to set, the same ones for every row.

    Raises:
        ValueError: the model's table does not allow a move.
    """
    if any(source not in sources(model.transitions, target) for target, _ in moves.values()):
        raise ValueError(f"no row may go from {source} to one of {sorted({target for target, _ in moves.values()})}")
    table = cast("sqlalchemy.Table", model.__table__)
    more = next(iter(moves.values()))[1]
    columns: dict[str, Any] = {name: bindparam(f"new_{name}") for name in ("state", *more)}
    rows = [
        {"row": row, "new_state": target, **{f"new_{name}": value for name, value in values.items()}}
        for row, (target, values) in moves.items()
    ]
    session.connection().execute(update(table).where(table.c.id == bindparam("row"), table.c.state == source).values(columns), rows)
