"""This is the page of a scene."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages.rendering import page
from api.routers import regions, scenes

router = APIRouter()


@router.get("/scenes/{scene_id}")
def scene_page(request: Request, scene_id: str, db: Db) -> Response:
    context = {
        "scene": scenes.get_scene(scene_id, db),
        "lint": scenes.get_scene_lint(scene_id, db),
        "pairs": scenes.get_scene_pairs(scene_id, db).pairs,
        "regions": regions.list_regions(db, scene=scene_id).regions,
    }
    return page(request, "scene.html", context)
