"""The states of jobs, pairs, steps, iterations and webhooks, their legal transitions as data, and the one function that makes them.

A transition is a conditional update: it changes the rows that are in a state from which the new one may be reached, and
tells how many those were. Two processes that race for the same transition therefore never both win.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Any, cast

from sqlalchemy import ColumnElement, CursorResult, update
from sqlalchemy.orm import Session

if TYPE_CHECKING:
    from db.models import IterationRow, JobRow, PairRow, StepRow, WebhookRow


class JobState(StrEnum):
    QUEUED = "queued"
    """Committed; no coordinator has looked at it yet."""
    RUNNING = "running"
    """Has work open or running, or is about to be given some."""
    CANCELLING = "cancelling"
    """Someone asked to cancel it; its work is being stopped."""
    SUCCEEDED = "succeeded"
    """Has its answer: a certified region (grow), a verdict for the polytope (certify)."""
    FAILED = "failed"
    """Ended without an answer; ``error`` says why. Regions certified before remain."""
    CANCELLED = "cancelled"
    """Ended by request. Regions certified before remain."""


class JobKind(StrEnum):
    GROW = "grow"
    """From a seed to a certified polytope, as large as the options allow."""
    CERTIFY = "certify"
    """One verdict per pair for a given polytope."""


class PairState(StrEnum):
    OPEN = "open"
    """To be certified; nobody is at it."""
    RUNNING = "running"
    """Claimed by a worker until ``lease_until``."""
    CERTIFIED = "certified"
    """Has a verified proof (``proof_digest``)."""
    REFUTED = "refuted"
    """A configuration in collision is known (``witness_s``)."""
    NOT_CERTIFIABLE = "not_certifiable"
    """No certificate of this degree exists in this frame."""
    INCONCLUSIVE = "inconclusive"
    """The search stopped before an answer; ``detail`` says why."""
    ERROR = "error"
    """The program failed, or its worker died too often; ``detail`` says why."""
    SKIPPED = "skipped"
    """Not needed any more: another pair failed first, or the job ended."""


class StepState(StrEnum):
    OPEN = "open"
    """To be done; nobody is at it."""
    RUNNING = "running"
    """Claimed by a worker until ``lease_until``."""
    DONE = "done"
    """Has its report."""
    FAILED = "failed"
    """``report`` says why; for an ``accept`` the region's proof was refused and the region is not served."""
    SKIPPED = "skipped"
    """Not needed any more: the job ended, or (``accept``) a later region was accepted."""


class StepKind(StrEnum):
    PROPOSE = "propose"
    """Seeding: a polytope around the seed, not yet certified."""
    STEP = "step"
    """The polytope step (12) of the alternation."""
    ACCEPT = "accept"
    """Assembling, verifying and storing the region of a certified polytope."""


class IterationState(StrEnum):
    RUNNING = "running"
    """Some of its pairs are open or running."""
    CERTIFIED = "certified"
    """Every pair has a verified proof."""
    FAILED = "failed"
    """At least one pair was not certified."""
    SKIPPED = "skipped"
    """The job ended first."""


class WebhookState(StrEnum):
    WAITING = "waiting"
    """The job has not ended, or its end has not been received yet."""
    DELIVERED = "delivered"
    """The receiver has answered with a status of success."""
    FAILED = "failed"
    """Given up; ``error`` says why."""


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
    {WebhookState.WAITING: {WebhookState.DELIVERED, WebhookState.FAILED}},
)


def sources(table: Table, target: str) -> frozenset[str]:
    """The states from which ``target`` may be reached in one transition."""
    return frozenset(state for state, targets in table.items() if target in targets)


def unfinished(table: Table) -> frozenset[str]:
    """The states that some transition leaves."""
    return frozenset(state for state, targets in table.items() if targets)


def transition(
    session: Session,
    model: type[JobRow | PairRow | StepRow | IterationRow | WebhookRow],
    target: str,
    *where: ColumnElement[bool],
    **values: Any,
) -> int:
    """Moves the rows of ``model`` that match ``where`` to ``target``, as far as the model's table allows it.

    Args:
        values: further columns to set on the rows that move.

    Returns:
        How many rows moved. Rows in a state that does not lead to ``target`` stay as they are.
    """
    moved = update(model).where(*where, model.state.in_(sources(model.transitions, target))).values(state=target, **values)
    return cast("CursorResult[Any]", session.execute(moved)).rowcount
