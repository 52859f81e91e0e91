"""The rows of a motion that is certified: one step certifies all of it, and the job ends with the verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from sqlalchemy.orm import Session

from certifier.errors import CirisError
from certifier.growth.actions import Failed, Finish
from certifier.outcome import Outcome
from db import jobs, steps
from db.models import JobRow
from db.states import STEP, StepKind, StepState, unfinished
from workers.app import send_work
from workers.transaction import Afterwards


@dataclass(frozen=True)
class Search:
    """Asks for the step that certifies the motion; the report is a Verdict or Failed."""

    kind: ClassVar[str] = "motion"


@dataclass(frozen=True)
class Verdict:
    """Reports what has become of the motion, and says it in a sentence."""

    outcome: Outcome
    reason: str

    @classmethod
    def of(cls, found: dict[str, Any]) -> Verdict:
        """Returns the verdict that a step has reported (certifier.jobs.motion.MotionVerdict)."""
        outcome, stop = Outcome(found["outcome"]), found["stop"]
        if stop is None:
            return cls(outcome, "every pair is certified all along the motion")
        touch = "come nearer than the padding of the request allows" if found.get("padding") else "touch"
        how = {Outcome.REFUTED: touch, Outcome.TOO_CLOSE: "are too close to tell"}.get(outcome, "are where the search ended")
        return cls(outcome, f"{stop['a']} and {stop['b']} {how}, on piece {stop['piece']}; pieces count from 0")


Action = Search | Finish


def next_action(report: object) -> Action:
    """Returns the first action of a job about a motion, which has no report yet, or its end.

    Raises:
        CirisError: why the motion could not be certified.
    """
    match report:
        case None:
            return Search()
        case Failed():
            raise report.error
        case Verdict():
            return Finish(report.outcome, report.reason)
        case _:
            raise ValueError("a motion ends with its verdict")


def report(session: Session, job: JobRow) -> Verdict | Failed | None:
    """Returns the report on the step that certifies the motion; None while it has not ended."""
    step = steps.of_turn(session, job, StepKind.MOTION)
    if step is None or step.state in unfinished(STEP):
        return None
    found = step.report or {}
    return Failed(CirisError.from_document(found)) if step.state == StepState.FAILED else Verdict.of(found)


def save(session: Session, job: JobRow, action: Action, afterwards: Afterwards) -> bool:
    """Saves the job's next turn, with the row of its step. The caller holds the job's lock.

    It returns True when the end of the job is to be decided.
    """
    if isinstance(action, Finish):
        jobs.next_turn(job, {"kind": action.kind, "outcome": action.outcome.value, "reason": action.reason})
        return True
    jobs.next_turn(job, {"kind": action.kind})
    steps.add(session, job, StepKind.MOTION, {})
    afterwards.append(send_work)
    return False
