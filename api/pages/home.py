"""This is the page with the list of jobs."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages.rendering import page
from api.routers import jobs, regions, scenes
from db.session import Database

router = APIRouter()


@router.get("/")
def jobs_page(request: Request, db: Db) -> Response:
    return page(request, "jobs.html", _home(db))


@router.get("/live")
def jobs_live(request: Request, db: Db) -> Response:
    return page(request, "jobs_live.html", _home(db))


def _home(db: Database) -> dict[str, Any]:
    known = scenes.list_scenes(db).scenes
    return {
        "jobs": jobs.list_jobs(db).jobs,
        "scenes": known,
        "scene_names": {scene.id: scene.name for scene in known},
        "regions": regions.list_regions(db, limit=20).regions,
    }
