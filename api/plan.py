"""A request for a motion is answered here: from an earlier motion, from regions, or by a search in a child process.

The first that has an answer gives it. Whatever gives it, the answer is proved: an earlier motion and a new one by the proof of a path in
whose tube they are, a trajectory through regions by the regions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from api import answers, checks
from api.advice import seed_between
from api.children import about_motions
from api.libraries import Libraries
from api.links import LinksKept
from api.motions import Known, MotionsKept
from api.named import with_positions
from api.schemas.planning import Piece
from api.schemas.plans import BeyondLimit, Collision, LineStop, PlanGap, PlanRequest, PlanResponse, Reached, Reason
from api.unanswered import Unanswered
from certifier.errors import CirisError, RegionError
from certifier.isolation.child import run_in_child
from certifier.model import Array, Scene
from certifier.outcome import Guarantee
from db import regions
from db.session import Database
from db.settings import settings
from jobs.moving import keep
from planner.library import Library
from planner.nearest import nearest
from planner.trajectory.plan import Answer, Apart, Limits, Outside, Trajectory, Unproved, inner, plan

TIMEOUT_S = 60.0


_UNANSWERED = {Reason.START_UNCOVERED, Reason.GOAL_UNCOVERED, Reason.DISCONNECTED, Reason.NO_MOTION}
"""For these reasons a map may help: its job may begin with the configurations of the question."""


@dataclass(frozen=True)
class Asked:
    """Holds what an API process knows about the scenes that it is asked about."""

    db: Database
    libraries: Libraries
    links: LinksKept
    motions: MotionsKept
    unanswered: Unanswered


@dataclass(frozen=True, eq=False)
class _Question:
    """A request with its scene. ``points`` are the start and the configurations to go through; ``ends`` may be numbers of regions."""

    scene_id: str
    scene: Scene
    library: Library
    known: Known
    points: list[Array]
    goals: list[Array]
    ends: list[Array | int]
    limits: Limits


def answer(asked: Asked, body: PlanRequest) -> PlanResponse:
    """Answers a request.

    Raises:
        CirisError: wrong_length, number_too_large, region_not_found, ambiguous_id, region_elsewhere, what api.named
            raises, or what befell a child process.
    """
    scene_id, scene, library = answers.asked(asked.db, asked.libraries, body.scene)
    body = with_positions(asked.db, scene, body)
    question = _question(asked, body, scene_id, scene, library)
    of_scene: dict[str, Any] = {"scene": question.scene_id, "version": question.library.version, "regions": len(question.library)}
    found = None if body.regions_only else _known(question)
    complete = True
    if found is None and len(question.ends) == 2 and not body.via:
        complete, links = asked.links.of(asked.db, question.scene_id, question.scene, question.library)
        start, goal = question.ends
        through = plan(question.library, question.scene, links, start, goal, question.limits, _optimise)
        if body.regions_only or isinstance(through, Trajectory):
            found = _of_regions(question, through)
    found = found or _searched(asked, question, body)
    if found.get("reason") in _UNANSWERED:
        asked.unanswered.note(asked.db, scene_id, scene.in_windows(np.array([*question.points, *question.goals])))
    if body.prove and found["found"]:
        found["proof"] = _proof(question.scene, found["q"])
    return PlanResponse(**of_scene, complete=complete, **found)


def _question(asked: Asked, body: PlanRequest, scene_id: str, scene: Scene, library: Library) -> _Question:
    end = partial(_end, asked.db, scene, library)
    given = [("start", body.start), *([] if body.goal is None else [("goal", body.goal)])]
    ends = [end(one, field) for field, one in given]
    start, *goals = [scene.to_q(inner(library, one)) if isinstance(one, int) else one for one in ends]
    goals += [checks.point(scene, q, f"goals[{i}]") for i, q in enumerate(body.goals or [])]
    points = [start, *(checks.point(scene, q, f"via[{i}]") for i, q in enumerate(body.via))]
    each = partial(checks.of_each_joint, scene)
    limits = Limits(each(body.speed, "speed"), each(body.acceleration, "acceleration"))
    known = asked.motions.of(asked.db, scene_id, scene)
    return _Question(scene_id, scene, library, known, points, goals, ends, limits)


def _known(question: _Question) -> dict[str, Any] | None:
    """Returns an earlier motion that answered the same question, or a motion in the tube of one where no straight line is free."""
    if len(question.points) > 1 or len(question.goals) != 1:
        return None
    limits = question.limits
    start, goal, known = question.points[0], question.goals[0], question.known
    motion_id = known.answer(start, goal, limits.speed, limits.acceleration)
    if motion_id is not None:
        kept = known.motions[motion_id]
        return _moved(motion_id, kept.arrays["q"], kept.arrays["t"], kept.tube)
    inside = known.path(start, goal)
    if inside is None:
        return None
    motion_id, path = inside
    kept = known.motions[motion_id]
    tube = {"proved": kept.arrays["path"], "tube": kept.tube}
    asked = {"path": path, **tube, "speed": limits.speed, "acceleration": limits.acceleration}
    found = about_motions("timed_within", question.scene, asked)
    return _moved(motion_id, found["q"], found["t"], kept.tube) if found else None


def _searched(asked: Asked, question: _Question, body: PlanRequest) -> dict[str, Any]:
    """Searches for a motion in a child process, and keeps what it has found and proved."""
    limits = question.limits
    payload = {
        "points": np.array(question.points),
        "goals": question.goals,
        "pose": body.pose and body.pose.model_dump(),
        "line": body.line and body.line.model_dump(),
        "speed": limits.speed,
        "acceleration": limits.acceleration,
        "seconds": body.seconds,
    }
    try:
        found = about_motions("planned", question.scene, payload)
    except CirisError as error:
        error.field = f"pose.{error.field}" if body.pose is not None and error.field else error.field
        raise
    if "reason" in found:
        return {"found": False, **_why(found, body)}
    direct = np.array([not body.via and body.line is None])
    known_by = {"speed": limits.speed, "acceleration": limits.acceleration, "direct": direct}
    motion_id = keep(asked.db, question.scene_id, found, known_by)
    return _moved(motion_id, found["q"], found["t"], found["tube"])


def _moved(motion_id: str, q: Array, t: Array, tube: float) -> dict[str, Any]:
    piece = Piece(begin=0.0, end=float(t[-1]), region=None, motion=motion_id, guarantee=Guarantee.EXACT)
    return {**_motion(q, t, [piece]), "motion": motion_id, "tube": tube}


def _motion(q: Array, t: Array, pieces: list[Piece]) -> dict[str, Any]:
    return {
        "found": True,
        "q": q.tolist(),
        "t": t.tolist(),
        "pieces": pieces,
        "length": float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum()),
        "duration": float(t[-1]),
        "guarantee": max((piece.guarantee for piece in pieces), key=list(Guarantee).index),
    }


def _why(found: dict[str, Any], body: PlanRequest) -> dict[str, Any]:
    """Returns why a search has found nothing."""
    match found["reason"]:
        case "unreachable":
            reached = Reached(q=found["q"].tolist(), metres=found["metres"], radians=found["radians"])
            return {"reason": Reason.POSE_UNREACHABLE, "reached": reached}
        case "line":
            stop = LineStop(part=found["part"], **{name: found.get(name) for name in ("joint", "a", "b")})
            return {"reason": Reason(f"line_{found['how']}"), "line": stop}
        case "no_motion" | "not_certified":
            return {"reason": Reason(found["reason"])}
    place, _, number = found["where"].partition("[")
    where = f"goals[{number}" if place == "goal" and body.goals else place if place == "goal" else found["where"]
    said = {name: value for name, value in found.items() if name not in ("reason", "where")}
    if found["reason"] == "outside_limits":
        said |= {side: said[side] if np.isfinite(said[side]) else None for side in ("lower", "upper")}
        return {"reason": Reason(f"{place}_outside_limits"), "limit": BeyondLimit(where=where, **said)}
    said["free"] = None if said["free"] is None else said["free"].tolist()
    return {"reason": Reason(f"{place}_in_collision"), "collision": Collision(where=where, **said)}


def _of_regions(question: _Question, found: Answer) -> dict[str, Any]:
    """Returns the trajectory through regions, or why there is none."""
    library, scene = question.library, question.scene
    match found:
        case Trajectory():
            return _motion(found.q, found.t, answers.pieces(library, question.known.tubes, found.stretches))
        case Outside(end, s):
            near = None if s is None else answers.near(library, scene, nearest(library, s))
            reason = Reason.START_UNCOVERED if end == "start" else Reason.GOAL_UNCOVERED
            return {"found": False, "reason": reason, "nearest": near}
        case Apart():
            return {"found": False, "reason": Reason.DISCONNECTED, "gap": _gap(library, scene, found)}
        case Unproved(stop):
            return {"found": False, "reason": Reason.NOT_PROVED, "uncovered": answers.uncovered(library, scene, stop)}


def _optimise(payload: dict[str, Any]) -> dict[str, Any] | None:
    memory = settings().child_memory_bytes
    found: dict[str, Any] | None = run_in_child("planner.trajectory.curve:optimised", payload, timeout_s=TIMEOUT_S, memory_bytes=memory)
    return found


def _proof(scene: Scene, q: list[list[float]]) -> str | None:
    """Returns a proof file about exactly a motion, in base 64; None where none is found, or it has too many configurations for one."""
    try:
        found = about_motions("certify_in_child", scene, {"q": q, "space": None, "tube": False, "prove": True})
    except CirisError as error:
        if error.code != "motion_too_long":
            raise
        return None
    proof: str | None = found["proof"] if found["outcome"] == "certified" else None
    return proof


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
