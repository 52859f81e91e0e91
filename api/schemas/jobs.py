"""These models describe jobs, their events, iterations and pairs."""

from __future__ import annotations

from datetime import datetime
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from api.schemas.common import Document, Page
from api.schemas.progress import Progress
from api.schemas.scenes import PairInfo
from certifier.outcome import Outcome, Stage
from db import traces
from db.event_ids import MOST, EventIds
from db.models import EventRow, JobRow
from db.states import IterationState, JobState, PairState
from jobs.fields import Labels, Request
from jobs.registry import KINDS
from jobs.request import JobRequest


def _known(kind: str) -> str:
    if kind not in KINDS:
        raise ValueError(f"it must be one of {', '.join(KINDS)}")
    return kind


JobKind = Annotated[str, AfterValidator(_known), Field(json_schema_extra={"enum": [*KINDS]})]
if TYPE_CHECKING:
    NewJob = JobRequest
else:
    NewJob = Annotated[reduce(or_, (kind.request for kind in KINDS.values())), Field(discriminator="kind")]


class Job(BaseModel):
    """Describes a job as it is now."""

    id: str = Field(description="Id of the job.")
    kind: JobKind = Field(description="What the job does.")
    scene: str = Field(description="Id of the scene.")
    state: JobState = Field(description="Where the job is. It is `running` from the first decision on, also while nobody works on it.")
    status: str = Field(
        description="What the job does now, in words for people. `working`: somebody works on it. `queued: ` goes on with why nobody does: "
        "`no worker`, `no control worker`, `all workers paused`, `workers compile, which takes some minutes, once`, `behind 3 others` or "
        "`next`. `stalled: ` goes on with what gives no sign of life, `ending: ` with what is being "
        "stopped. Else it is the state.",
        examples=["queued: no worker"],
    )
    outcome: Outcome | None = Field(description="Outcome for the polytope or the motion asked for; null before the job ends.")
    reason: str | None = Field(description="A sentence that says why the job ended.")
    error: Document | None = Field(description="What was wrong (code, message, field, hint) when the job failed.")
    options: Document = Field(description="The options that it was made with, defaults included.")
    priority: int = Field(description="Each step up doubles the job's share of the work for its API key.")
    region: str | None = Field(description="Id of the last certified region.")
    retry_of: str | None = Field(description="Id of the job that it repeats; null for a first attempt.")
    attempt: int = Field(description="1, or one more than the attempt of `retry_of`.")
    parent: str | None = Field(description="Id of the cover that the job grows a region for; null where somebody asked for the job.")
    created_at: datetime = Field(description="When it was asked for.")
    started_at: datetime | None = Field(description="When it was first worked on; null before.")
    finished_at: datetime | None = Field(description="When it ended; null before.")
    deadline_at: datetime | None = Field(description="When it ends at the latest; null without a deadline.")
    ended: bool = Field(description="True once it has ended, however it did.")
    labels: dict[str, str] = Field(description="Labels to find it by: name -> value.")
    trace: str | None = Field(description="Id of the OpenTelemetry trace that has all work on the job; null where nobody traces.")
    progress: Progress = Field(description="How far the job is in its last iteration, and how large its last region is.")

    @classmethod
    def of(cls, row: JobRow, status: str, settled: tuple[int, int] | None, share: float | None, labels: dict[str, str]) -> Self:
        """Describes a job.

        Args:
            status: what :func:`db.activity.of_jobs` says of it.
            settled: what :func:`db.progress.of_jobs` says of it; None where that is nothing.
            labels: the job's labels.
            share: the share of the proposal that its last region keeps; None without a region, or where there is none.
        """
        return cls(
            id=row.id,
            kind=row.kind,
            scene=row.scene_id,
            state=JobState(row.state),
            status=status,
            outcome=None if row.outcome is None else Outcome(row.outcome),
            reason=row.reason,
            error=row.error,
            options=row.options,
            priority=row.priority,
            region=row.region_id,
            retry_of=row.retry_of,
            attempt=row.attempt,
            parent=row.parent_id,
            created_at=row.created_at,
            started_at=row.started_at,
            finished_at=row.finished_at,
            deadline_at=row.deadline_at,
            ended=not row.transitions[row.state],
            labels=labels,
            trace=traces.trace_id(row.traceparent),
            progress=Progress(settled=settled and settled[0], total=settled and settled[1], share=share),
        )


class AcceptedJob(Job):
    """Describes a job that was asked for now."""

    warnings: list[str] = Field(
        description="Why the job will probably be in vain, in sentences: what blocks the straight lines in s between configurations that a "
        "region has to contain, at samples. None of it is proved, and an empty list says nothing."
    )


class AcceptedJobs(BaseModel):
    """Holds jobs that were asked for now."""

    jobs: list[AcceptedJob] = Field(description="The jobs, in the order of the requests.")


class JobPage(Page):
    """Holds one page of jobs, newest first."""

    jobs: list[Job] = Field(description="The jobs of this page.")


MOST_TOGETHER = 100
"""One request creates, or cancels, at most this many jobs."""


class NewJobs(Request):
    """Asks for several jobs: all of them are made, or none."""

    jobs: list[NewJob] = Field(min_length=1, max_length=MOST_TOGETHER, description="The jobs, of any kinds.")


class JobList(BaseModel):
    """Holds jobs."""

    jobs: list[Job] = Field(description="The jobs, in the order of the request.")


class CancelRequest(Request):
    """Names the jobs to cancel, either by their ids or by labels."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"jobs": ["1f9b2a7c"]}, {"labels": {"team": "welding"}}]})

    jobs: list[Annotated[str, Field(min_length=4, max_length=36)]] | None = Field(
        None, min_length=1, max_length=MOST_TOGETHER, description="Ids of jobs, or their first characters."
    )
    labels: Labels | None = Field(
        None, min_length=1, description=f"Cancel the jobs that have all of these labels and have not ended, at most {MOST_TOGETHER}."
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if (self.jobs is None) == (self.labels is None):
            raise ValueError("give either jobs or labels")
        return self


class Event(BaseModel):
    """Describes something that happened to a job."""

    seq: int = Field(description="Number of the event within the job: 1, 2, 3 ... It is the event's id in the stream.")
    kind: str = Field(description="One of job, iteration, pairs, step, note, region, lost; of a cover also cover and child.")
    data: Document = Field(description="What happened; its keys depend on `kind`.")
    created_at: datetime = Field(description="When it happened.")

    @classmethod
    def of(cls, row: EventRow) -> Self:
        return cls(seq=row.seq, kind=row.kind, data=row.data, created_at=row.created_at)


class ProjectEvent(Event):
    """Describes something that happened to one of the jobs of a project. `job` and `seq` name it; it may come twice."""

    id: int = Field(ge=0, le=MOST, description="Pass this as `after`, or as Last-Event-ID, to go on after this event. Ids are in no order.")
    job: str = Field(description="Id of the job.")

    @classmethod
    def seen(cls, row: EventRow, ids: EventIds) -> Self:
        """Returns an event as the project's people see it."""
        return cls(id=ids.shown(row.id), job=row.job_id, seq=row.seq, kind=row.kind, data=row.data, created_at=row.created_at)


class ProjectEventList(BaseModel):
    """Holds events of all jobs of a project, in the order in which they were written."""

    events: list[ProjectEvent] = Field(description="The events.")


class EventList(BaseModel):
    """Holds events in order."""

    events: list[Event] = Field(description="The events, by their numbers.")


class Iteration(BaseModel):
    """Describes a polytope whose pairs were certified together."""

    index: int = Field(description="Number of the iteration, from 0.")
    label: str = Field(description="Says to people what the polytope is.")
    state: IterationState = Field(description="What has become of the iteration.")
    faces: int = Field(description="Number of rows of C, joint limits included.")
    ellipsoid_volume: float | None = Field(description="Volume of the inscribed ellipsoid of its region, in s; null without a region.")
    reused: dict[int, int] = Field(description="Maps a pair's index to the earlier iteration whose proof serves here too.")
    together: dict[int, list[int]] = Field(
        description="Maps a pair's index to the other pairs of its group. Grouped pairs share one row: the first pair's."
    )
    started_at: datetime = Field(description="When it began.")
    finished_at: datetime | None = Field(description="When its last pair was settled; null before.")


class PairCell(BaseModel):
    """Describes the result of one pair on the polytope of one iteration."""

    iteration: int = Field(description="Number of the iteration.")
    pair: int = Field(description="Index of the pair among the scene's.")
    state: PairState = Field(description="What has become of the pair.")
    parts: int = Field(
        description="Number of parts among which the pair's undecided cells, or the cells to verify, are divided; 1 for an undivided pair."
    )
    stage: Stage | None = Field(description="Which method settled it; null before.")
    proved_distance: float | None = Field(
        description="The distance of the padded bodies that the proof happens to show, in metres. They may be many times as far "
        "apart. Null where nothing is proved, and where the proof bounds none."
    )
    margin: float | None = Field(description="The same as `proved_distance`.", deprecated=True)
    seconds: float | None = Field(description="How long it took, all parts together; null before it is settled.")
    detail: str | None = Field(description="More about the outcome, in words.")
    worker: str | None = Field(description="The process that holds it, or held it last: host, process number and start.")
    witness_q: list[float] | None = Field(
        description="A configuration (joint positions) at which the pair collides (refuted), or is nearest (too_close, where `detail` says "
        "how near); else null."
    )
    open_cells: int | None = Field(
        description="Number of cells of the polytope that the search over partitions left open; null where it left none, and elsewhere."
    )
    proof: str | None = Field(description="SHA-256 of the pair's proof file; null where the outcome has none.")


class PairMatrix(Page):
    """Holds one page of the results of pairs in iterations, by iteration and pair.

    A pair without a cell in an iteration was reused there from an earlier iteration, was certified with another one as one, or was not
    reached.
    """

    pairs: list[PairInfo] = Field(description="The pairs that were asked for; on the first page only.")
    iterations: list[Iteration] = Field(description="The iterations that were asked for; on the first page only.")
    cells: list[PairCell] = Field(description="The results of this page.")


class IterationStates(BaseModel):
    """Describes an iteration by one letter for each pair."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"index": 2, "label": "stage 1", "state": "running", "faces": 24, "states": "ccuwoo"}]}
    )

    index: int = Field(description="Number of the iteration, from 0.")
    label: str = Field(description="Says to people what the polytope is.")
    state: IterationState = Field(description="What has become of the iteration.")
    faces: int = Field(description="Number of rows of C, joint limits included.")
    states: str = Field(
        description="A letter for each pair of the scene, in its order: `c` certified, `r` refuted, `n` not certifiable, `t` too close, "
        "`i` inconclusive, `e` error, `s` skipped, `w` running (a worker has it), `o` open, `u` certified by the proof of an earlier "
        "iteration, `-` not reached."
    )


class PairStates(BaseModel):
    """Holds the states of all pairs in iterations, in few characters: the pair matrix of a long job, to draw it."""

    iterations: list[IterationStates] = Field(description="The iterations, in order.")


class GrowthPoint(BaseModel):
    """Describes a region that was certified during the job."""

    iteration: int = Field(description="The iteration that the region is of.")
    region: str = Field(description="Id of the region.")
    ellipsoid_volume: float = Field(description="Volume of its inscribed ellipsoid, in s.")
    share: float | None = Field(description="Part of the proposal's collision-free configurations that the region contains, by q-volume.")
    seconds: float = Field(description="Seconds from the job's start to the region.")


class GrowthCurve(BaseModel):
    """Holds the volume of the certified region over time."""

    points: list[GrowthPoint] = Field(description="The regions, in the order of their certification.")
