"""This module decides what the workers do next: a fair order over projects, API keys and jobs, in which every job gets its turn.

A message to the solvers only says that there is work. Which work it is, this module decides when a solver is free. It goes to the
project whose work the fewest solvers do now, however many keys and jobs the project has; within it to the key of which the same is
true; within the key to the job that was served least. So a newcomer gets the next solver that is free, however long pieces of others
take. Of projects for which as many solvers work, that one goes first for which they worked least lately (db.solver_time), and so it is
with the keys of a project. While no solver is free, a process beside them does pieces of new jobs, and accepts regions of all jobs.

``jobs.served`` counts the seconds that a job was given, divided by its share. The job with the least goes next (stride scheduling:
Waldspurger, Weihl 1995). Each step of priority doubles a job's share of its key's work.

The queries are built once, with the time and the job as parameters, because building one takes longer than running it.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from datetime import timedelta
from functools import cache
from typing import Literal

from sqlalchemy import ColumnElement, Row, Select, and_, bindparam, case, exists, func, or_, select
from sqlalchemy.orm import Session, aliased

from db import jobs, leases, pairs, solver_time, steps, workers
from db.models import JobRow, PairRow, StepRow
from db.states import ACCEPT, LEAD, PIECE, JobState, PairState, StepState
from db.types import Utc, utcnow

MOST_KEYS = 100_000
"""The jobs of at most this many keys are compared when the next one is chosen."""
NEW_SECONDS = 60.0
"""A job counts as new for this long after a solver has first begun a piece of it."""
ROUNDING = 1e-9
"""Sums of fractions of batches may be too large by so much."""
Placed = Row[tuple[str, str, str | None, int]]
"""A job of :func:`_placed`."""


def next_job(session: Session) -> str | None:
    """Returns the id of the job whose work is done next; None when there is no work."""
    return next(iter(_in_turn(session, places=1, most=MOST_KEYS)), None)


def in_order(session: Session, limit: int) -> Sequence[str]:
    """Returns the ids of at most this many jobs with work that nobody does, in the order in which they get a worker as things are."""
    return _in_turn(session, places=limit, most=limit)


def _in_turn(session: Session, places: int, most: int) -> Sequence[str]:
    """Returns the ids of jobs with work: the first one of each key, by turns, then the second one of each key, and so on.

    Args:
        places: how many jobs of a key are among them.
        most: how many jobs are.
    """
    found = session.execute(_placed(), {"now": utcnow(), "places": places, "most": most}).all()
    if len(found) < 2:
        return [one.id for one in found]
    return [one.id for one in _sorted(session, found, *_held(session))]


def _sorted(
    session: Session, found: Sequence[Placed], of_project: defaultdict[str, float], of_key: Counter[tuple[str, str | None]]
) -> Sequence[Placed]:
    """Returns jobs in the order of work, from the solvers that each project and each key has."""
    key_lately = solver_time.lately(session)
    lately = _of_projects(key_lately)

    def turn(one: Placed) -> tuple[int, float, float, str, int, float, str]:
        project, key = one.project, (one.project, one.key_id)
        return one.place, of_project[project], lately[project], project, of_key[key], key_lately.get(key, 0.0), one.key_id or ""

    return sorted(found, key=turn)


def newcomer(session: Session, *, instead_of: str | None = None, accepts: bool = False) -> str | None:
    """Returns the id of the new job that gets a process beside the solvers, while they do other work; None when there is none.

    It is the first in the order of work among those of which no solver does anything. A step that was begun before is left to the solvers.
    A project for which more solvers work than for another one that has work gets no process: its new jobs wait for its own.

    Args:
        instead_of: the job that has this process. The process goes on to a newer job, or to one of a project or key for which fewer work.
        accepts: whether the process accepts a region of that job for :func:`to_accept`. Then it goes on to any new job.
    """
    now = utcnow()
    since = now - timedelta(seconds=NEW_SECONDS)
    found = session.execute(_placed("new"), {"now": now, "since": since, "places": 1, "most": MOST_KEYS}).all()
    if not found:
        return None
    of_project, of_key = _held(session)
    mine = session.execute(select(JobRow.project, JobRow.key_id, JobRow.created_at).where(JobRow.id == instead_of)).one_or_none()
    if mine is not None and accepts:  # new jobs get this process as if it were free
        of_project[mine.project] -= 1
        of_key[mine.project, mine.key_id] -= 1
    may = _beside(session, found, of_project, of_key)
    if mine is not None and not accepts:
        newer = set(session.scalars(select(JobRow.id).where(JobRow.id.in_([one.id for one in may]), JobRow.created_at > mine.created_at)))

        def before(one: Placed) -> bool:
            if one.id in newer or of_project[one.project] < of_project[mine.project]:
                return True
            return one.project == mine.project and of_key[one.project, one.key_id] < of_key[mine.project, mine.key_id]

        may = [one for one in may if before(one)]
    return next((one.id for one in may), None)


def to_accept(session: Session) -> str | None:
    """Returns the id of the job of which a process beside the solvers accepts a region, while no new job waits; None when there is none.

    It is the first in the order of work. A region that somebody has begun to accept before is left to the solvers. A project for which
    more solvers work than for another one that has work gets no process, as in :func:`newcomer`.
    """
    found = session.execute(_placed("region"), {"now": utcnow(), "places": 1, "most": MOST_KEYS}).all()
    return next((one.id for one in _beside(session, found, *_held(session))), None) if found else None


def _beside(
    session: Session, found: Sequence[Placed], of_project: defaultdict[str, float], of_key: Counter[tuple[str, str | None]]
) -> Sequence[Placed]:
    """Returns the jobs, in the order of work, that may have a process beside the solvers: those of projects with the fewest solvers."""
    waiting = session.execute(_placed(), {"now": utcnow(), "places": 1, "most": MOST_KEYS}).all()
    with_work = {one.project for one in waiting} | {project for project, solvers in of_project.items() if solvers > 0}
    least = min((of_project[project] for project in with_work), default=0.0)  # another process may have taken it all meanwhile
    return [one for one in _sorted(session, found, of_project, of_key) if of_project[one.project] <= least]


def others_wait(session: Session, job_id: str) -> bool:
    """Says whether another project, or another key of the same one, has work and fewer solvers than the job's."""
    project, key_id = session.execute(select(JobRow.project, JobRow.key_id).where(JobRow.id == job_id)).one()
    firsts = session.execute(_placed(), {"now": utcnow(), "places": 1, "most": MOST_KEYS}).all()
    if all((first.project, first.key_id) == (project, key_id) for first in firsts):
        return False
    of_project, of_key = _held(session)
    others = {first.project for first in firsts if of_project[first.project] < of_project[project]}
    return bool(others) or any(of_key[project, first.key_id] < of_key[project, key_id] for first in firsts if first.project == project)


def newcomer_waits(session: Session, job_id: str) -> bool:
    """Says whether another job of the same key has work, and no solver has begun it yet."""
    project, key_id = session.execute(select(JobRow.project, JobRow.key_id).where(JobRow.id == job_id)).one()
    same = (JobRow.project == project, JobRow.key_id.is_not_distinct_from(key_id), JobRow.id != job_id)
    query = select(JobRow.id).where(*same, JobRow.claimed_at.is_(None), _has_work()).limit(1)
    return session.scalar(query, {"now": utcnow()}) is not None


def is_there(session: Session) -> bool:
    """Says whether there is work."""
    return session.scalar(_any(), {"now": utcnow()}) is not None


def claim(
    session: Session, job_id: str, *, lease_seconds: float, batch_seconds: float, fresh: bool = False
) -> pairs.Claim | steps.Claim | None:
    """Claims one piece of the job's work: a step that the job waits for, else the latest region to accept, else pairs.

    So a region is there for planners soon after it was certified. A job accepts one region at a time, and rests in between
    (``jobs.accept_after``). The function returns None when other workers were faster.

    Args:
        fresh: whether steps that the job waits for and that were begun before are left to others.
    """
    job = jobs.lock(session, job_id)
    claimed: pairs.Claim | steps.Claim | None = None
    if job.state == JobState.RUNNING:
        claimed = steps.claim(session, job, accepts=False, lease_seconds=lease_seconds, fresh=fresh)
    if claimed is None:
        claimed = _claim_region(session, job, lease_seconds)
    if claimed is None and job.state == JobState.RUNNING:
        claimed = pairs.claim(session, job, lease_seconds=lease_seconds, batch_seconds=batch_seconds)
    return claimed


def claim_region(session: Session, job_id: str, *, lease_seconds: float) -> steps.Claim | None:
    """Claims the job's latest region to accept. It returns None when others were faster, or have begun one of them before."""
    return _claim_region(session, jobs.lock(session, job_id), lease_seconds, fresh=True)


def _claim_region(session: Session, job: JobRow, lease_seconds: float, *, fresh: bool = False) -> steps.Claim | None:
    if session.scalar(_has_region_now(fresh), {"job": job.id, "now": utcnow()}) is None:
        return None
    return steps.claim(session, job, accepts=True, lease_seconds=lease_seconds)


def to_give_up(session: Session) -> leases.Lost | None:
    """Returns the lease of a step that its holder is to give up, so that others get a solver within seconds; None when there is none.

    That is when all solvers do steps, whose end nobody knows, and a project for which none works has work. The project that holds most
    steps, if it holds several, gives up the one that was asked for last. No step is given up twice. Work of other kinds ends within
    seconds, or gives way by itself; the accepting of a region may also have the process beside the solvers.
    """
    long = (StepRow.state == StepState.RUNNING, StepRow.kind.not_in((LEAD, PIECE, ACCEPT)))
    of_project = Counter(session.scalars(select(JobRow.project).join(StepRow, StepRow.job_id == JobRow.id).where(*long)))
    if max(of_project.values(), default=0) < 2 or of_project.total() < workers.solvers(session):
        return None
    firsts = session.execute(_placed(), {"now": utcnow(), "places": 1, "most": MOST_KEYS}).all()
    if all(first.project in of_project for first in firsts) or leases.count_of_keys(session).total() > of_project.total():
        return None
    ((project, _),) = of_project.most_common(1)
    of_it = select(StepRow).join(JobRow, JobRow.id == StepRow.job_id).where(*long, JobRow.project == project, StepRow.attempts == 1)
    step = session.scalar(of_it.order_by(StepRow.id.desc()).limit(1))
    if step is None:
        return None
    return leases.Lost(step.job_id, step.lease_token or "", step.worker or "", "another project had no solver", alone=False)


def busy_solvers(session: Session, *, batch_seconds: float) -> int:
    """Returns how many solving processes would be busy now if there were enough: one for each piece that is claimed or could be.

    Open pairs count as the pieces in which they would be claimed, so that a job of many short pairs does not ask for many processes.
    """
    batches = 0
    for job_id, count in session.execute(
        select(JobRow.id, JobRow.open_pairs).where(JobRow.state == JobState.RUNNING, JobRow.open_pairs > 0)
    ):
        seconds = pairs.batch_length(count, batch_seconds)
        share = case((PairRow.forecast_seconds < seconds, PairRow.forecast_seconds / seconds), else_=1.0)
        full = session.scalar(select(func.sum(share)).where(PairRow.job_id == job_id, PairRow.state == PairState.OPEN)) or 0.0
        batches += max(1, math.ceil(max(full, count / pairs.MOST_TOGETHER) - ROUNDING))
    urgent = steps.is_open(StepRow, JobRow.id, accepts=False)
    steps_open = session.scalar(select(func.count()).select_from(StepRow).join(JobRow, urgent).where(JobRow.state == JobState.RUNNING))
    regions = session.scalar(select(func.count()).select_from(JobRow).where(_has_region()), {"now": utcnow()})
    held = leases.count_of_workers(session).total()
    return held + batches + (steps_open or 0) + (regions or 0)


def jobs_without_solver(session: Session) -> int:
    """Returns how many jobs have work of which no solver does any."""
    waiting = select(func.count()).select_from(JobRow).where(_has_work(), ~_has_solver())
    return session.scalar(waiting, {"now": utcnow()}) or 0


def served_by_now(session: Session) -> float:
    """Returns what a job that starts now counts as served, so that it is neither ahead of those that wait for work nor behind them."""
    waiting = session.scalar(_least_served(), {"now": utcnow()})
    if waiting is None:
        waiting = session.scalar(select(func.max(JobRow.served)).where(JobRow.state == JobState.RUNNING))
    return waiting or 0.0


def _held(session: Session) -> tuple[defaultdict[str, float], Counter[tuple[str, str | None]]]:
    """Returns for how many leases each project, and each key, is worked for."""
    of_key = leases.count_of_keys(session)
    return _of_projects(of_key), of_key


def _of_projects(of_key: Mapping[tuple[str, str | None], float]) -> defaultdict[str, float]:
    """Returns the sum over the keys of each project."""
    of_project: defaultdict[str, float] = defaultdict(float)
    for (project, _), count in of_key.items():
        of_project[project] += count
    return of_project


_NOW = bindparam("now", type_=Utc())


@cache
def _placed(of: Literal["work", "new", "region"] = "work") -> Select[tuple[str, str, str | None, int]]:
    """Returns the query for the jobs of each key in the order in which they are served: the one served least, and of several the newest.

    So a job that has just started gets its first piece at once, also beside a hundred of the same key.

    Args:
        of: which jobs are among them. ``new``: new ones of which no solver does anything, and steps that were begun before count as no
            work; the newest goes first whatever it was served, so that a small job goes on to its end beside others that wait.
            ``region``: those with a region to accept that nobody has begun before. ``work``: all that have work.
    """
    newest = (JobRow.created_at.desc(), JobRow.id)
    order = newest if of == "new" else (JobRow.served, *newest)
    place = func.row_number().over(partition_by=(JobRow.project, JobRow.key_id), order_by=order).label("place")
    if of == "new":
        among = and_(_is_new(), _has_work(fresh=True), ~_has_solver())
    else:
        among = _has_region(fresh=True) if of == "region" else _has_work()
    placed = select(JobRow.id, JobRow.project, JobRow.key_id, place).where(among).subquery()
    columns = (placed.c.id, placed.c.project, placed.c.key_id, placed.c.place)
    return select(*columns).where(placed.c.place <= bindparam("places")).order_by(placed.c.place).limit(bindparam("most"))


@cache
def _any() -> Select[str]:
    return select(JobRow.id).where(_has_work()).limit(1)


@cache
def _least_served() -> Select[float]:
    return select(func.min(JobRow.served)).where(_has_work())


@cache
def _has_region_now(fresh: bool) -> Select[str]:
    return select(JobRow.id).where(JobRow.id == bindparam("job"), _has_region(fresh=fresh))


def _is_new() -> ColumnElement[bool]:
    return or_(JobRow.claimed_at.is_(None), JobRow.claimed_at > bindparam("since", type_=Utc()))


def _has_solver() -> ColumnElement[bool]:
    """Returns the condition that a solver does a piece of the job."""
    return or_(JobRow.running_pairs > 0, exists().where(StepRow.job_id == JobRow.id, StepRow.state == StepState.RUNNING))


def _has_work(*, fresh: bool = False) -> ColumnElement[bool]:
    """Returns the condition that :func:`claim` would find work.

    Args:
        fresh: whether steps that the job waits for and that were begun before do not count.
    """
    is_open = steps.is_open(StepRow, JobRow.id, accepts=False)
    step = exists().where(is_open & (StepRow.attempts == 0) if fresh else is_open)
    return or_(and_(JobRow.state == JobState.RUNNING, or_(JobRow.open_pairs > 0, step)), _has_region())


def _has_region(*, fresh: bool = False) -> ColumnElement[bool]:
    """Returns the condition that the job has a region to accept, has rested, and nobody is accepting one of its regions.

    Args:
        fresh: whether nobody has begun one of those before, either.
    """
    step, other = aliased(StepRow), aliased(StepRow)
    waits = exists().where(steps.is_open(step, JobRow.id, accepts=True))
    begun = and_(other.state.in_((StepState.OPEN, StepState.RUNNING)), other.attempts > 0) if fresh else other.state == StepState.RUNNING
    taken = exists().where(other.job_id == JobRow.id, other.kind == ACCEPT, begun)
    return and_(JobRow.state.in_((JobState.RUNNING, JobState.CANCELLING)), JobRow.accept_after <= _NOW, waits, ~taken)
