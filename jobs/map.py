"""A job that grows the map of a scene: what is proved of all of the joint space. One step leads it, and a last one stores what it found."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import datetime, timedelta
from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, Field
from sqlalchemy.orm import Session

from certifier import stored
from certifier.errors import CirisError
from certifier.growth.actions import Finish
from certifier.jobs.map import in_s, ways_of
from certifier.map.ends import ENDS
from certifier.map.options import MapOptions
from certifier.map.trees import Plan
from certifier.model import Scene
from certifier.names import MAX_NAME
from certifier.options import read
from certifier.outcome import Outcome
from certifier.proof.sub_scene import contents_of
from db import jobs, maps, questions, steps
from db.models import JobRow
from db.session import Database
from db.states import ACCEPT, LEAD, PIECE, JobState
from db.transaction import Afterwards
from jobs.checks import check_positions
from jobs.fields import model_of
from jobs.kind import Done, Kind, Turn, report_of
from jobs.mapping import Account, accept, lead, piece
from jobs.request import JobRequest
from jobs.scenes import load_scene
from workers.app import send_work

NONE = "none"
"""As the former map: nothing is taken over."""
GRACE = timedelta(seconds=30)
"""The process that leads a job ends at the deadline by itself. Where it has not after this time, it is gone."""


class MapRequestOptions(model_of(MapOptions)):  # type: ignore[misc]
    """Says how much of the free configurations a map is to prove, and what first."""


class MapRequest(JobRequest):
    """Asks for the map of a scene: cells of the joint space in which pairs of bodies are proved apart."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"kind": "map", "scene": "planar-2dof", "deadline_seconds": 60, "options": {"coverage": 0.95}}]}
    )

    kind: Literal["map"] = Field(description="The kind of the job.")
    options: MapRequestOptions = Field(default_factory=MapRequestOptions, description="What to prove, and when to end.")
    former: str | None = Field(
        None,
        max_length=MAX_NAME,
        description="Id of a job that has grown a map, or its first characters. What that map proves of the same bodies is taken over, "
        "such as the robot's own pairs. By default it is the map of the project that proves most about the scene's pairs, and the job's "
        f"options say which one that is. With `{NONE}` nothing is taken over.",
    )


@dataclass(frozen=True)
class Lead:
    """An action: grow the map until it ends, or until other jobs go first.

    Attributes:
        contents: what the pairs are about of which another map is to be taken over, if there is one.
    """

    contents: tuple[str, ...] = ()


@dataclass(frozen=True)
class Ended:
    """A report: why the map has ended; None where it goes on."""

    reason: str | None
    reached: bool


class Map(Kind):
    """Grows the map of a scene. The job succeeds with whatever is proved when it ends."""

    name = "map"
    subject = "the map"
    request = MapRequest
    template = "kinds/map.html"
    estimates = True
    forms: ClassVar = {"options": ("Map", MapOptions)}

    def options(self, body: MapRequest, scene: Scene, db: Database) -> dict[str, Any]:
        given = body.options.model_dump()
        for i, q in enumerate(given["at"]):
            check_positions(scene, q, f"options.at[{i}]")
        for i, path in enumerate(given["paths"]):
            for j, q in enumerate(path):
                check_positions(scene, q, f"options.paths[{i}][{j}]")
        ways_of(scene, given["paths"])  # refuses waypoints that are whole turns away
        former = body.former if body.former in (None, NONE) else _former(body.former, db)
        return {**asdict(read(MapOptions, given, "options")), "former": former}

    def completed(self, options: dict[str, Any], scene_id: str, scene: Scene, db: Database) -> dict[str, Any]:
        """Has the job begin with what was asked, if it is to: the configurations are in its options, so these say what the map is."""
        return {**options, "at": [*options["at"], *_asked(scene_id, scene, db)], "asked": False} if options["asked"] else options

    def decide(self, turn: Turn) -> Lead | Finish:
        match turn.report:
            case CirisError() as error:
                raise error
            case Ended(reason=str() as reason, reached=reached):
                return Finish(Outcome.CERTIFIED if reached else Outcome.INCONCLUSIVE, ENDS[reason])
            case None if turn.options.get("former") is None:
                return Lead(tuple(contents_of(load_scene(turn.scene_id)).values()))
            case _:
                return Lead()

    def report(self, session: Session, job: JobRow, state: dict[str, Any] | None) -> Ended | CirisError | None:
        found = report_of(session, job, LEAD)
        return Ended(found["ended"], found.get("reached", False)) if isinstance(found, dict) else found

    def save(self, session: Session, job: JobRow, turn: Turn, decision: Lead | Finish, afterwards: Afterwards) -> bool:
        if isinstance(decision, Finish):
            jobs.next_turn(job, jobs.finishing(decision.outcome, decision.reason))
            _store(session, job, afterwards)
            return True
        if decision.contents and (known := maps.knows_most(session, job.project, decision.contents)):
            job.options = {**job.options, "former": known}
        former, digest = former_of(job), None
        if former is not None:
            try:
                digest = maps.to_take_over(session, job.id, LEAD, former)
            except CirisError as error:
                job.error = error.to_document()
                jobs.next_turn(job, jobs.finishing(Outcome.ERROR, error.message))
                return True
        jobs.next_turn(job, {"kind": LEAD})
        steps.add(session, job, LEAD, {}).proof_digest = digest
        afterwards.append(send_work)
        return False

    def do(self, claim: steps.Claim, scene: Scene) -> Done:
        return {LEAD: lead, PIECE: piece, ACCEPT: accept}[claim.kind](claim, scene)

    def is_late(self, session: Session, job: JobRow, now: datetime) -> bool:
        """Says whether the deadline ends the job. A process that leads it, or has, gets some time to end it by itself."""
        return super().is_late(session, job, now) and (super().is_late(session, job, now - GRACE) or jobs.untouched(job))

    def stop(self, session: Session, job: JobRow, afterwards: Afterwards) -> None:
        """Has what was found until now stored, also in the round that is under way."""
        if maps.keep_done(session, job):
            _store(session, job, afterwards)

    def result(self, session: Session, job: JobRow) -> dict[str, Any]:
        """Returns how far the map is (``account``, a jobs.mapping.Account), what is stored of it (``map``), why it ended (``ended``), and
        the job whose map is taken over (``former``).

        Each is None as long as there is none.
        """
        known = jobs.growth(session, job.id)
        found = maps.accepted(session, job.id)
        return {
            "account": None if known is None else stored.value(Account, known),
            "map": None if found is None else found[0],
            "ended": _ended(session, job),
            "former": former_of(job),
        }


def _asked(scene_id: str, scene: Scene, db: Database) -> list[list[float]]:
    """Returns the configurations that somebody asked about and nothing proved, without those in collision."""
    with db.read() as session:
        found = questions.latest(session, scene_id)
    return [q for q, free in zip(found, Plan(scene).free(in_s(scene, found)), strict=True) if free]


def _former(job_id: str, db: Database) -> str:
    """Returns the id of a job that has a map.

    Raises:
        CirisError: job_not_found, ambiguous_id; map_not_found, where the job has none.
    """
    hint = "name a job that has grown a map, and has ended; `ciris map --local` takes a proof file"
    with db.read() as session:
        try:
            job = jobs.get(session, job_id)
        except CirisError as error:
            raise CirisError(error.code, error.message, field="former", hint=hint) from None
        if job.kind != Map.name or maps.accepted(session, job.id) is None:
            raise CirisError("map_not_found", f"the {job.kind} job {job.id} is {job.state} and has no map", field="former", hint=hint)
        return job.id


def former_of(job: JobRow) -> str | None:
    """Returns the id of the job whose map is taken over; None where nothing is."""
    former: str | None = job.options.get("former")
    return None if former == NONE else former


def _ended(session: Session, job: JobRow) -> str | None:
    """Returns why the map of a job has ended, as a key of ENDS or ``cancelled``; None where it has not, or where the job has failed."""
    if job.state == JobState.CANCELLED:
        return "cancelled"
    return next((name for name, words in ENDS.items() if words == job.reason), None)


def _store(session: Session, job: JobRow, afterwards: Afterwards) -> None:
    """Asks for the map's proof to be verified and stored."""
    if not steps.accepted(session, job.id):
        steps.add(session, job, ACCEPT, {})
        afterwards.append(send_work)
