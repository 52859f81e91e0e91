"""These routes certify a planner's own motion while the planner waits."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from api.access import SUBMIT, Db
from api.children import Children
from api.schemas.motions import MotionRequest, MotionResponse
from certifier.isolation.child import run_in_child
from db import scenes
from db.session import Database
from db.settings import settings

TIMEOUT_S = 60.0

router = APIRouter(prefix="/v1/planning", tags=["planning"], dependencies=[SUBMIT])


@router.post("/certify-path")
async def certify_path(body: MotionRequest, db: Db, children: Children) -> MotionResponse:
    """Certifies a motion, through waypoints or along a spline, for every pair of the scene, or finds its first contact.

    Most motions take a fraction of a second. A process of its own, with limits on time and memory, certifies and verifies.
    """
    return MotionResponse.model_validate(await children.run(_certify, db, body))


def _certify(db: Database, body: MotionRequest) -> Any:
    with db.read() as session:
        scene_id = scenes.find(session, body.scene)
    payload = {"scene": scenes.load(db, scene_id).to_document(), **body.model_dump(mode="json", exclude={"scene"})}
    memory = settings().child_memory_bytes
    return run_in_child("certifier.jobs.motion:certify_in_child", payload, timeout_s=TIMEOUT_S, memory_bytes=memory)
