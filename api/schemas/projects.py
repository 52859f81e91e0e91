"""These models describe projects: the caller's own, and for those who run the service all of them, with what they have."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Self

from pydantic import BaseModel, BeforeValidator, Field

from api.schemas.common import Page
from db import projects, solver_time
from db.inventory import Contents
from db.keys import Scope
from db.models import ProjectRow
from db.projects import MOST_BYTES, MOST_DAYS, MOST_SECONDS
from db.states import WorkerState
from db.workers import WorkerKind
from jobs import patterns
from jobs.fields import Real, Request, integer

_BYTES = "The service refuses new scenes and jobs once the project stores this many bytes; null for no limit."
_DAYS = "Days after a job's end when its data is deleted, except its regions; null for never."
_SECONDS = "The service refuses new jobs once solvers have worked for the project this many seconds in a month; null for no limit."

WholeBytes = Annotated[int, Field(ge=0, le=MOST_BYTES), BeforeValidator(integer)]


class ProjectSummary(BaseModel):
    """Describes a project in lists."""

    name: str = Field(description="The project's name.")
    max_bytes: int | None = Field(description=_BYTES)
    keep_days: float | None = Field(description=_DAYS)
    max_solver_seconds: float | None = Field(description=_SECONDS)
    solver_seconds: float = Field(description="Seconds in which solvers have worked for the project since the calendar month (UTC) began.")
    created_at: datetime = Field(description="When the project was made.")

    @classmethod
    def of(cls, row: ProjectRow, solver_seconds: float, **more: Any) -> Self:
        limits: dict[str, Any] = projects.limits(row)
        return cls(name=row.name, **limits, solver_seconds=solver_seconds, created_at=row.created_at, **more)


class AnyProject(ProjectSummary):
    """Describes a project."""

    bytes: int = Field(description="Bytes of scenes, jobs, proofs and cells that the project stores, as of some seconds ago.")
    month_ends_at: datetime = Field(description="When the next month begins, and `solver_seconds` is 0 again.")

    @classmethod
    def of(cls, row: ProjectRow, solver_seconds: float, **more: Any) -> Self:
        return super().of(row, solver_seconds, month_ends_at=solver_time.month_ends(), **more)


class Project(AnyProject):
    """Describes the caller's project."""

    scope: Scope = Field(description="What the caller's key allows.")


class ProjectPage(Page):
    """Holds one page of the projects, by name."""

    projects: list[ProjectSummary] = Field(description="The projects.")


class NewProject(Request):
    """Asks for a project."""

    name: str = Field(pattern=patterns.KEY_NAME, description="No other project may have this name.", examples=["welding"])


class Limits(Request):
    """Sets limits of a project. Those that are left out stay; 0 or null takes one away."""

    max_bytes: Annotated[WholeBytes | None, Field(description=_BYTES, examples=[50_000_000_000])] = None
    keep_days: Annotated[Real | None, Field(ge=0, le=MOST_DAYS, description=_DAYS, examples=[30])] = None
    max_solver_seconds: Annotated[Real | None, Field(ge=0, le=MOST_SECONDS, description=_SECONDS, examples=[720_000])] = None


class ProjectContents(BaseModel):
    """Counts what a project has."""

    bytes: int = Field(description="Bytes of scenes, jobs, proofs and cells.")
    jobs_running: int = Field(description="Jobs that a solver has begun and that have not ended, those of covers not counted.")
    jobs_waiting: int = Field(description="Jobs that no solver has begun yet, those of covers not counted.")
    keys: int = Field(description="Keys that are valid.")
    key_used_at: datetime | None = Field(
        description="When a key of the project was last used, or up to ten minutes before; null for never."
    )
    scenes: int = Field(description="Scenes.")
    regions: int = Field(description="Certified regions.")
    maps: int = Field(description="Maps that are stored.")

    @classmethod
    def of(cls, found: Contents) -> Self:
        return cls(**vars(found))


class InventoryProject(ProjectSummary):
    """Describes a project with what it has."""

    has: ProjectContents | None = Field(description="What it has, as of `counted_at`; null where that is not counted yet.")


class WorkersAlike(BaseModel):
    """Counts the workers of one kind, version and state."""

    kind: WorkerKind = Field(description="`solve` certifies pairs and does steps; `control` decides what jobs do next.")
    version: str = Field(description="Version of ciris.")
    state: WorkerState = Field(description="What they do, as they said last.")
    workers: int = Field(description="Number of such workers.")
    processes: int = Field(description="Number of pieces of work that they do at the same time.")


class Inventory(Page):
    """Says what the service is made of, and holds one page of its projects with what they have."""

    version: str = Field(description="Version of the program that answers.")
    revision: str = Field(description="Revision of the database's tables.")
    workers: list[WorkersAlike] = Field(description="The workers that live.")
    messages: dict[str, int] = Field(description="Messages that wait, by queue; empty where the queue does not answer.")
    max_jobs: int = Field(description="Jobs that have not ended that each project may have, those of covers not counted.")
    max_keys: int = Field(description="Keys that each project may have.")
    counted_at: datetime | None = Field(description="When it was counted what projects have; null where it is not counted yet.")
    projects: list[InventoryProject] = Field(description="The projects.")
