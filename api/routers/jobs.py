"""These routes create, list, cancel and retry jobs, and show their pair matrix and their growth curve.

A message to the workers is sent after the commit and after the answer. The row is what the service has promised, and no client
waits for a Redis that is down.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from threading import Lock
from typing import Annotated, Any

from cachetools import TTLCache, cached
from fastapi import APIRouter, Header, Query, Response, status
from pydantic import Field
from sqlalchemy import Engine, Row

from api import held, submission, timeline
from api.access import READ, SUBMIT, Admin, Db, Submitter
from api.announce import Announce
from api.delivery import unchanging
from api.reading import ReadingRoute
from api.remembered import Remembered
from api.room import KeptRoom
from api.schemas.common import MAX_INT, Cursor, JobGiven, OfIteration, OfScene, PairGiven, WithDependents
from api.schemas.jobs import (
    MOST_TOGETHER,
    AcceptedJob,
    AcceptedJobs,
    CancelRequest,
    GrowthCurve,
    GrowthPoint,
    Iteration,
    IterationStates,
    Job,
    JobKind,
    JobList,
    JobPage,
    NewJob,
    NewJobs,
    PairCell,
    PairMatrix,
    PairStates,
)
from api.schemas.progress import JobWorkers, Obstacle, Obstacles
from api.schemas.scenes import PairInfo
from api.schemas.service import Dependents
from api.schemas.timeline import Timeline
from api.writing import writing
from certifier.conditions import condition_named
from certifier.errors import CirisError
from certifier.model import Scene
from certifier.outcome import Stage
from certifier.proof.container import with_scene
from db import activity, audit, clock, jobs, labels, leases, pages, pairs, progress, proofs, regions, retention, scenes
from db.audit import Action
from db.models import IterationRow, JobRow, PairRow, StepRow
from db.session import Database
from db.states import IterationState, JobState, PairState
from jobs import obstacles, patterns
from jobs.registry import KINDS

MOST_PAIRS = 5000
"""One page of a pair matrix has at most this many results."""
KEPT_SECONDS = 1.0
"""Which workers there are, and which jobs wait, is kept for this time."""
REMEMBERED = 2000
"""The progress and the labels of this many jobs are remembered."""
_progress = Remembered[progress.Version, tuple[int, int]](REMEMBERED)
_labels = Remembered[str, dict[str, str]](REMEMBERED)

IdempotencyKey = Annotated[str | None, Header(min_length=1, max_length=200, description="The same key and body give the same job.")]
Label = Annotated[
    list[Annotated[str, Field(max_length=300, pattern=patterns.LABEL)]] | None,
    Query(max_length=20, description="List only the jobs with this label, `name=value`; with all of several.", examples=[["team=welding"]]),
]
Search = Annotated[
    str | None,
    Query(
        min_length=1,
        max_length=200,
        pattern=patterns.ANY,
        description="List only the jobs whose id begins with this, or where it is in the reason, a label, or a name of the scene.",
    ),
]
InIteration = Annotated[int, Query(ge=0, le=MAX_INT, description="The iteration whose result is meant.")]

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], dependencies=[READ], route_class=ReadingRoute)


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    responses={200: {"model": AcceptedJob, "description": "The job was made earlier with the same Idempotency-Key."}},
)
@writing
def create_job(
    body: NewJob,
    caller: Submitter,
    db: Db,
    response: Response,
    announce: Announce,
    room: KeptRoom,
    idempotency_key: IdempotencyKey = None,
) -> AcceptedJob:
    """Starts a job that grows a region, certifies a polytope or a motion, certifies a region of a changed scene again, or covers a scene.

    A repetition of the request with the same Idempotency-Key returns the same job. Another request with that key is refused (409).
    """
    asked = submission.checked(db, body)
    room.check(db, caller.project)
    with db.write() as session:
        job, made = submission.submit(session, asked, caller, idempotency_key)
    if made:
        announce(job.id)
    else:
        response.status_code = status.HTTP_200_OK
    response.headers["Location"] = f"/v1/jobs/{job.id}"
    return _accepted(described(db, [job]), [asked])[0]


@router.post("/batch", status_code=status.HTTP_201_CREATED)
@writing
def create_jobs(
    body: NewJobs,
    caller: Submitter,
    db: Db,
    announce: Announce,
    room: KeptRoom,
    idempotency_key: IdempotencyKey = None,
) -> AcceptedJobs:
    """Starts several jobs at once: all of them, or none where something is wrong with one, which the error's field names.

    A repetition of the request with the same Idempotency-Key returns the same jobs. Another batch with that key is refused (409). Keys of
    single jobs are others.
    """
    asked = [submission.checked(db, one, f"jobs[{i}]") for i, one in enumerate(body.jobs)]
    room.check(db, caller.project)
    with db.write() as session:
        made = submission.submit_all(session, asked, caller, idempotency_key)
    for job, new in made:
        if new:
            announce(job.id)
    return AcceptedJobs(jobs=_accepted(described(db, [job for job, _ in made]), asked))


def _accepted(made: Sequence[Job], asked: Sequence[submission.Checked]) -> list[AcceptedJob]:
    return [AcceptedJob(**dict(job), warnings=one.warnings) for job, one in zip(made, asked, strict=True)]


@router.post("/cancel", dependencies=[SUBMIT], status_code=status.HTTP_202_ACCEPTED)
@writing
def cancel_jobs(body: CancelRequest, db: Db, announce: Announce) -> JobList:
    """Asks several jobs to end: those named, or those with all of the labels that have not ended. Regions certified before remain.

    With labels, at most 100 are cancelled. Ask again until the answer is empty.
    """
    with db.read() as session:
        ids = [jobs.get(session, job).id for job in body.jobs or ()]
        ids += jobs.unfinished_with(session, body.labels, MOST_TOGETHER) if body.labels else ()
    cancelled = []
    for job_id in ids:  # one transaction each, so that no worker waits for the lock of all
        with db.write() as session:
            cancelled.append(jobs.cancel(session, job_id))
        announce(job_id)
    return JobList(jobs=described(db, cancelled))


def described(db: Database, rows: Sequence[JobRow]) -> list[Job]:
    """Describes jobs: with what they do now, how far they are, their labels and the shares of their last regions."""
    versions = {progress.version(row): row for row in rows}
    with db.read() as session:
        does = activity.of_jobs(session, rows, _kept(db.reader))
        settled = _progress.of(versions, lambda new: progress.of_jobs(session, map(versions.__getitem__, new)))
        shares = regions.shares(session, [row.region_id for row in rows if row.region_id is not None])
        known = _labels.of([row.id for row in rows], lambda new: labels.of_jobs(session, new))
    return [Job.of(row, does[row.id], settled[progress.version(row)], shares.get(row.region_id or ""), known[row.id] or {}) for row in rows]


@cached(TTLCache(maxsize=4, ttl=KEPT_SECONDS), lock=Lock())
def _kept(_reader: Engine) -> activity.Kept:
    """Returns what all jobs and workers of a database do, as it is known for a moment: many people look at jobs at the same time."""
    return activity.Kept()


@router.get("")
def list_jobs(
    db: Db,
    state: Annotated[JobState | None, Query(description="List only the jobs in this state.")] = None,
    kind: Annotated[JobKind | None, Query(description="List only the jobs of this kind.")] = None,
    scene: OfScene = None,
    ended: Annotated[bool | None, Query(description="`true` lists the jobs that have ended, `false` the others.")] = None,
    parent: Annotated[
        str | None, Query(min_length=1, max_length=64, description="List the jobs that grow the regions of this cover.")
    ] = None,
    label: Label = None,
    search: Search = None,
    after: Cursor = None,
    limit: Annotated[int, Query(ge=1, le=200, description="Return at most this many.")] = 50,
) -> JobPage:
    """Lists the jobs that were asked for, newest first; or those that a cover has made for its regions."""
    with db.read() as session:
        scene_id = scenes.find(session, scene) if scene else None
        parent_id = jobs.get(session, parent).id if parent else None
        page = jobs.page(
            session,
            state=state,
            kind=kind,
            scene_id=scene_id,
            ended=ended,
            parent_id=parent_id,
            given_labels={name: value for name, _, value in (one.partition("=") for one in label or ())},
            search=search,
            after=after,
            limit=limit,
        )
    return JobPage(jobs=described(db, page.rows), next=page.next)


@router.get("/{job_id}")
def get_job(job_id: JobGiven, db: Db) -> Job:
    """Returns one job as it is now."""
    with db.read() as session:
        job = jobs.get(session, job_id)
    return described(db, [job])[0]


@router.get("/{job_id}/dependents")
def get_job_dependents(job_id: JobGiven, db: Db) -> Dependents:
    """Returns what is deleted with a job: its regions and proofs, its webhook where it waits, and the jobs that a cover has made."""
    with db.read() as session:
        return Dependents(**asdict(retention.of_job(session, job_id)))


@router.delete("/{job_id}", status_code=status.HTTP_204_NO_CONTENT)
@writing
def delete_job(job_id: JobGiven, caller: Admin, db: Db, dependents: WithDependents = "keep") -> None:
    """Deletes a job that has ended. Where it has regions, other jobs or a waiting webhook, the request has to say that they go, too."""
    with db.write() as session:
        retention.delete_job(session, job_id, dependents=dependents == "delete")
        audit.note(session, caller.project, str(caller), Action.JOB_DELETED, job_id)


@router.post("/{job_id}/cancel", dependencies=[SUBMIT], status_code=status.HTTP_202_ACCEPTED)
@writing
def cancel_job(job_id: JobGiven, db: Db, announce: Announce) -> Job:
    """Asks a job to end. Regions that were certified before remain.

    Nothing happens to a job that has ended.
    """
    with db.write() as session:
        job = jobs.cancel(session, job_id)
    announce(job.id)
    return described(db, [job])[0]


@router.post("/{job_id}/retry", status_code=status.HTTP_201_CREATED)
@writing
def retry_job(
    job_id: JobGiven,
    caller: Submitter,
    db: Db,
    response: Response,
    announce: Announce,
    room: KeptRoom,
) -> Job:
    """Creates a new job like one that failed or was cancelled.

    A repetition of the request returns the same new job.
    """
    room.check(db, caller.project)
    with db.write() as session:
        job = jobs.retry(session, job_id, caller.key_id)
    announce(job.id)
    response.headers["Location"] = f"/v1/jobs/{job.id}"
    return described(db, [job])[0]


@router.get("/{job_id}/pairs")
def get_job_pairs(
    job_id: JobGiven,
    db: Db,
    iteration: OfIteration = None,
    pair: Annotated[
        list[Annotated[int, Field(ge=0, le=MAX_INT)]] | None,
        Query(max_length=200, description="Indices of the pairs wanted; all pairs if left out."),
    ] = None,
    after: Cursor = None,
    limit: Annotated[int, Query(ge=1, le=MOST_PAIRS, description="Return at most this many results.")] = MOST_PAIRS,
) -> PairMatrix:
    """Returns the pair matrix: the result of every pair on the polytope of every iteration, or of the given ones."""
    begin = _place(after)
    with db.read() as session:
        job = jobs.get(session, job_id)
        asked = pairs.iterations(session, job.id) if begin is None or pair is not None else ()
        iterations = [row for row in asked if iteration in (None, row.index)]
        only = None if pair is None else {pairs.leader(row, index) for row in iterations for index in pair}
        rows, last = pairs.page(session, job.id, iteration=iteration, only=only, after=begin, limit=limit)
    scene = scenes.load(db, job.scene_id)
    known = enumerate(scene.pairs) if begin is None else ()
    return PairMatrix.model_construct(  # api.reading goes through its iterators once
        pairs=(PairInfo(index=index, a=one.a, b=one.b) for index, one in known if pair is None or index in pair),
        iterations=[_iteration(row) for row in iterations] if begin is None else [],
        cells=(_cell(scene, list(parts)) for _, parts in itertools.groupby(rows, lambda row: (row.iteration, row.pair_index))),
        next=None if last is None else f"{last[0]}.{last[1]}",
    )


def _place(after: str | None) -> tuple[int, int] | None:
    """Returns where a page of the pair matrix begins: after (iteration, pair).

    Raises:
        CirisError: cursor.
    """
    if after is None:
        return None
    iteration, _, pair = after.partition(".")
    if not all(part.isascii() and part.isdigit() and int(part) <= MAX_INT for part in (iteration, pair)):
        raise pages.unknown()
    return int(iteration), int(pair)


@router.get("/{job_id}/pairs/states")
def get_job_pair_states(
    job_id: JobGiven, db: Db, since: Annotated[int, Query(ge=0, le=MAX_INT, description="Return only iterations from this one on.")] = 0
) -> PairStates:
    """Returns the state of every pair in every iteration as one letter. It is short, also for thousands of pairs in many iterations."""
    with db.read() as session:
        job = jobs.get(session, job_id)
        known, rows = pairs.states(session, job.id, since), pairs.iterations(session, job.id)
    count = len(scenes.load(db, job.scene_id).pairs)
    return PairStates(iterations=[_letters(row, known.get(row.index, {}), count) for row in rows if row.index >= since])


_LETTERS = {
    PairState.CERTIFIED: "c",
    PairState.REFUTED: "r",
    PairState.NOT_CERTIFIABLE: "n",
    PairState.TOO_CLOSE: "t",
    PairState.INCONCLUSIVE: "i",
    PairState.ERROR: "e",
    PairState.SKIPPED: "s",
    PairState.RUNNING: "w",
    PairState.OPEN: "o",
}


def _letters(row: IterationRow, known: Mapping[int, PairState], count: int) -> IterationStates:
    states = ["-"] * count
    for pair in row.reuse:
        states[int(pair)] = "u"
    for index, state in known.items():
        states[index] = _LETTERS[state]
    for first, others in row.together.items():
        for other in others:
            states[other] = states[int(first)]
    return IterationStates(index=row.index, label=row.label, state=IterationState(row.state), faces=row.faces, states="".join(states))


@router.get("/{job_id}/pairs/{pair}/proof", response_class=Response, responses={200: {"content": {"application/octet-stream": {}}}})
@unchanging
def download_pair_proof(
    job_id: JobGiven,
    pair: PairGiven,
    iteration: Annotated[int, Query(ge=0, le=MAX_INT, description="The iteration whose result is meant.")],
    db: Db,
) -> Response:
    """Returns the proof of a pair's outcome (certified, refuted or not certifiable), together with the scene.

    `ciris verify` checks the file offline. What a search over partitions has not certified has no proof.
    """
    with db.read() as session:
        job = jobs.get(session, job_id)
        rows = pairs.of_iteration(session, job.id, iteration, pair)
        digest = _cell(scenes.load(db, job.scene_id), rows).proof if rows else None
        if digest is None:
            message = f"there is no proof of pair {pair} in iteration {iteration}"
            raise CirisError("proof_not_found", message, field="pair", hint="only pairs that are certified or refuted have one")
        data = proofs.get(session, digest)
    headers = {"Content-Disposition": f'attachment; filename="{job.id}-{iteration}-{pair}.proof"', "ETag": f'"{digest}"'}
    return Response(with_scene(data, scenes.load(db, job.scene_id)), media_type="application/octet-stream", headers=headers)


def _iteration(row: IterationRow) -> Iteration:
    return Iteration(
        index=row.index,
        label=row.label,
        state=IterationState(row.state),
        faces=row.faces,
        ellipsoid_volume=row.ellipsoid_volume,
        reused={int(pair): iteration for pair, iteration in row.reuse.items()},
        together={int(pair): others for pair, others in row.together.items()},
        started_at=row.started_at,
        finished_at=row.finished_at,
    )


def _cell(scene: Scene, parts: Sequence[PairRow | Row[Any]]) -> PairCell:
    """Describes a pair from its parts in their order: by its state from the first part of this state, and by sums of cells and seconds."""
    row = parts[0]
    if len(parts) == 1:  # so it is with most pairs, of which a page has 5000
        state, distance, seconds, cells = PairState(row.state), row.margin, row.seconds, row.open_cells
    else:
        state = pairs.state_of_parts([PairState(part.state) for part in parts])
        row = next((part for part in parts if part.state == state), row)
        distance, seconds, cells = (
            of_known(known) if (known := [value for part in parts if (value := getattr(part, name)) is not None]) else None
            for of_known, name in ((min, "margin"), (sum, "seconds"), (sum, "open_cells"))
        )
    proved = None
    if state is PairState.CERTIFIED:
        pair = scene.pairs[row.pair_index]  # What stands for a condition has no distance in metres.
        proved = distance if condition_named(pair.a, pair.b) is None else None
    return PairCell(
        iteration=row.iteration,
        pair=row.pair_index,
        state=state,
        parts=len(parts),
        stage=None if row.stage is None else Stage(row.stage),
        proved_distance=proved,
        margin=proved,
        seconds=seconds,
        # What a search says of its open cells is about one part only.
        detail=None if len(parts) > 1 and state is PairState.INCONCLUSIVE else row.detail,
        worker=row.worker,
        open_cells=cells,
        witness_q=None if row.witness_s is None else scene.to_q(row.witness_s).tolist(),
        proof=row.proof_digest,
    )


@router.get("/{job_id}/workers")
def get_job_workers(job_id: JobGiven, db: Db) -> JobWorkers:
    """Returns which processes hold which work of a job at this moment."""
    with db.read() as session:
        job = jobs.get(session, job_id)
        rows, begun = leases.of_job(session, PairRow, job.id), leases.of_job(session, StepRow, job.id)
        decided = jobs.is_coordinated(job, clock.now(session))
    return JobWorkers(workers=[*held.certifying(rows), *map(held.doing, begun), *([held.deciding(job)] if decided else [])])


@router.get("/{job_id}/timeline")
def get_job_timeline(
    job_id: JobGiven,
    db: Db,
    since: Annotated[float, Query(ge=0, description="Tell of the time from here on, in seconds since the job's start.")] = 0.0,
    until: Annotated[float | None, Query(ge=0, description="Tell of the time until here; by default until the job's end, or now.")] = None,
) -> Timeline:
    """Returns what each process has done for a job, when, how fast the work went, and how long the iteration that runs will last.

    Where much work was done, one bar stands for several pieces of it. Ask for a part of the time to see each piece. The service may
    have removed the events of a job that ended long ago; then the timeline is empty.
    """
    return timeline.of_job(db, job_id, since, until)


@router.get("/{job_id}/obstacles")
def get_job_obstacles(
    job_id: JobGiven,
    db: Db,
    limit: Annotated[int, Query(ge=1, le=1000, description="Return at most this many, the worst.")] = 100,
) -> Obstacles:
    """Returns what holds the region of a job back, or has cut it, in words, worst first: each with the pair and a configuration.

    The job may run or have ended. The pairs for which most was cut off come first; where a job has ended without a region, those that it
    could not certify. Of a job that an earlier version has begun, no more may be known than how often something was cut off for a pair.
    """
    with db.read() as session:
        job = jobs.get(session, job_id)
    found = obstacles.of_job(db, scenes.load(db, job.scene_id), KINDS[job.kind], job)
    return Obstacles(obstacles=[Obstacle(**vars(one)) for one in found[:limit]], total=len(found))


@router.get("/{job_id}/growth")
def get_job_growth(job_id: JobGiven, db: Db) -> GrowthCurve:
    """Returns the regions that were certified during the job, with their volumes and shares of the proposal."""
    with db.read() as session:
        job = jobs.get(session, job_id)
        rows = regions.of_job(session, job.id)
    start = job.started_at or job.created_at
    points = [
        GrowthPoint(
            iteration=row.iteration,
            region=row.id,
            ellipsoid_volume=row.ellipsoid_volume,
            share=row.summary["share"] and row.summary["share"]["value"],
            seconds=(row.created_at - start).total_seconds(),
        )
        for row in rows
    ]
    return GrowthCurve(points=points)
