"""These routes answer with what people look at: contacts, and slices through configuration space."""

from __future__ import annotations

from fastapi import APIRouter

from api import checks, drawing
from api.access import READ, Db
from api.answers import asked
from api.children import Children
from api.libraries import KeptLibraries, Libraries
from api.named import with_positions
from api.schemas.drawing import ContactsRequest, ContactsResponse, SliceRequest, SliceResponse
from api.strict import StrictRoute
from db import scenes
from db.session import Database

router = APIRouter(prefix="/v1/planning", tags=["planning"], dependencies=[READ], route_class=StrictRoute)


@router.post("/contacts")
def find_contacts(body: ContactsRequest, db: Db) -> ContactsResponse:
    """Says what is wrong at configurations: which pairs touch, which joints are outside of their limits, which conditions are not kept.

    This is computed in floating point, for looking at a robot and for choosing a seed. It certifies nothing.
    """
    with db.read() as session:
        scene_id = scenes.find(session, body.scene)
    scene = scenes.load(db, scene_id)
    body = with_positions(db, scene, body)
    return ContactsResponse(scene=scene_id, contacts=drawing.contacts(scene, checks.points(scene, body.q, "q")))


@router.post("/slice")
async def slice_space(body: SliceRequest, db: Db, libraries: KeptLibraries, children: Children) -> SliceResponse:
    """Returns a slice through configuration space: where the robot collides, where it is free, and what certified regions cover.

    Two joints move within their limits and the others stay. What collides is sampled in floating point; the outlines are those of regions
    whose proofs were verified.
    """
    return await children.run(_slice, db, libraries, body)


def _slice(db: Database, libraries: Libraries, body: SliceRequest) -> SliceResponse:
    scene_id, scene, library = asked(db, libraries, body.scene)
    body = with_positions(db, scene, body)
    return drawing.sliced(scene_id, scene, library, body)
