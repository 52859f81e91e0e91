"""A planner asks for a motion between configurations here."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Response

from api import plan
from api.access import READ, Db
from api.children import Children
from api.delivery import unchanging
from api.libraries import KeptLibraries
from api.links import KeptLinks
from api.motions import KeptMotions
from api.schemas.planning import MOTION
from api.schemas.plans import PlanRequest, PlanResponse
from api.strict import StrictRoute
from api.unanswered import KeptUnanswered
from certifier.proof.container import with_scene
from db import motions, proofs, scenes

router = APIRouter(prefix="/v1/planning", tags=["planning"], dependencies=[READ], route_class=StrictRoute)


@router.post("/plan")
async def plan_trajectory(
    body: PlanRequest, db: Db, libraries: KeptLibraries, links: KeptLinks, kept: KeptMotions, unanswered: KeptUnanswered, children: Children
) -> PlanResponse:
    """Returns a motion from rest to rest that is proved to be free of collision, or why there is none.

    It is straight in `q` between the configurations of the answer. The service takes it from what is proved already, if it can: an earlier
    motion, or the certified regions. Otherwise it searches for a motion and proves it. The pieces name what proves the motion.
    """
    return await children.run(plan.answer, plan.Asked(db, libraries, links, kept, unanswered), body)


@router.get("/motions/{motion_id}/proof", response_class=Response, responses={200: {"content": {"application/octet-stream": {}}}})
@unchanging
def download_kept_proof(
    motion_id: Annotated[str, Path(max_length=64, description="Id of a proved motion, or its first characters.", examples=[MOTION])], db: Db
) -> Response:
    """Returns the proof of a motion that the service keeps: of the path in whose tube it is. `ciris verify` checks the file offline."""
    with db.read() as session:
        motion = motions.get(session, motion_id)
        planes = proofs.get(session, motion.proof_digest)
    data = with_scene(planes, scenes.load(db, motion.scene_id))
    headers = {"Content-Disposition": f'attachment; filename="{motion.id}.proof"', "ETag": f'"{motion.proof_digest}"'}
    return Response(data, media_type="application/octet-stream", headers=headers)
