"""This module counts the seconds in which solvers work for a project, by calendar month in UTC, and holds projects to their limits.

What a pair or a step took is counted when its result is saved, in the same transaction. Each API key of a project has one row for each
month, so that nobody adds up the pairs and steps of the past, and deleting them gives nothing back. The row also says how much of that was
lately, by which projects, and the keys of a project, take turns.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import clock
from db.models import ProjectRow, SolverTimeRow
from db.session import inserting
from db.types import utcnow

HALF_LIFE_SECONDS = 15.0
"""After this time, work counts half when projects and keys take turns: longer than most pieces of work, and soon enough that nobody pays
for long for having had all solvers while nobody else wanted them."""
FORGOTTEN_SECONDS = 10 * HALF_LIFE_SECONDS
"""Keys for which nothing was saved in this time count as if nobody had ever worked for them."""


def add(session: Session, project: str, seconds: float, key_id: str | None = None) -> None:
    """Counts seconds of work for a key, or for jobs of no key. It is the last thing that a transaction does: others wait for the row."""
    now = clock.now(session)
    key = {"project": project, "key_id": key_id or "", "month": _month(utcnow())}
    session.execute(inserting(session, SolverTimeRow).values(**key, seconds=0.0, lately=0.0).on_conflict_do_nothing())
    row = session.get_one(SolverTimeRow, key, with_for_update=True)
    row.seconds += seconds
    row.lately, row.counted_at = _remembered(row, now) + seconds, now


def lately(session: Session) -> dict[tuple[str, str | None], float]:
    """Returns the seconds in which solvers have worked lately, by (project, key); what is longer ago counts less.

    Who gives time to the one with the least gives each the same in the long run, and owes nothing to one that had no work.
    """
    now = clock.now(session)
    recent = SolverTimeRow.counted_at > now - timedelta(seconds=FORGOTTEN_SECONDS)
    rows = session.scalars(select(SolverTimeRow).where(SolverTimeRow.month == _month(utcnow()), recent))
    return {(row.project, row.key_id or None): _remembered(row, now) for row in rows}


def _remembered(row: SolverTimeRow, now: datetime) -> float:
    """Returns the seconds that a row has lately, as they count now."""
    if row.counted_at is None:
        return 0.0
    return row.lately * 0.5 ** (max((now - row.counted_at).total_seconds(), 0.0) / HALF_LIFE_SECONDS)


def used(session: Session, project: str) -> float:
    """Returns the seconds in which solvers have worked for the project in the present month."""
    mine = (SolverTimeRow.project == project, SolverTimeRow.month == _month(utcnow()))
    return session.scalar(select(func.sum(SolverTimeRow.seconds)).where(*mine)) or 0.0


def used_by_all(session: Session) -> dict[str, float]:
    """Returns the same of every project for which solvers have worked in the present month, by name."""
    query = select(SolverTimeRow.project, func.sum(SolverTimeRow.seconds)).where(SolverTimeRow.month == _month(utcnow()))
    return dict(session.execute(query.group_by(SolverTimeRow.project)).all())


def month_ends() -> datetime:
    """Returns the moment at which the next month begins, and counting with it."""
    first = utcnow().replace(day=1, hour=0, minute=0, second=0, microsecond=0)
    return (first + timedelta(days=31)).replace(day=1)


def check(session: Session, project: str) -> None:
    """Refuses another job of a project that has used up its time of this month.

    Raises:
        CirisError: time_quota.
    """
    most, seconds = session.get_one(ProjectRow, project).max_solver_seconds, used(session, project)
    if most is not None and seconds >= most:
        problem = f"the project {project} has used {seconds:.0f} of the {most:.0f} s of solvers that it may use in {_month(utcnow())}"
        again = f"{month_ends():%Y-%m-%d} at 00:00 UTC"
        hint = f"it may start jobs again on {again}; or have the limit raised: `ciris project set {project} --max-solver-seconds N`"
        raise CirisError("time_quota", problem, hint=hint)


def _month(time: datetime) -> str:
    return f"{time:%Y-%m}"
