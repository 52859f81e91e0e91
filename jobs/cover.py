"""A job that covers a scene: its regions are grown by jobs that are its children, which the workers serve like any others.

What happens next is decided by :mod:`planner.cover.machine`. Here its actions become rows, and rows its reports.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, Field
from sqlalchemy.orm import Session

from certifier import stored
from certifier.errors import CirisError
from certifier.growth.options import GrowthOptions
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.seeding.options import IRIS_SEEDS, SeedOptions
from db import activity, clock, events, jobs, regions, steps
from db.models import JobRow
from db.session import Database
from db.states import JOB, unfinished
from db.transaction import Afterwards
from db.types import utcnow
from jobs.checks import check_positions
from jobs.fields import model_of
from jobs.kind import Done, Held, Kind, Turn, report_of
from jobs.moving import move
from jobs.request import JobRequest
from jobs.scouting import scout
from planner.cover.machine import advance, begin
from planner.cover.options import MOST_JOINTS, STAGES, CoverOptions
from planner.cover.result import said
from planner.cover.state import CoverState, Ended, Finish, Late, Move, Moved, Report, Scout, Scouted, Task, Transition, Watch
from workers.app import send_coordinate, send_work

ACTIVE = unfinished(JOB)
NEVER = timedelta(days=10_000)
COVERED = "cover"
"""The kind of the events that say what a look at the scene has found."""


class CoverRequestOptions(model_of(CoverOptions)):  # type: ignore[misc]
    """Says what a cover shall reach, where it begins, and how much effort a region is worth."""


class CoverRequest(JobRequest):
    """Asks for regions, one after another, until they cover the scene or connect configurations."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"kind": "cover", "scene": "planar-2dof", "deadline_seconds": 60, "options": {"coverage": 0.95}}]}
    )

    kind: Literal["cover"] = Field(description="The kind of the job.")
    options: CoverRequestOptions = Field(default_factory=CoverRequestOptions, description="What to cover, and when to end.")


class Cover(Kind):
    """Starts grow jobs, which are its children, until their regions cover the scene or connect configurations."""

    name = "cover"
    subject = "the cover"
    request = CoverRequest
    template = "kinds/cover.html"
    forms: ClassVar = {"options": ("Cover", CoverOptions)}
    makes_jobs = True
    estimates = True

    def options(self, body: CoverRequest, scene: Scene, db: Database) -> dict[str, Any]:
        given = body.options.model_dump()
        points = {f"options.{name}[{i}]": q for name in ("seeds", "connect") for i, q in enumerate(given[name])}
        points |= {f"options.paths[{i}][{j}]": q for i, path in enumerate(given["paths"]) for j, q in enumerate(path)}
        for field, q in points.items():
            check_positions(scene, q, field)
        options = CoverOptions.from_document(given)
        asked = options if options.stages is not None or scene.n <= MOST_JOINTS else replace(options, stages=STAGES)
        return asked.to_document()

    def decide(self, turn: Turn) -> Transition:
        if turn.state is None:
            return begin(CoverOptions.from_document(turn.options))
        if isinstance(turn.report, CirisError):
            raise turn.report
        return advance(stored.value(CoverState, turn.state), turn.report)

    def report(self, session: Session, job: JobRow, state: dict[str, Any] | None) -> Report | CirisError | None:
        known = state or {}
        if known["closing"] is None and super().is_late(session, job, utcnow()):
            return Late()
        action = job.action or {}
        if action["kind"] == Watch.kind:
            ended = {
                child.number or 0: None if child.region_id else child.reason or f"the job was {child.state}"
                for child in jobs.children(session, job.id)
                if str(child.number) in known["growing"] and child.state not in ACTIVE
            }
            return Ended(ended) if ended else None
        found = report_of(session, job, action["kind"])
        if not isinstance(found, dict):
            return found
        return stored.value(Moved, found) if action["kind"] == Move.kind else stored.value(Scouted, found)

    def save(self, session: Session, job: JobRow, turn: Turn, decision: Transition, afterwards: Afterwards) -> bool:
        state = decision.state
        jobs.keep_growth(session, job, stored.document(state))
        if isinstance(turn.report, Ended):
            _tell_ended(session, job, turn.report)
        steps.skip(session, job.id)  # a look that the deadline has overtaken
        match decision.action:
            case Scout() | Move() as action:
                jobs.next_turn(job, {"kind": action.kind})
                steps.add(session, job, action.kind, {})
                afterwards.append(send_work)
            case Watch() as action:
                jobs.next_turn(job, {"kind": action.kind})
                for number, task in action.begin.items():
                    _begin(session, job, state.options, number, task, afterwards)
                if action.stop:
                    self.stop(session, job, afterwards)
            case Finish() as action:
                jobs.next_turn(job, jobs.finishing(Outcome.CERTIFIED if action.reached else Outcome.INCONCLUSIVE, action.reason))
                if action.fruitless:
                    hint = "regions that were certified remain"
                    job.error = CirisError("not_covered", action.reason, field="options", hint=hint).to_document()
        known = said(state)
        if isinstance(turn.report, Scouted) and known is not None:
            events.emit(session, job, COVERED, known)
        return isinstance(decision.action, Finish) or (isinstance(decision.action, Watch) and decision.action.stop)

    def do(self, claim: steps.Claim, scene: Scene) -> Done:
        if claim.kind == Move.kind:
            return Done(stored.document(move(scene, claim.scene_id, claim.job_id)))
        return Done(stored.document(scout(scene, claim.scene_id, claim.job_id)))

    def is_late(self, session: Session, job: JobRow, now: datetime) -> bool:
        """A cover ends itself, after a last look."""
        return False

    def stop(self, session: Session, job: JobRow, afterwards: Afterwards) -> None:
        """Cancels the jobs that grow regions for a cover. Regions that they have certified remain."""
        for child in jobs.children(session, job.id):
            if child.state in ACTIVE:
                jobs.cancel(session, child.id)
                afterwards.append(partial(send_coordinate, child.id))

    def waits(self, session: Session, job: JobRow) -> bool:
        return any(child.state in ACTIVE for child in jobs.children(session, job.id))

    def held(self, session: Session, scene: Scene, job: JobRow) -> list[Held]:
        return [Held(text) for text in self._said(session, job).get("obstacles", ())]

    def result(self, session: Session, job: JobRow) -> dict[str, Any]:
        """Returns what the last look of a cover has seen, as :func:`planner.cover.result.said` says it, with its ``regions`` and jobs.

        Its ``curve`` is what its looks have seen: (seconds since its start, coverage, number of the scene's regions) of each.
        """
        seen = dict.fromkeys(("coverage", "components", "largest", "connected", "connect", "seeds", "paths", "missing", "obstacles"))
        known = self._said(session, job)
        start = job.started_at or job.created_at
        looks = events.told(session, job.id, COVERED)
        grown = jobs.children(session, job.id)
        does = activity.of_jobs(session, grown)
        return {
            **{name: known.get(name) for name in seen},
            "curve": [((at - start).total_seconds(), look["coverage"]["value"], look["regions"]) for look, at in looks],
            "regions": [region.id for region in regions.of_cover(session, job.id)],
            "grown": [
                {
                    "job": one.id,
                    "number": one.number or 0,
                    "state": one.state,
                    "status": does[one.id],
                    "region": one.region_id,
                    "reason": one.reason,
                }
                for one in grown
            ],
        }

    def _said(self, session: Session, job: JobRow) -> dict[str, Any]:
        known = jobs.growth(session, job.id)
        # A cover of an earlier version may have ended with a state that does not name its options.
        return {} if known is None else said(stored.value(CoverState, {"options": job.options, **known})) or {}


def _begin(session: Session, job: JobRow, options: CoverOptions, number: int, task: Task, afterwards: Afterwards) -> None:
    """Creates the job that grows a region. It ends with the cover, or earlier."""
    ends = [(job.deadline_at - clock.now(session)).total_seconds()] if job.deadline_at is not None else []
    if options.region_seconds is not None:
        ends.append(options.region_seconds)
    # Each of the tries of a seeding takes the next random seed, so the next turn begins after them.
    random_seed = (options.random_seed + task.turn * SeedOptions.tries) % IRIS_SEEDS
    seed = SeedOptions(q=task.q, contain=task.contain, random_seed=random_seed)
    growth = GrowthOptions(seed=seed.to_document(), cells=options.cells, stages=options.stages, random_seed=options.random_seed)
    child, _ = jobs.create(
        session,
        kind="grow",
        scene_id=job.scene_id,
        options=growth.to_document(),
        deadline_seconds=min(ends, default=None),
        key_id=job.key_id,
        priority=job.priority,
        parent_id=job.id,
        number=number,
    )
    # Its last region is the one that counts; those on the way would only be more to look at.
    child.accept_after = utcnow() + NEVER
    about = {"job": child.id, "number": number, "purpose": task.key, "q": list(task.q), "state": child.state}
    events.emit(session, job, "child", about)
    afterwards.append(partial(send_coordinate, child.id))


def _tell_ended(session: Session, job: JobRow, report: Ended) -> None:
    growths = [child for child in jobs.children(session, job.id) if child.number in report.regions]
    for child in growths:
        about = {"job": child.id, "number": child.number, "state": child.state, "region_id": child.region_id, "reason": child.reason}
        events.emit(session, job, "child", about)
