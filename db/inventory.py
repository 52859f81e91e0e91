"""This module counts what every project has, for those who run the service."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Select, func, or_, select
from sqlalchemy.orm import Session

from db import projects, retention
from db.models import ApiKeyRow, JobRow, RegionRow, SceneRow, StepRow
from db.session import Database
from db.states import ACCEPT, JOB, unfinished
from db.types import utcnow

Query = Select[*tuple[Any, ...]]


@dataclass(frozen=True)
class Contents:
    """Counts what a project has.

    Attributes:
        jobs_running: jobs that a solver has begun and that have not ended; those of covers are not counted, as for the limits.
        jobs_waiting: jobs that no solver has begun.
        keys: valid keys.
        key_used_at: when one of its keys was last used, whether it is valid or not.
    """

    bytes: int
    jobs_running: int
    jobs_waiting: int
    keys: int
    key_used_at: datetime | None
    scenes: int
    regions: int
    maps: int


def collect(database: Database) -> dict[str, Contents]:
    """Returns what every project has, by name."""
    with database.read() as session:
        names = [row.name for row in projects.all_of(session)]
        jobs, keys = _by_project(session, _jobs()), _by_project(session, _keys())
        scenes, regions, maps = (_by_project(session, query) for query in (_number(SceneRow), _number(RegionRow), _maps()))
    found = {}
    for name in names:
        # Each project has a session of its own: the log of SQLite cannot begin again before a session has ended.
        with database.read() as session:
            stored = retention.stored(session, name)
        (begun, waiting), (valid, used_at) = jobs.get(name, (0, 0)), keys.get(name, (0, None))
        numbers = {what: counted.get(name, (0,))[0] for what, counted in (("scenes", scenes), ("regions", regions), ("maps", maps))}
        found[name] = Contents(bytes=stored, jobs_running=begun, jobs_waiting=waiting, keys=valid, key_used_at=used_at, **numbers)
    return found


def _by_project(session: Session, query: Query) -> dict[str, tuple[Any, ...]]:
    return {project: tuple(values) for project, *values in session.execute(query)}


def _number(model: type[SceneRow] | type[RegionRow]) -> Query:
    return select(model.project, func.count()).group_by(model.project)


def _jobs() -> Query:
    begun, counted = JobRow.claimed_at.is_not(None), (JobRow.state.in_(unfinished(JOB)), JobRow.parent_id.is_(None))
    numbers = (func.count().filter(begun), func.count().filter(~begun))
    return select(JobRow.project, *numbers).where(*counted).group_by(JobRow.project)


def _keys() -> Query:
    valid = or_(ApiKeyRow.revoked_at.is_(None), ApiKeyRow.revoked_at > utcnow())
    return select(ApiKeyRow.project, func.count().filter(valid), func.max(ApiKeyRow.last_used_at)).group_by(ApiKeyRow.project)


def _maps() -> Query:
    stored = (StepRow.kind == ACCEPT, StepRow.proof_digest.is_not(None))  # only maps have their proof with this step
    return select(JobRow.project, func.count()).join(StepRow, StepRow.job_id == JobRow.id).where(*stored).group_by(JobRow.project)
