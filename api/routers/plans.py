"""A planner asks for a trajectory between two configurations here."""

from __future__ import annotations

from functools import partial
from typing import Any

from fastapi import APIRouter

from api import answers, checks
from api.access import READ, Db
from api.advice import seed_between
from api.children import Children
from api.libraries import KeptLibraries, Libraries
from api.links import KeptLinks, LinksKept
from api.schemas.plans import PlanGap, PlanRequest, PlanResponse, Reason
from certifier.errors import RegionError
from certifier.isolation.child import run_in_child
from certifier.model import Array, Scene
from certifier.outcome import Guarantee
from db import regions
from db.session import Database
from db.settings import settings
from planner.library import Library
from planner.nearest import nearest
from planner.trajectory.plan import Apart, Limits, Outside, Trajectory, Unproved, plan

TIMEOUT_S = 60.0

router = APIRouter(prefix="/v1/planning", tags=["planning"], dependencies=[READ])


@router.post("/plan")
async def plan_trajectory(body: PlanRequest, db: Db, libraries: KeptLibraries, links: KeptLinks, children: Children) -> PlanResponse:
    """Returns a trajectory from rest to rest between two configurations, or regions, through the certified regions of the scene.

    It is straight in `q` between the configurations of the answer, and every point of it is proved to be in the regions that the pieces
    name, like a path that you ask about at `/v1/planning/path`. Where there is none, the answer says why.
    """
    return await children.run(_plan, db, libraries, links, body)


def _plan(db: Database, libraries: Libraries, kept: LinksKept, body: PlanRequest) -> PlanResponse:
    scene_id, scene, library = answers.asked(db, libraries, body.scene)
    ends = [_end(db, scene, library, given, field) for given, field in ((body.start, "start"), (body.goal, "goal"))]
    limits = Limits(
        checks.of_each_joint(scene, body.speed, "speed"),
        checks.of_each_joint(scene, body.acceleration, "acceleration"),
    )
    complete, links = kept.of(db, scene_id, scene, library)
    found = plan(library, scene, links, ends[0], ends[1], limits, _optimise)
    answer = partial(PlanResponse, scene=scene_id, version=library.version, regions=len(library), complete=complete)
    if isinstance(found, Trajectory):
        pieces = answers.pieces(library, found.stretches)
        return answer(
            found=True,
            q=found.q.tolist(),
            t=found.t.tolist(),
            pieces=pieces,
            length=found.length,
            duration=float(found.t[-1]),
            guarantee=max((piece.guarantee for piece in pieces), key=list(Guarantee).index),
        )
    answer = partial(answer, found=False)
    match found:
        case Outside(end, s):
            near = None if s is None else answers.near(library, scene, nearest(library, s))
            return answer(reason=Reason.START_UNCOVERED if end == "start" else Reason.GOAL_UNCOVERED, nearest=near)
        case Apart():
            return answer(reason=Reason.DISCONNECTED, gap=_gap(library, scene, found))
        case Unproved(stop):
            return answer(reason=Reason.NOT_PROVED, uncovered=answers.uncovered(library, scene, stop))


def _optimise(payload: dict[str, Any]) -> dict[str, Any] | None:
    memory = settings().child_memory_bytes
    found: dict[str, Any] | None = run_in_child("planner.trajectory.curve:optimised", payload, timeout_s=TIMEOUT_S, memory_bytes=memory)
    return found


def _end(db: Database, scene: Scene, library: Library, given: list[float] | str, field: str) -> Array | int:
    """Returns the configuration of an end, (n,), or the number of the region that it names.

    Raises:
        CirisError: wrong_length, region_not_found, ambiguous_id, region_elsewhere.
    """
    if not isinstance(given, str):
        return checks.point(scene, given, field)
    with db.read() as session:
        region_id = regions.get(session, given).id
    if region_id not in library.ids:
        raise RegionError(
            "region_elsewhere", f"region {region_id} is of another scene", field=field, hint="`ciris region ls --scene SCENE` lists them"
        )
    return library.ids.index(region_id)


def _gap(library: Library, scene: Scene, apart: Apart) -> PlanGap:
    gap = apart.gap
    return PlanGap(
        start_regions=apart.start,
        goal_regions=apart.goal,
        start=library.ids[gap.a],
        goal=library.ids[gap.b],
        distance=gap.distance,
        q=seed_between(scene, library, gap),
        q_start=scene.to_q(gap.s_a).tolist(),
        q_goal=scene.to_q(gap.s_b).tolist(),
    )
