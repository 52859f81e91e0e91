"""This module creates, lists, cancels and ends jobs. Every transaction that changes anything of a job begins with :func:`lock`."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any, TypedDict, Unpack
from uuid import uuid4

from sqlalchemy import Select, and_, exists, func, or_, select
from sqlalchemy.orm import Session, aliased

from certifier.errors import CirisError
from certifier.outcome import Outcome
from db import clock, events, labels, leases, pages, solver_time, traces, webhooks
from db.ids import found
from db.models import GrowthRow, JobRow, SceneRow, StepRow
from db.pages import Page
from db.session import insert_new
from db.settings import settings
from db.states import ACCEPT, JOB, STEP, JobState, transition, unfinished
from db.types import utcnow

FINISH = "finish"
"""The kind of the action of a job that is to end."""
ROW_BYTES = 1000
"""A job counts as this many bytes besides its options and labels."""


def create(
    session: Session,
    *,
    kind: str,
    scene_id: str,
    options: dict[str, Any],
    deadline_seconds: float | None = None,
    idempotency_key: str | None = None,
    request_digest: str | None = None,
    key_id: str | None = None,
    priority: int = 0,
    retry_of: str | None = None,
    attempt: int = 1,
    parent_id: str | None = None,
    number: int | None = None,
    given_labels: Mapping[str, str] | None = None,
) -> tuple[JobRow, bool]:
    """Creates a queued job in the scene's project and returns it with True, or returns the job of the same idempotency key with False.

    The caller commits and then sends ``coordinate`` for the job. If sending fails, the sweeper sends it later.

    Raises:
        CirisError: scene_not_found, when the scene was deleted a moment ago; idempotency_conflict, when the key was used for a
            different request; quota_exceeded, when the project or the API key has as many unfinished jobs as it may; time_quota, when
            solvers have worked for the project as long as they may this month.
    """
    job_id, project = str(uuid4()), _project_of(session, scene_id)
    now = clock.now(session)
    new = {
        "id": job_id,
        "project": project,
        "kind": kind,
        "scene_id": scene_id,
        "options": options,
        "created_at": now,
        "deadline_at": None if deadline_seconds is None else now + timedelta(seconds=deadline_seconds),
        "idempotency_key": idempotency_key,
        "request_digest": request_digest,
        "key_id": key_id,
        "priority": priority,
        "retry_of": retry_of,
        "attempt": attempt,
        "parent_id": parent_id,
        "number": number,
        "bytes": ROW_BYTES + len(json.dumps([options, dict(given_labels or {})])),
        "traceparent": traces.here(),
    }
    if insert_new(session, JobRow, [new]):
        if parent_id is None:
            _check_quota(session, project, key_id)
            solver_time.check(session, project)
        job = lock(session, job_id)
        labels.put(session, job_id, given_labels or {})
        events.emit(session, job, "job", {"state": job.state})
        return job, True
    job = session.scalars(select(JobRow).where(JobRow.idempotency_key == idempotency_key)).one()
    if job.request_digest != request_digest:
        raise CirisError(
            "idempotency_conflict",
            "this idempotency key was used for a different request",
            field="Idempotency-Key",
            hint="use a new key for a new request",
        )
    return job, False


def _project_of(session: Session, scene_id: str) -> str:
    """Returns the scene's project. Nobody deletes the scene until the caller has committed."""
    query = select(SceneRow.project).where(SceneRow.id == scene_id).with_for_update(read=True, key_share=True)
    project = session.scalar(query)
    if project is None:
        raise CirisError("scene_not_found", f"the scene {scene_id} was deleted", field="scene", hint="add it again")
    return project


def _check_quota(session: Session, project: str, key_id: str | None) -> None:
    """Refuses the job just added when its project or its API key has too many unfinished jobs, those of a cover not counted.

    Several requests at the same moment may each count as the last job that fits, so a limit may be exceeded a little.
    """
    most_of_key, most_of_project = settings().max_jobs_per_key, settings().max_jobs_per_project
    of_project = (JobRow.project == project, JobRow.state.in_(unfinished(JOB)), JobRow.parent_id.is_(None))
    counts = dict(session.execute(select(JobRow.key_id, func.count()).where(*of_project).group_by(JobRow.key_id)).all())
    if counts[key_id] > most_of_key:
        raise _too_many("an API key", most_of_key, "CIRIS_MAX_JOBS_PER_KEY")
    if sum(counts.values()) > most_of_project:
        raise _too_many("a project", most_of_project, "CIRIS_MAX_JOBS_PER_PROJECT")


def _too_many(who: str, limit: int, setting: str) -> CirisError:
    message = f"{who} has as many unfinished jobs as it may have at a time: {limit}"
    return CirisError("quota_exceeded", message, hint=f"wait for some to end, cancel some, or have {setting} raised")


def retry(session: Session, job_id: str, key_id: str | None = None) -> JobRow:
    """Creates a job with the same scene, options, webhook and time to its deadline as one that failed or was cancelled.

    A job is retried once: another call returns the same new job.

    Raises:
        CirisError: job_not_found, or job_not_retryable when it has not ended or has succeeded.
    """
    job = lock(session, get(session, job_id).id)
    if job.state not in (JobState.FAILED, JobState.CANCELLED):
        message = f"the job is {job.state}; only a failed or cancelled one can be retried"
        raise CirisError("job_not_retryable", message, field="job", hint="create a new one")
    again, made = create(
        session,
        kind=job.kind,
        scene_id=job.scene_id,
        options=job.options,
        deadline_seconds=None if job.deadline_at is None else (job.deadline_at - job.created_at).total_seconds(),
        idempotency_key=f"retry:{job.id}",
        key_id=key_id,
        priority=job.priority,
        retry_of=job.id,
        attempt=job.attempt + 1,
        given_labels=labels.of_jobs(session, [job.id]).get(job.id),
    )
    if made:
        webhooks.copy(session, job.id, again.id)
    return again


def get(session: Session, job_id: str) -> JobRow:
    """Returns the job with this id, or with the only id that begins like this.

    Raises:
        CirisError: job_not_found, or ambiguous_id.
    """
    return _found(found(session, JobRow, job_id), job_id)


def lock(session: Session, job_id: str) -> JobRow:
    """Returns the job with this id as it is now, locked until the transaction ends.

    SQLite needs no lock: its writing transactions exclude each other.

    Raises:
        CirisError: job_not_found.
    """
    return _found(locked(session, job_id), job_id)


def locked(session: Session, job_id: str) -> JobRow | None:
    """Does as :func:`lock`, but returns None where the job was deleted."""
    return session.get(JobRow, job_id, with_for_update=True, populate_existing=True)


def _found(job: JobRow | None, job_id: str) -> JobRow:
    if job is None:
        raise CirisError(
            "job_not_found", f"there is no job {job_id!r}", field="job", hint="`ciris job ls`, or `jobs()` in Python, lists them"
        )
    return job


class Filters(TypedDict, total=False):
    """Says which jobs are wanted. Without ``parent_id`` they are those that somebody asked for, and with it those of a cover."""

    state: str | None
    kind: str | None
    outcome: str | None
    scene_id: str | None
    key_id: str | None
    ended: bool | None
    parent_id: str | None
    given_labels: Mapping[str, str] | None
    search: str | None


def page(
    session: Session, *, after: str | None = None, before: str | None = None, limit: int = 50, **filters: Unpack[Filters]
) -> Page[JobRow]:
    """Returns one page of the jobs that match the filters.

    Args:
        after, before: the ``next`` or the ``previous`` of another page.

    Raises:
        CirisError: cursor.
    """
    return pages.page(session, JobRow, _matching(**filters), after, limit, before)


def count(session: Session, **filters: Unpack[Filters]) -> int:
    """Returns how many jobs match the filters."""
    return session.scalar(select(func.count()).select_from(_matching(**filters).subquery())) or 0


def _matching(**filters: Unpack[Filters]) -> Select[JobRow]:
    columns = (JobRow.state, JobRow.kind, JobRow.outcome, JobRow.scene_id, JobRow.key_id)
    query = select(JobRow).where(*(column == value for column in columns if (value := filters.get(column.key)) is not None))
    if (ended := filters.get("ended")) is not None:
        query = query.where(JobRow.state.in_(unfinished(JOB)) != ended)
    if given_labels := filters.get("given_labels"):
        query = query.where(labels.has(given_labels))
    if (search := filters.get("search")) is not None:
        query = query.where(labels.mentions(search))
    return query.where(JobRow.parent_id.is_not_distinct_from(filters.get("parent_id")))


def children(session: Session, job_id: str) -> Sequence[JobRow]:
    """Returns the jobs that grow regions for a cover, or have, in order."""
    return session.scalars(select(JobRow).where(JobRow.parent_id == job_id).order_by(JobRow.number)).all()


def unfinished_with(session: Session, given_labels: Mapping[str, str], limit: int) -> Sequence[str]:
    """Returns the ids of unfinished jobs that have all of these labels, and that somebody asked for."""
    wanted = (JobRow.state.in_(unfinished(JOB)), JobRow.parent_id.is_(None), labels.has(given_labels))
    return session.scalars(select(JobRow.id).where(*wanted).order_by(JobRow.created_at).limit(limit)).all()


def cancel(session: Session, job_id: str) -> JobRow:
    """Cancels a queued job at once. A running one becomes ``cancelling``; the caller sends ``coordinate`` after the commit, which ends it.

    Nothing changes when the job has ended or is being cancelled already.
    """
    job = lock(session, get(session, job_id).id)
    if job.state == JobState.QUEUED:
        finish(session, job, JobState.CANCELLED, reason="cancelled before it started")
    elif transition(session, JobRow, JobState.CANCELLING, JobRow.id == job.id):
        events.emit(session, job, "job", {"state": JobState.CANCELLING})
    return job


def growth(session: Session, job_id: str) -> dict[str, Any] | None:
    """Returns the state of the job's growth after its last transition; None before the first."""
    row = session.get(GrowthRow, job_id)
    return None if row is None else row.document


def keep_growth(session: Session, job: JobRow, document: dict[str, Any]) -> None:
    """Stores the state of the job's growth. The caller holds the job's lock."""
    session.merge(GrowthRow(job_id=job.id, document=document))


def next_turn(job: JobRow, action: dict[str, Any]) -> None:
    """Says what the job waits for from now on, which ends the turn of its coordinator. The caller holds the job's lock."""
    job.turn += 1
    job.action = action
    job.coordinator = job.coordinator_parent = job.coordinator_since = job.coordinator_until = None
    job.coordinator_attempts = job.coordinator_deaths = 0


def finishing(outcome: str, reason: str) -> dict[str, Any]:
    """Returns the action of a job that is to end as soon as nothing of it goes on."""
    return {"kind": FINISH, "outcome": str(outcome), "reason": reason}


def finish_of(job: JobRow) -> tuple[Outcome, str] | None:
    """Returns with which outcome, and why, a job is to end; None as long as it is not to."""
    action = job.action or {}
    return (Outcome(action["outcome"]), action["reason"]) if action.get("kind") == FINISH else None


def start(session: Session, job: JobRow, served: float = 0.0) -> None:
    """Moves a queued job to running. The caller holds its lock.

    Args:
        served: what the job counts as served so far, as :func:`db.work.served_by_now` says.
    """
    if transition(session, JobRow, JobState.RUNNING, JobRow.id == job.id, started_at=utcnow(), served=served):
        events.emit(session, job, "job", {"state": JobState.RUNNING})


def claimed(job: JobRow) -> None:
    """Notes when a solver first works on the job. The caller holds the job's lock."""
    if job.claimed_at is None:
        job.claimed_at = utcnow()


def charge(session: Session, job: JobRow, seconds: float) -> None:
    """Counts seconds of work as done for the job, divided by the job's share of its project.

    The keys of a project that have running jobs share equally. The running jobs of a key divide its part in proportion to 2^priority. A
    job leaves its part to those that it has made.
    """
    other = aliased(JobRow)
    leaves = exists().where(other.parent_id == JobRow.id, other.state == JobState.RUNNING)
    at_work = (JobRow.project == job.project, JobRow.state == JobState.RUNNING, ~leaves)
    counts = select(JobRow.key_id, JobRow.priority, func.count()).where(*at_work).group_by(JobRow.key_id, JobRow.priority)
    rows = session.execute(counts).all()
    keys = len({key_id for key_id, _, _ in rows})
    job.served += seconds * keys * sum(count * 2.0 ** (priority - job.priority) for key_id, priority, count in rows if key_id == job.key_id)


def finish(
    session: Session, job: JobRow, state: JobState, *, reason: str, outcome: str | None = None, error: dict[str, Any] | None = None
) -> None:
    """Ends a job. The caller holds its lock and has settled or stopped its work."""
    if transition(session, JobRow, state, JobRow.id == job.id, outcome=outcome, reason=reason, error=error, finished_at=utcnow()):
        events.emit(session, job, "job", {"state": state, "outcome": outcome, "reason": reason, "region_id": job.region_id})


def is_coordinated(job: JobRow, now: datetime) -> bool:
    """Says whether somebody is computing the job's next transition. A coordination that takes too long does not count."""
    if job.coordinator is None or job.coordinator_until is None or job.coordinator_until < now:
        return False
    return leases.is_alive(job.coordinator) is not False


def coordinate(job: JobRow, now: datetime, seconds: float) -> None:
    """Says that this process computes the job's next transition, for at most this many seconds. The caller holds the job's lock."""
    job.coordinator_deaths = _deaths(job)
    job.coordinator, job.coordinator_parent = leases.this_worker(), leases.parent_worker()
    job.coordinator_since, job.coordinator_until = now, now + timedelta(seconds=seconds)
    job.coordinator_attempts += 1


def kills_coordinators(job: JobRow, now: datetime, limit: int) -> bool:
    """Says whether nobody must compute the job's next transition any more (:func:`db.leases.is_poison`)."""
    return not is_coordinated(job, now) and leases.is_poison(_deaths(job), job.coordinator_attempts + 1, limit)


def _deaths(job: JobRow) -> int:
    """Returns how many coordinators died over the next transition while those that had forked them lived, the last one included."""
    return job.coordinator_deaths + int(leases.died_alone(job.coordinator, job.coordinator_parent))


def coordinated_by(session: Session, processes: Collection[str]) -> Sequence[JobRow]:
    """Returns the unfinished jobs whose next transition one of these processes has begun to compute, oldest first."""
    mine = (JobRow.coordinator.in_(processes), JobRow.state.in_(unfinished(JOB)))
    return session.scalars(select(JobRow).where(*mine).order_by(JobRow.created_at, JobRow.id)).all()


def undecided(session: Session, limit: int) -> Sequence[str]:
    """Returns the ids of at most this many jobs that nobody has decided about, in the order in which they were made."""
    query = select(JobRow.id).where(JobRow.state == JobState.QUEUED).order_by(JobRow.created_at, JobRow.id)
    return session.scalars(query.limit(limit)).all()


def untouched(job: JobRow) -> bool:
    """Says whether no solver has claimed any of the job's work yet."""
    return job.claimed_at is None


def to_end(session: Session, now: datetime) -> list[str]:
    """Returns the ids of the unfinished jobs that are being cancelled, or whose deadline has passed, and that nobody coordinates."""
    due = or_(JobRow.state == JobState.CANCELLING, JobRow.deadline_at <= now)
    rows = session.scalars(select(JobRow).where(JobRow.state.in_(unfinished(JOB)), due).order_by(JobRow.created_at))
    return [job.id for job in rows if not is_coordinated(job, now)]


def awaiting_coordination(session: Session, now: datetime) -> list[str]:
    """Returns the ids of the unfinished jobs for which a coordination is due and that nobody coordinates.

    A coordination is due when the job is being cancelled, when its deadline has passed, or when it waits for no pair, no step and no child.
    It is not due while a job that is to end waits for a solver to accept its region.
    """
    no_pair = and_(JobRow.open_pairs == 0, JobRow.running_pairs == 0)
    step = exists().where(StepRow.job_id == JobRow.id, StepRow.state.in_(unfinished(STEP)), StepRow.kind != ACCEPT)
    other = aliased(JobRow)
    child = exists().where(other.parent_id == JobRow.id, other.state.in_(unfinished(JOB)))
    due = or_(JobRow.state == JobState.CANCELLING, JobRow.deadline_at <= now, no_pair & ~step & ~child)
    accepting = exists().where(StepRow.job_id == JobRow.id, StepRow.state.in_(unfinished(STEP)), StepRow.kind == ACCEPT)
    ends = func.coalesce(JobRow.action["kind"].as_string(), "") == FINISH
    due = and_(due, ~and_(ends, accepting, JobRow.accept_after <= now))
    rows = session.scalars(select(JobRow).where(JobRow.state.in_(unfinished(JOB)), due).order_by(JobRow.created_at))
    return [job.id for job in rows if not is_coordinated(job, now)]
