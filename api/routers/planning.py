"""Planners ask these questions about certified regions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Query

from api import answers, checks, graph
from api.access import READ, Db
from api.answers import asked
from api.children import Children
from api.free_sets import FreeSetsKept, KeptFreeSets, Mapped
from api.libraries import KeptLibraries, Libraries
from api.motions import KeptMotions
from api.named import with_positions
from api.questions import asking
from api.schemas.planning import (
    Containment,
    ContainsRequest,
    ContainsResponse,
    Covering,
    GraphResponse,
    Hit,
    NearestPoint,
    NearestRequest,
    NearestResponse,
    PathRequest,
    PathResponse,
    SegmentRequest,
    SegmentResponse,
)
from api.strict import StrictRoute
from api.unanswered import KeptUnanswered, Unanswered
from certifier.model import Array, Scene
from certifier.motion.splines import Curve, curve
from db.session import Database
from planner.library import Library
from planner.membership import locate, to_s
from planner.motion.path import follow
from planner.motion.space import Space
from planner.nearest import nearest_proved
from planner.tubes import Tubes

router = APIRouter(prefix="/v1/planning", tags=["planning"], dependencies=[READ], route_class=StrictRoute)


@router.post("/contains")
@asking(few=100)
def contains(
    body: ContainsRequest, db: Db, libraries: KeptLibraries, motions: KeptMotions, free_sets: KeptFreeSets, unanswered: KeptUnanswered
) -> ContainsResponse:
    """Returns what proves each point free: certified regions with how deep inside it is, tubes of proved motions, the latest map."""
    scene_id, scene, library = asked(db, libraries, body.scene)
    body = with_positions(db, scene, body)
    points = _points(scene, body.q, body.s)
    found = locate(library, points)
    tubes = motions.of(db, scene_id, scene).tubes
    q = np.array(body.q) if body.q is not None else scene.to_q(points)
    ends = np.searchsorted(found.point, np.arange(len(points) + 1)).tolist()
    mapped = free_sets.of(db, scene_id)
    proved = [None] * len(q) if mapped is None else mapped.free.contains(scene.in_windows(q)).tolist()
    containments = []
    for (begin, end), at, by_map in zip(pairwise(ends), q, proved, strict=True):
        deepest = zip(found.region[begin:end].tolist(), found.margin[begin:end].tolist(), strict=True)
        hits = [Hit(region=library.ids[i], margin=margin, guarantee=answers.guarantee(library, i)) for i, margin in deepest]
        inside = list(dict.fromkeys(tubes.motions[i].id for i in tubes.motion[tubes.at(at)[0]].tolist()))
        margin = hits[0].margin if hits else None
        containments.append(Containment(inside=bool(hits or inside or by_map), regions=hits, margin=margin, motions=inside, map=by_map))
    job = None if mapped is None else mapped.job
    outside = ~np.array([point.inside for point in containments]) & np.isfinite(points).all(axis=1)
    unanswered.note(db, scene_id, scene.in_windows(q[outside]))
    return ContainsResponse(scene=scene_id, version=library.version, regions=len(library), map=job, points=containments)


@router.post("/nearest")
@asking(few=50)
def find_nearest(body: NearestRequest, db: Db, libraries: KeptLibraries, free_sets: KeptFreeSets) -> NearestResponse:
    """Returns, for each point, the nearest point that a certified region or the scene's latest map proves free, and how far that is."""
    scene_id, scene, library = asked(db, libraries, body.scene)
    body = with_positions(db, scene, body)
    points = _points(scene, body.q, body.s)
    mapped = free_sets.of(db, scene_id)
    free, job = (None, None) if mapped is None else (mapped.free, mapped.job)
    found = [
        NearestPoint(nearest=answers.near(library, scene, proved.nearest, job), complete=proved.complete)
        for proved in nearest_proved(library, free, scene, points)
    ]
    return NearestResponse(scene=scene_id, version=library.version, regions=len(library), map=job, points=found)


@router.post("/segment")
@asking(few=20)
def cover_segments(
    body: SegmentRequest, db: Db, libraries: KeptLibraries, motions: KeptMotions, free_sets: KeptFreeSets, unanswered: KeptUnanswered
) -> SegmentResponse:
    """Says of each straight motion whether every point of it is proved to be free, and what proves it.

    Certified regions are asked, and for motions that are straight in `q` the tubes of proved motions and the scene's latest map.
    `covered` is proved, for the numbers of the request taken literally. A motion that is straight in `s` is cut with the regions exactly.
    One that is straight in `q` is proved piece by piece, with bounds on what lies between, so one that only touches may not be proved.
    """
    scene_id, scene, library = asked(db, libraries, body.scene)
    body = with_positions(db, scene, body)
    proofs = library, motions.of(db, scene_id, scene).tubes, free_sets.of(db, scene_id)
    given, name = (body.q, "q") if body.q is not None else (body.s or [], "s")
    segments = [
        _covering(*proofs, scene, body.space, _waypoints(scene, body.space, ends, f"{name}[{i}]", name), [0.0, 1.0])
        for i, ends in enumerate(given)
    ]
    _note(unanswered, db, scene_id, scene, segments)
    return SegmentResponse(scene=scene_id, version=library.version, regions=len(library), segments=segments)


@router.post("/path")
@asking(few=20)
def cover_path(
    body: PathRequest, db: Db, libraries: KeptLibraries, motions: KeptMotions, free_sets: KeptFreeSets, unanswered: KeptUnanswered
) -> PathResponse:
    """Says whether every point of a path, straight between its waypoints or along a curve, is proved to be free, and what proves it.

    With `times` the path is a trajectory, and the answer is in its times. What `covered` means is said at `/v1/planning/segment`.
    """
    scene_id, scene, library = asked(db, libraries, body.scene)
    body = with_positions(db, scene, body)
    found = _curve(scene, body)
    times = body.times or (np.arange(len(found.controls) // found.degree + 1.0) if found.times is None else found.times).tolist()
    proofs = library, motions.of(db, scene_id, scene).tubes, free_sets.of(db, scene_id)
    answer = _covering(*proofs, scene, body.space, found.controls, times, found.degree)
    _note(unanswered, db, scene_id, scene, [answer])
    return PathResponse(scene=scene_id, version=library.version, regions=len(library), **dict(answer))


@router.get("/graph")
async def get_graph(
    db: Db,
    libraries: KeptLibraries,
    free_sets: KeptFreeSets,
    children: Children,
    scene: Annotated[
        str, Query(min_length=1, max_length=255, description="The id or the name of a scene, or `NAME@staged`.", examples=["planar-2dof"])
    ],
) -> GraphResponse:
    """Returns which regions of a scene overlap, which sets of them are connected, and where to seed a region that may join two sets.

    Where the latest map proves the straight motion from one set to the other, the gap says so.

    Pairs of regions that were not compared yet are compared now, for a few seconds. Ask again until `complete` is true.
    """
    return await children.run(_graph, db, libraries, free_sets, scene)


def _graph(db: Database, libraries: Libraries, free_sets: FreeSetsKept, name: str) -> GraphResponse:
    scene_id, scene, library = asked(db, libraries, name)
    return graph.describe(db, free_sets.of(db, scene_id), scene_id, scene, library)


def _note(unanswered: Unanswered, db: Database, scene_id: str, scene: Scene, found: Sequence[Covering]) -> None:
    """Notes where motions stop being covered, within the joint limits."""
    stops = [stop.uncovered.q for stop in found if stop.uncovered is not None and stop.uncovered.s is not None]
    unanswered.note(db, scene_id, scene.in_windows(np.array(stops).reshape(-1, scene.n)))


def _points(scene: Scene, q: Sequence[Sequence[float]] | None, s: Sequence[Sequence[float]] | None) -> Array:
    """Returns the points of a request in s, (k, n), with a row of NaN where a joint is outside its limits."""
    return to_s(scene, checks.points(scene, q, "q")) if q is not None else checks.points(scene, s or [], "s")


def _waypoints(scene: Scene, space: Space, rows: Sequence[Sequence[float]], field: str, given: str) -> Array:
    """Returns waypoints (k, n) in the coordinates of the space."""
    waypoints = checks.points(scene, rows, field)
    return waypoints if space == given else checks.in_s(scene, waypoints, field)


def _curve(scene: Scene, body: PathRequest) -> Curve:
    """Returns the path of a request as pieces, in the coordinates of its space; straight ones have the degree 1."""
    found = curve(body.model_dump(include={"bezier", "knots", "control_points"}))
    if found is None:
        given, name = (body.q, "q") if body.q is not None else (body.s or [], "s")
        return Curve(_waypoints(scene, body.space, given, name, name), 1, None)
    checks.points(scene, found.controls[:1].tolist(), "bezier" if body.knots is None else "control_points")
    return found


def _covering(
    library: Library,
    tubes: Tubes,
    mapped: Mapped | None,
    scene: Scene,
    space: Space,
    controls: Array,
    times: Sequence[float],
    degree: int = 1,
) -> Covering:
    """Covers a motion from its start on, with all that is proved."""
    free, job = (None, None) if mapped is None else (mapped.free, mapped.job)
    found = follow(library, scene, space, controls, times, degree, tubes, free)
    pieces = answers.pieces(library, tubes, found.stretches, job)
    return Covering(covered=found.uncovered is None, pieces=pieces, uncovered=answers.uncovered(library, scene, found.uncovered))
