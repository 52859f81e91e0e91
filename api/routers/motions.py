"""These routes certify a planner's own motion while the planner waits."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from api.access import SUBMIT, Db
from api.children import Children, about_motions
from api.named import with_positions
from api.schemas.motions import MotionRequest, MotionResponse
from api.strict import StrictRoute
from db import scenes
from db.session import Database

router = APIRouter(prefix="/v1/planning", tags=["planning"], dependencies=[SUBMIT], route_class=StrictRoute)


@router.post("/certify-path")
async def certify_path(body: MotionRequest, db: Db, children: Children) -> MotionResponse:
    """Certifies a motion, through waypoints or along a spline, for every pair of the scene, or finds its first contact.

    Most motions take a fraction of a second. A process of its own, with limits on time and memory, certifies and verifies.
    """
    return MotionResponse.model_validate(await children.run(_certify, db, body))


def _certify(db: Database, body: MotionRequest) -> Any:
    with db.read() as session:
        scene_id = scenes.find(session, body.scene)
    scene = scenes.load(db, scene_id)
    body = with_positions(db, scene, body)
    return about_motions("certify_in_child", scene, body.model_dump(mode="json", exclude={"scene"}))
