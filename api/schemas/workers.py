"""These models describe the workers of the service."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Self

from pydantic import BaseModel, Field

from api.schemas.common import Page
from api.schemas.progress import HeldWork
from db.models import WorkerRow
from db.states import WorkerState
from db.workers import WorkerKind


class Worker(BaseModel):
    """Describes a worker that lives, and what it does at this moment."""

    id: str = Field(description="The worker's id, a new one each time that it starts.")
    kind: WorkerKind = Field(description="`solve` certifies pairs and does steps; `control` decides what jobs do next.")
    process: str = Field(description="Name of its process: host, process number, and when it began, with colons between.")
    host: str = Field(description="The machine or container that it runs on, with a mark that tells it from others of the same name.")
    version: str = Field(description="Version of ciris.")
    processes: int = Field(description="Number of pieces of work that it does at the same time.")
    busy: int = Field(description="Number of pieces of work that its processes hold now, for all projects. A decision is none.")
    cores: int = Field(description="Cores that it may use.")
    memory_bytes: int = Field(description="Memory that all processes on its machine, or in its container, may use together.")
    state: WorkerState = Field(description="What it does, as it said last. One that starts or compiles takes no work yet.")
    wanted: WorkerState = Field(description="What it was asked to do. It learns of it within seconds.")
    trouble: str | None = Field(description="What fails of what it does again and again, such as its sweep; null where all goes well.")
    started_at: datetime = Field(description="When it began.")
    seen_at: datetime = Field(description="When it said last that it lives. It says so every ten seconds, and is gone after sixty.")
    work: list[HeldWork] = Field(description="What its processes hold of the jobs of the caller's project.")

    @classmethod
    def of(cls, row: WorkerRow, busy: int, work: Sequence[HeldWork]) -> Self:
        return cls(
            id=row.id,
            kind=WorkerKind(row.kind),
            process=row.process,
            host=row.process.rsplit(":", 2)[0],
            version=row.version,
            processes=row.processes,
            busy=busy,
            cores=row.cores,
            memory_bytes=row.memory_bytes,
            state=WorkerState(row.state),
            wanted=WorkerState(row.wanted),
            trouble=row.trouble,
            started_at=row.created_at,
            seen_at=row.seen_at,
            work=list(work),
        )


class WorkerPage(Page):
    """Holds one page of the workers that live, those that began last first."""

    workers: list[Worker] = Field(description="The workers.")
    missing: list[str] = Field(
        description="What keeps jobs waiting, in the words of their `status`: `no worker`, `no control worker`, `all workers paused`, "
        "`all control workers paused`, `workers get ready` or `workers compile, which takes some minutes, once`. "
        "Empty where workers of both kinds take work."
    )
