"""Callers see their project here. Its admins manage its keys, and read who changed what."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, status

from api.access import ADMIN, READ, Admin, Db, Reader, WholeDb, check_runs_service
from api.reading import ReadingRoute
from api.room import KeptRoom
from api.schemas.common import Cursor, Listed
from api.schemas.projects import Project
from api.schemas.service import AuditLine, AuditPage, KeyPage, KeySummary, MadeKey, NewKey
from api.writing import writing
from certifier.errors import CirisError
from db import audit, keys, projects, solver_time
from db.audit import Action

router = APIRouter(prefix="/v1", tags=["project"], dependencies=[READ], route_class=ReadingRoute)


KeyName = Annotated[str, Path(description="The name of a key that has not been revoked.", examples=["planner"])]


@router.get("/project")
def get_project(caller: Reader, db: Db, room: KeptRoom) -> Project:
    """Returns the project that the caller's key belongs to: how much it stores, how long solvers worked for it, and its limits."""
    with db.read() as session:
        row, seconds = projects.get(session, caller.project), solver_time.used(session, caller.project)
    return Project.of(row, seconds, scope=caller.scope, bytes=room.stored(db, row.name))


@router.post("/keys", status_code=status.HTTP_201_CREATED)
@writing
def create_key(body: NewKey, caller: Admin, db: WholeDb) -> MadeKey:
    """Makes an API key of the caller's project. The answer is the only one that ever shows it.

    Admins of the project `default` may make keys of every project, such as the first one of a new project. The first key of a service
    is made at its command line, so that nobody can lock its owner out.
    """
    project = body.project or caller.project
    if project != caller.project:
        check_runs_service(caller)
    with db.write() as session:
        if caller.id is None and not keys.exist(session):
            raise CirisError(
                "first_key",
                "the first key locks everybody else out",
                field="name",
                hint="make it at the service's machine: `ciris key add`",
            )
        key = keys.add(session, body.name, body.scope, project, body.days)
        note = audit.note if project == caller.project else audit.note_of_service
        note(session, project, str(caller), Action.KEY_MADE, keys.made(body.name, body.scope, body.days))
    return MadeKey(name=body.name, scope=body.scope, key=key)


@router.get("/keys", dependencies=[ADMIN])
def list_keys(db: Db, after: Cursor = None, limit: Listed = 100) -> KeyPage:
    """Lists the keys of the caller's project, newest first, without what is secret."""
    with db.read() as session:
        page = keys.page(session, after, limit)
    return KeyPage(keys=[KeySummary.of(row) for row in page.rows], next=page.next)


@router.delete("/keys/{name}", status_code=status.HTTP_204_NO_CONTENT)
@writing
def revoke_key(name: KeyName, caller: Admin, db: Db) -> None:
    """Revokes the key of this name, the caller's own too. The service refuses it a second later at the latest."""
    with db.write() as session:
        keys.revoke(session, name, caller.project)
        audit.note(session, caller.project, str(caller), Action.KEY_REVOKED, name)


@router.get("/audit", dependencies=[ADMIN])
def list_audit(db: Db, after: Cursor = None, limit: Listed = 100) -> AuditPage:
    """Lists who changed keys and limits of the caller's project, and who deleted what, newest first."""
    with db.read() as session:
        page = audit.page(session, after, limit)
    return AuditPage(lines=[AuditLine.of(row) for row in page.rows], next=page.next)
