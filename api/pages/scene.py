"""These are the list of scenes, and the page of a scene with its library of regions."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages.rendering import page
from api.routers import regions, scenes
from api.schemas.common import Cursor
from db.regions import counts as region_counts

router = APIRouter()


@router.get("/scenes")
def scenes_page(request: Request, db: Db, after: Cursor = None) -> Response:
    found = scenes.list_scenes(db, after)
    with db.read() as session:
        numbers = region_counts(session, [scene.id for scene in found.scenes])
    return page(request, "scenes.html", {"scenes": found.scenes, "next": found.next, "regions": numbers})


@router.get("/scenes/{scene_id}")
def scene_page(request: Request, scene_id: str, db: Db) -> Response:
    scene, found = scenes.get_scene(scene_id, db), regions.list_regions(db, scene=scene_id).regions
    newest = regions.get_region(found[0].id, db) if found else None
    with db.read() as session:
        number = region_counts(session, [scene.id])[scene.id]
    context = {
        "scene": scene,
        "lint": scenes.get_scene_lint(scene_id, db),
        "pairs": scenes.get_scene_pairs(scene_id, db).pairs,
        "regions": found,
        "number": number,
        "newest": newest,
        "distance": newest and min((pair["margin"] for pair in newest.manifest["pairs"] if pair["margin"] is not None), default=None),
    }
    return page(request, "scene.html", context)
