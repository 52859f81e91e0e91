"""This is the page of the caller's project: what it stores, and, for its admins, its keys and who changed what."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db, Reader
from api.pages import copies
from api.pages.rendering import page
from api.parameters import KNOWN_TO_PAGE
from api.room import KeptRoom, Room
from api.routers import project
from api.schemas.common import Cursor
from db.keys import Scope
from db.session import Database

router = APIRouter()

COPIES = copies.one("ciris project show", "/v1/project", "print(service.client.project())")


@router.get("/project", dependencies=[KNOWN_TO_PAGE])
def project_page(request: Request, caller: Reader, db: Db, room: KeptRoom, after: Cursor = None) -> Response:
    return page(request, "project.html", _project(caller, db, room, after) | {"copied": COPIES})


@router.get("/project/live", dependencies=[KNOWN_TO_PAGE])
def project_live(request: Request, caller: Reader, db: Db, room: KeptRoom, after: Cursor = None) -> Response:
    return page(request, "project_live.html", _project(caller, db, room, after))


def _project(caller: Reader, db: Database, room: Room, after: str | None) -> dict[str, Any]:
    """Returns what the page shows. Only admins see keys and the log."""
    found = {"project": project.get_project(caller, db, room), "scopes": [*Scope], "after": after, "admin": False}
    if not caller.scope.includes(Scope.ADMIN):
        return found
    return {**found, "admin": True, "keys": project.list_keys(db), "log": project.list_audit(db, after)}
