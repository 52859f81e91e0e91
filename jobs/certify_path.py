"""A job that certifies a motion, or finds its first contact: one step certifies all of it, and the job ends with the verdict."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator
from sqlalchemy.orm import Session

from certifier.conditions import fails
from certifier.errors import CirisError
from certifier.growth.actions import Finish
from certifier.model import Scene
from certifier.motion.given import motion_of
from certifier.motion.padding import padding_of
from certifier.outcome import Outcome
from certifier.proof.motion import Space
from db import jobs, proofs, steps
from db.models import JobRow
from db.session import Database, database
from db.transaction import Afterwards, persistently
from jobs import obstacles
from jobs.curves import BEZIER, CONTROL_POINTS, KNOTS, Bezier, ControlPoints, Knots, one_curve
from jobs.fields import Flag, NamedPoints, Points, Real, Request
from jobs.kind import Done, Held, Kind, Turn, in_child, report_of
from jobs.request import JobRequest
from workers.app import send_work

MOTION = "motion"
"""The kind of the step, and of the action that asks for it."""
CERTIFY = "certifier.jobs.motion:certify_in_child"
MAX_PIECES = 2000
Waypoints = Annotated[Points, Field(min_length=2, max_length=2000)]
NamedWaypoints = Annotated[NamedPoints, Field(min_length=2, max_length=2000)]


class GivenMotion(Request):
    """Gives a motion: straight between waypoints `q` or `s`, or along Bezier pieces or a B-spline."""

    q: NamedWaypoints | None = Field(None, description="(k, n), joint positions in radians or metres, one row for each waypoint.")
    s: Waypoints | None = Field(None, description="(k, n), tangent-space coordinates s, one row for each waypoint.")
    bezier: Bezier | None = Field(None, max_length=MAX_PIECES, description=BEZIER)
    knots: Knots | None = Field(None, description=KNOTS)
    control_points: ControlPoints | None = Field(None, description=CONTROL_POINTS)
    space: Space | None = Field(
        None,
        description="In which coordinates the motion is straight; without it, in those given. Of `bezier` and `control_points`, which ones "
        "they are; without it, joint positions.",
    )
    tube: Flag = Field(False, description="Whether to look for the largest certified tube about the motion.")
    padding: Real = Field(
        0.0,
        ge=0,
        description="Metres that are added around every body, beyond the scene's padding. So the bodies of a pair have to be twice this "
        "farther apart.",
    )
    clearance: Flag = Field(
        False, description="Whether to prove a bound that is nearly the least distance of the bodies: `clearance` of the answer."
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        one_curve(self.q, self.s, self.bezier, self.knots, self.control_points)
        return self


class CertifyPathRequest(JobRequest, GivenMotion):
    """Asks for a proof of a motion, or for its first contact, where that takes longer than a request may."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"kind": "certify-path", "scene": "planar-2dof", "q": [[0.2, -0.4], [-0.4, 0.3]], "clearance": True}]
        }
    )

    kind: Literal["certify-path"] = Field(description="The kind of the job.")


@dataclass(frozen=True)
class Search:
    """An action: certify the motion, in one step. The report is a Verdict."""


@dataclass(frozen=True)
class Verdict:
    """A report: the outcome for the motion, with a sentence about it."""

    outcome: Outcome
    reason: str

    @classmethod
    def of(cls, found: dict[str, Any]) -> Verdict:
        """Returns the verdict that a step has reported (certifier.jobs.motion.MotionVerdict)."""
        outcome, stop = Outcome(found["outcome"]), found["stop"]
        if stop is None:
            return cls(outcome, "every pair is certified all along the motion")
        return cls(outcome, f"{fails(stop['a'], stop['b'], _how(found))}, on piece {stop['piece']}; pieces count from 0")


def _how(found: dict[str, Any]) -> str:
    """Returns what the two bodies do where a motion could not be certified. A contact is proved, whatever floating point says."""
    touch = "come nearer than the padding of the request allows" if found.get("padding") else "touch"
    return {Outcome.REFUTED: touch, Outcome.TOO_CLOSE: "are too close to tell"}.get(Outcome(found["outcome"]), "are where the search ended")


class CertifyPath(Kind):
    """Certifies a motion, or finds its first contact. The job succeeds with any verdict."""

    name = "certify-path"
    subject = "the motion"
    request = CertifyPathRequest
    template = "kinds/motion.html"

    def options(self, body: GivenMotion, scene: Scene, db: Database) -> dict[str, Any]:
        return checked(scene, body)

    def decide(self, turn: Turn) -> Search | Finish:
        match turn.report:
            case CirisError() as error:
                raise error
            case Verdict() as verdict:
                return Finish(verdict.outcome, verdict.reason)
            case _:
                return Search()

    def report(self, session: Session, job: JobRow, state: dict[str, Any] | None) -> Verdict | CirisError | None:
        found = report_of(session, job, MOTION)
        return Verdict.of(found) if isinstance(found, dict) else found

    def save(self, session: Session, job: JobRow, turn: Turn, decision: Search | Finish, afterwards: Afterwards) -> bool:
        if isinstance(decision, Finish):
            jobs.next_turn(job, jobs.finishing(decision.outcome, decision.reason))
            return True
        jobs.next_turn(job, {"kind": MOTION})
        steps.add(session, job, MOTION, {})
        afterwards.append(send_work)
        return False

    def do(self, claim: steps.Claim, scene: Scene) -> Done:
        """Certifies the motion of the job in a separate process, which also verifies the proof."""

        def read() -> dict[str, Any]:
            with database().read() as session:
                return jobs.get(session, claim.job_id).options

        kept = scene.hash, json.dumps(scene.to_document())
        found = in_child(CERTIFY, {"space": None, **persistently(read), "prove": True}, kept)
        if found["proof"] is None:
            return Done(found)
        proof = base64.b64decode(found["proof"])

        def save(session: Session, job: JobRow) -> None:
            steps.keep_proof(session, claim, proof)

        return Done({**found, "proof": proofs.digest(proof)}, save)

    def is_late(self, session: Session, job: JobRow, now: datetime) -> bool:
        """Says whether the deadline ends the job. A motion that has its verdict ends with it."""
        return super().is_late(session, job, now) and self.verdict(session, job) is None

    def failure(self, finish: Finish, error: dict[str, Any] | None) -> dict[str, Any] | None:
        return error if finish.outcome is Outcome.ERROR else None

    def held(self, session: Session, scene: Scene, job: JobRow) -> list[Held]:
        verdict = self.verdict(session, job)
        return [] if verdict is None or verdict["stop"] is None else [obstacles.of_motion(scene, verdict["stop"], _how(verdict))]

    def result(self, session: Session, job: JobRow) -> dict[str, Any]:
        """Returns the ``verdict``, or None before it."""
        return {"verdict": self.verdict(session, job)}

    def verdict(self, session: Session, job: JobRow) -> dict[str, Any] | None:
        """Returns what the step of a job has found; None while it has not ended, where it has failed, and for another kind of job."""
        return steps.found(session, job.id, MOTION)


def checked(scene: Scene, body: GivenMotion) -> dict[str, Any]:
    """Returns the motion of a request as certifier.motion.given.motion_of takes it, with ``space`` where it was given, ``tube``,
    ``padding`` and ``clearance``.

    Raises:
        RegionError: as motion_of; the field names the place.
    """
    padding_of(body.padding)
    document = body.model_dump(mode="json", include=set(GivenMotion.model_fields), exclude_none=True)
    motion_of(scene, document, Space(body.space) if body.space else None)
    return document
