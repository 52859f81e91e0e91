"""A client reads a job's events as a list, or as a stream of server-sent events that it can resume."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.sse import EventSourceResponse, ServerSentEvent

from api.access import READ, Db, presented
from api.reading import ReadingRoute
from api.schemas.common import MAX_INT, JobGiven, Listed
from api.schemas.jobs import Event, EventList, ProjectEvent, ProjectEventList
from api.streams import Stream
from db import event_ids, events, jobs
from db.event_ids import MOST, EventIds
from db.models import JobRow
from db.session import Database

After = Annotated[int, Query(ge=0, le=MAX_INT, description="Return only events with a larger number than this.")]
AfterEvent = Annotated[int, Query(ge=0, le=MOST, description="Return only events after the one with this `id`; 0: all of them.")]
PAGE = 500
LATE = 200
"""An event whose id is smaller by up to this may still come: workers commit in another order than that of the ids."""

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], dependencies=[READ], route_class=ReadingRoute)
project = APIRouter(prefix="/v1/events", tags=["project"], dependencies=[READ], route_class=ReadingRoute)


@router.get("/{job_id}/events")
def list_job_events(
    job_id: JobGiven,
    db: Db,
    after: After = 0,
    limit: Listed = PAGE,
    before: Annotated[
        int | None, Query(ge=1, le=MAX_INT, description="Return the last events with a smaller number than this; `after` is not looked at.")
    ] = None,
) -> EventList:
    """Returns what happened to the job, in order: the first events after a number, or the last ones before it."""
    with db.read() as session:
        job = jobs.get(session, job_id)
        rows = events.since(session, job.id, after, limit) if before is None else events.before(session, job.id, before, limit)
        return EventList(events=[Event.of(row) for row in rows])


def _existing(job_id: JobGiven, db: Db) -> JobRow:
    """Returns the job if it exists. This comes before the stream begins, because a stream cannot answer 404 any more."""
    with db.read() as session:
        return jobs.get(session, job_id)


@router.get("/{job_id}/events/stream", response_class=EventSourceResponse)
async def stream_job_events(
    job: Annotated[JobRow, Depends(_existing)],
    db: Db,
    stream: Stream,
    request: Request,
    after: After = 0,
    last_event_id: Annotated[
        int | None, Header(ge=0, le=MAX_INT, description="The stream goes on after this number; used instead of `after`.")
    ] = None,
) -> AsyncIterator[ServerSentEvent]:
    """Streams the job's events as they happen.

    A number beyond the last event counts as the last one. The last event is called `end`. After it the stream closes. It closes without
    that event when the caller's key is revoked.
    """
    seq = min(after if last_event_id is None else last_event_id, job.event_seq)
    keyring, given = request.app.state.keyring, presented(request.headers)
    while await keyring.caller(given) is not None:
        page, ended = await run_in_threadpool(_next_page, db, job.id, seq)
        for event in page:
            yield ServerSentEvent(data=event.model_dump(mode="json"), event=event.kind, id=str(event.seq))
        if page:
            seq = page[-1].seq
        if ended and len(page) < PAGE:
            yield ServerSentEvent(data={"job": job.id}, event="end")
            return
        await asyncio.sleep(0 if page else stream.pause)


def _next_page(db: Database, job_id: str, seq: int) -> tuple[list[Event], bool]:
    """Returns the next events, and whether the job had ended by then. Both come from one transaction: an ended job gets no more events."""
    with db.read() as session:
        job = jobs.get(session, job_id)
        return [Event.of(row) for row in events.since(session, job_id, seq, PAGE)], not job.transitions[job.state]


@project.get("")
def list_project_events(
    db: Db,
    after: AfterEvent = 0,
    limit: Listed = PAGE,
) -> ProjectEventList:
    """Returns what happened to all jobs of the project after an event.

    Workers write at the same time, so an event may appear before one that was there already. To miss none, read the stream, which goes
    back a little.
    """
    with db.read() as session:
        ids = event_ids.of_project(session)
        found = events.of_all(session, min(ids.meant(after), MAX_INT) if after else 0, limit)
        return ProjectEventList(events=[ProjectEvent.seen(row, ids) for row in found])


@project.get("/stream", response_class=EventSourceResponse)
async def stream_project_events(
    db: Db,
    stream: Stream,
    request: Request,
    after: Annotated[
        int | None,
        Query(ge=0, le=MOST, description="Begin after the event with this `id`; 0: with the first; by default with what comes next."),
    ] = None,
    last_event_id: Annotated[
        int | None, Header(ge=0, le=MOST, description="The stream goes on after the event with this `id`; used instead of `after`.")
    ] = None,
) -> AsyncIterator[ServerSentEvent]:
    """Streams what happens to all jobs of the project.

    It does not end by itself. It goes back a little where it goes on, so an event may come twice, with the same `job` and `seq`. It closes
    when the caller's key is revoked. A number that no event has counts as the last one.
    """
    given_id = after if last_event_id is None else last_event_id
    ids, last = await run_in_threadpool(_beginning, db)
    newest = last if given_id is None else min(ids.meant(given_id) if given_id else 0, last)
    seen: set[int] = set() if given_id is not None else set(range(max(newest - LATE, 0), newest + 1))
    keyring, given = request.app.state.keyring, presented(request.headers)
    while await keyring.caller(given) is not None:
        page = await run_in_threadpool(_of_all, db, ids, max(newest - LATE, 0), seen)
        for _, event in page:
            yield ServerSentEvent(data=event.model_dump(mode="json"), event=event.kind, id=str(event.id))
        seen.update(id for id, _ in page)
        newest = max([newest, *(id for id, _ in page)])
        seen = {one for one in seen if one > newest - LATE}
        await asyncio.sleep(0 if len(page) == PAGE else stream.pause)


def _of_all(db: Database, ids: EventIds, after: int, seen: set[int]) -> list[tuple[int, ProjectEvent]]:
    """Returns the next events of the project, each with its id in the database."""
    with db.read() as session:
        return [(row.id, ProjectEvent.seen(row, ids)) for row in events.of_all(session, after, PAGE, seen)]


def _beginning(db: Database) -> tuple[EventIds, int]:
    """Returns how the project's people see ids of events, and the last id in the database."""
    with db.read() as session:
        return event_ids.of_project(session), events.last_id(session)
