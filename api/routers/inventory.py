"""Those who run the service, the admins of the project ``default``, see here what it is made of, and what every project uses."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from datetime import timedelta
from enum import StrEnum
from importlib.metadata import version
from typing import Annotated

from fastapi import APIRouter, Query
from fastapi.concurrency import run_in_threadpool

from api.access import Operator, WholeDb
from api.probes import Asked
from api.schemas.common import Listed, NameCursor
from api.schemas.projects import Inventory, InventoryProject, ProjectContents, WorkersAlike
from db import projects, solver_time, workers
from db.inventory import Contents
from db.pages import unknown
from db.session import Database
from db.settings import settings
from db.types import utcnow
from db.version import revisions

router = APIRouter(prefix="/v1", tags=["projects"])


class Order(StrEnum):
    """Says what projects are sorted by: their names, or the most of something first."""

    NAME = "name"
    BYTES = "bytes"
    SOLVER_SECONDS = "solver_seconds"
    JOBS = "jobs"
    KEYS = "keys"
    KEY_USED_AT = "key_used_at"
    SCENES = "scenes"
    REGIONS = "regions"
    MAPS = "maps"


Sorted = Annotated[Order, Query(description="Sort by name, or the most of something, or the latest, first.")]


@router.get("/inventory")
async def get_inventory(
    _: Operator, db: WholeDb, probes: Asked, sort: Sorted = Order.NAME, after: NameCursor = None, limit: Listed = 100
) -> Inventory:
    """Returns what the service is made of, and its projects with what they have.

    What projects have is counted at most once a minute where counting takes long, and then it is as of `counted_at`. The rest is of now.
    """
    counted, messages = await asyncio.gather(probes.contents(), probes.messages())
    age, contents = counted or (None, {})
    found, crew = await run_in_threadpool(_read, db, contents)
    if sort != Order.NAME:
        found.sort(key=lambda project: _amount(project, sort), reverse=True)
    names = [project.name for project in found]
    if after is not None and after not in names:
        raise unknown()
    first = 0 if after is None else names.index(after) + 1
    return Inventory(
        version=version("ciris"),
        revision=revisions()[-1],
        workers=crew,
        messages=messages,
        max_jobs=settings().max_jobs_per_project,
        max_keys=settings().max_keys_per_project,
        counted_at=None if age is None else utcnow() - timedelta(seconds=age),
        projects=found[first : first + limit],
        next=names[first + limit - 1] if first + limit < len(names) else None,
    )


def _read(db: Database, contents: Mapping[str, Contents]) -> tuple[list[InventoryProject], list[WorkersAlike]]:
    """Returns all projects, by name, and the workers that live."""
    with db.read() as session:
        rows, used = projects.all_of(session), solver_time.used_by_all(session)
        crew = [WorkersAlike(**vars(alike)) for alike in workers.alike(session)]
    has = {name: ProjectContents.of(found) for name, found in contents.items()}
    return [InventoryProject.of(row, used.get(row.name, 0.0), has=has.get(row.name)) for row in rows], crew


def _amount(project: InventoryProject, order: Order) -> float:
    """Returns what a project is sorted by; what is not counted, or was never, comes last."""
    if order == Order.SOLVER_SECONDS:
        return project.solver_seconds
    if project.has is None:
        return -1.0
    if order == Order.JOBS:
        return project.has.jobs_running + project.has.jobs_waiting
    if order == Order.KEY_USED_AT:
        return 0.0 if project.has.key_used_at is None else project.has.key_used_at.timestamp()
    return float(getattr(project.has, order))
