"""These pure functions decide what happens next in a job: from what the database holds they compute what it shall hold.

:mod:`certifier.growth.machine` decides about the mathematics, such as which polytope is certified next. This module turns the outcomes
of rows into the machine's reports, and says how a job ends. Nothing here reads or writes anything.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from certifier.errors import CirisError
from certifier.growth.actions import Failed, Report, Transition
from certifier.growth.machine import advance, begin, stored_state
from certifier.growth.options import GrowthOptions
from certifier.growth.refusal import DEADLINE, refusal
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.seeding.proposal import Proposal
from certifier.step.stepped import Stepped
from db.states import JobKind, JobState, StepKind, StepState


def next_transition(scene: Scene, options: dict[str, Any], state: dict[str, Any] | None, report: Report | None) -> Transition:
    """Returns the first transition of a job, which has no state yet, or the transition that follows a report.

    Raises:
        CirisError: as :meth:`GrowthOptions.from_document`, :func:`stored_state` and :func:`begin`.
    """
    parsed = GrowthOptions.from_document(options)
    if state is None:
        return begin(scene, parsed)
    if report is None:
        raise ValueError("a job that has begun advances with a report")
    return advance(scene, stored_state(state, parsed), report)


def step_report(kind: StepKind, state: StepState, report: dict[str, Any]) -> Report:
    """Returns the report of a seeding or a polytope step from its row."""
    if state == StepState.FAILED:
        return Failed(CirisError.from_document(report))
    return Proposal.from_document(report) if kind == StepKind.PROPOSE else Stepped.from_document(report)


@dataclass(frozen=True)
class Ending:
    """Says how a job ends."""

    state: JobState
    outcome: Outcome
    reason: str
    error: dict[str, Any] | None = None


def ending(kind: str, outcome: Outcome, reason: str, error: dict[str, Any] | None) -> Ending:
    """Returns how a job ends whose growth has finished.

    A ``certify`` or ``certify-path`` job succeeds with any verdict, a ``cover`` unless something went wrong, the others only with a
    certified region.

    Args:
        error: what went wrong during the job, if something did.
    """
    if kind == JobKind.COVER:
        return Ending(JobState.FAILED if error else JobState.SUCCEEDED, outcome, reason, error)
    if outcome == Outcome.CERTIFIED or (kind in (JobKind.CERTIFY, JobKind.CERTIFY_PATH) and outcome != Outcome.ERROR):
        return Ending(JobState.SUCCEEDED, outcome, reason)
    return Ending(JobState.FAILED, outcome, reason, error or refusal(reason, late=reason == DEADLINE).to_document())
