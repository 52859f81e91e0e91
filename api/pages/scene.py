"""These are the list of scenes, and the page of a scene with its library of regions."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response

from api.access import Db
from api.pages import copies
from api.pages.rendering import page
from api.parameters import KNOWN_TO_PAGE
from api.routers import regions, scenes
from api.schemas.common import Cursor
from api.schemas.scenes import SceneSummary
from db import jobs, maps
from db import scenes as known_scenes
from db.regions import counts as region_counts
from jobs import patterns

router = APIRouter()

Sought = Annotated[str, Query(max_length=200, pattern=patterns.ANY)]


@router.get("/scenes", dependencies=[KNOWN_TO_PAGE])
def scenes_page(request: Request, db: Db, after: Cursor = None, before: Cursor = None, search: Sought = "") -> Response:
    with db.read() as session:
        found, total = known_scenes.page(session, after, 100, before, search or None), known_scenes.count(session, search or None)
        ids = [row.id for row in found.rows]
        numbers, names = region_counts(session, ids), known_scenes.names(session, ids)
    wanted = {"search": search} if search else {}
    context = {
        "scenes": [SceneSummary.of(row, names[row.id]) for row in found.rows],
        "total": total,
        "search": search,
        "older": urlencode(wanted | {"after": found.next}) if found.next else None,
        "newer": urlencode(wanted | {"before": found.previous}) if found.previous else None,
        "regions": numbers,
        "copied": copies.one("ciris scene ls", "/v1/scenes", "print(service.scenes())"),
    }
    return page(request, "scenes.html", context)


@router.get("/scenes/{scene_id}")
def scene_page(request: Request, scene_id: str, db: Db) -> Response:
    scene, found = scenes.get_scene(scene_id, db), regions.list_regions(db, scene=scene_id).regions
    newest = regions.get_region(found[0].id, db) if found else None
    with db.read() as session:
        number = region_counts(session, [scene.id])[scene.id]
        latest = maps.latest(session, scene.id)
        mapped = None if latest is None else {"job": latest, "at": jobs.get(session, latest).finished_at}
    context = {
        "scene": scene,
        "lint": scenes.get_scene_lint(scene_id, db),
        "pairs": scenes.get_scene_pairs(scene_id, db).pairs,
        "regions": found,
        "number": number,
        "map": mapped,
        "others": [other for other in scenes.list_scenes(db, limit=100).scenes if other.id != scene.id],
        "newest": newest,
        "copied": copies.one(f"ciris scene show {scene.id}", f"/v1/scenes/{scene.id}", f'scene = service.scene("{scene.id}")'),
        "distance": newest and min((pair["margin"] for pair in newest.manifest["pairs"] if pair["margin"] is not None), default=None),
    }
    return page(request, "scene.html", context)
