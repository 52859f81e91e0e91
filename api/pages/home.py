"""This is the page with the list of jobs."""

from __future__ import annotations

from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response

from api.access import Db
from api.pages.rendering import page
from api.routers import jobs, regions, scenes
from api.schemas.common import Cursor
from db.regions import grown
from db.session import Database
from db.states import JobState
from jobs.registry import KINDS

ENDED = {"active": False, "ended": True}
"""Groups of states that people ask for, and whether their jobs have ended."""

router = APIRouter()

Chosen = Annotated[str, Query(max_length=200)]


@router.get("/")
def jobs_page(request: Request, db: Db, state: Chosen = "", kind: Chosen = "", scene: Chosen = "", after: Cursor = None) -> Response:
    return page(request, "jobs.html", _home(db, {"state": state, "kind": kind, "scene": scene}, after))


@router.get("/live")
def jobs_live(request: Request, db: Db, state: Chosen = "", kind: Chosen = "", scene: Chosen = "", after: Cursor = None) -> Response:
    return page(request, "jobs_live.html", _home(db, {"state": state, "kind": kind, "scene": scene}, after))


def _home(db: Database, chosen: dict[str, str], after: str | None) -> dict[str, Any]:
    """Returns what the list shows.

    A form sends an empty text for what nobody has chosen. A state or a kind that does not exist is none, as an old bookmark may have it.
    """
    state = JobState(chosen["state"]) if chosen["state"] in [*JobState] else None
    kind = chosen["kind"] if chosen["kind"] in KINDS else None
    found = jobs.list_jobs(db, state=state, kind=kind, scene=chosen["scene"] or None, ended=ENDED.get(chosen["state"]), after=after)
    known = scenes.list_scenes(db, limit=1000).scenes
    covers = [job.id for job in found.jobs if KINDS[job.kind].makes_jobs]
    with db.read() as session:
        numbers = grown(session, covers)
    filters = {name: value for name, value in chosen.items() if value}
    return {
        "jobs": found.jobs,
        "grown": numbers,
        "chosen": chosen,
        "query": urlencode(filters | ({"after": after} if after else {})),
        "older": urlencode(filters | {"after": found.next}) if found.next else None,
        "states": [*ENDED, *JobState],
        "kinds": KINDS,
        "scenes": known,
        "scene_names": {scene.id: scene.name for scene in known},
        "regions": regions.list_regions(db, limit=10).regions if not filters and after is None else [],
    }
