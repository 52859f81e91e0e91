"""Planners ask these questions about certified regions."""

from __future__ import annotations

import numpy as np
from fastapi import APIRouter

from api import checks
from api.access import READ, Db
from api.schemas.regions import Containment, ContainsRequest, ContainsResponse, Hit
from certifier.model import Polytope
from certifier.outcome import Guarantee
from db import regions, scenes
from planner.membership import MembershipIndex, to_s

router = APIRouter(prefix="/v1/planning", tags=["planning"], dependencies=[READ])


@router.post("/contains")
def contains(body: ContainsRequest, db: Db) -> ContainsResponse:
    """Returns, for each point, the certified regions of the scene that contain it, and how deep inside it is."""
    with db.read() as session:
        scene_id = scenes.find(session, body.scene)
        stored = regions.polytopes(session, regions.roll(session, scene_id)[1])
    scene = scenes.load(db, scene_id)
    points = to_s(scene, checks.points(scene, body.q, "q")) if body.q is not None else checks.points(scene, body.s or [], "s")
    found = MembershipIndex([Polytope(r.C, r.d) for r in stored], scene.n).locate(points)
    answers = []
    for inside, margin in zip(found.inside, found.margin, strict=True):
        deepest = np.argsort(-margin)
        hits = [Hit(region=stored[i].id, margin=margin[i], guarantee=Guarantee(stored[i].guarantee)) for i in deepest if inside[i]]
        best = float(margin.max(initial=-np.inf))
        answers.append(Containment(inside=bool(hits), regions=hits, margin=best if np.isfinite(best) else None))
    return ContainsResponse(scene=scene_id, regions=len(stored), points=answers)
