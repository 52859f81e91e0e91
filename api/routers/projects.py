"""Those who run the service, the admins of the project ``default``, manage the projects here, and see what each of them uses.

Everybody else is refused before anything is looked up, so nobody can tell from an answer whether a project exists.
"""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, status

from api.access import Operator, WholeDb
from api.reading import ReadingRoute
from api.room import KeptRoom, Room
from api.schemas.common import Listed, NameCursor
from api.schemas.projects import AnyProject, Limits, NewProject, ProjectPage, ProjectSummary
from api.writing import writing
from db import audit, projects, solver_time
from db.audit import Action
from db.models import ProjectRow
from db.session import Database

router = APIRouter(prefix="/v1/projects", tags=["projects"], route_class=ReadingRoute)

ProjectName = Annotated[str, Path(description="The name of a project.", examples=["welding"])]


@router.get("")
def list_projects(_: Operator, db: WholeDb, after: NameCursor = None, limit: Listed = 100) -> ProjectPage:
    """Lists the projects with their limits, by name."""
    with db.read() as session:
        rows, following = projects.page(session, after, limit)
        used = solver_time.used_by_all(session)
    return ProjectPage(projects=[ProjectSummary.of(row, used.get(row.name, 0.0)) for row in rows], next=following)


@router.post("", status_code=status.HTTP_201_CREATED)
@writing
def create_project(body: NewProject, caller: Operator, db: WholeDb, room: KeptRoom) -> AnyProject:
    """Makes a project. `POST /v1/keys` with `project` makes its first key."""
    with db.write() as session:
        row = projects.add(session, body.name)
        audit.note_of_service(session, row.name, str(caller), Action.PROJECT_MADE, row.name)
    return _described(row, db, room)


@router.get("/{project}")
def get_any_project(project: ProjectName, _: Operator, db: WholeDb, room: KeptRoom) -> AnyProject:
    """Returns a project: how much it stores, how long solvers worked for it, and its limits."""
    with db.read() as session:
        row = projects.get(session, project)
    return _described(row, db, room)


@router.patch("/{project}")
@writing
def set_limits(project: ProjectName, body: Limits, caller: Operator, db: WholeDb, room: KeptRoom) -> AnyProject:
    """Sets limits of a project. They hold at once."""
    with db.write() as session:
        row = projects.set_limits(session, project, body.model_dump(exclude_unset=True), str(caller))
    return _described(row, db, room)


def _described(row: ProjectRow, db: Database, room: Room) -> AnyProject:
    with db.read() as session:
        seconds = solver_time.used(session, row.name)
    return AnyProject.of(row, seconds, bytes=room.stored(db, row.name))
