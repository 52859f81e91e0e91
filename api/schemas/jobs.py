"""Jobs, their events, iterations and pairs."""

from __future__ import annotations

from base64 import b64decode
from datetime import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator

from api.schemas.common import Document, Offsets, Page, RandomSeed, Real, Request, Rows, SceneName, Vector
from api.schemas.scenes import PairInfo
from certifier.growth.options import LARGEST_TOLERANCE, WHOLE_NUMBERS, GrowthOptions
from certifier.outcome import Outcome, Stage
from certifier.seeding.options import Method
from db.models import EventRow, JobRow, WebhookRow
from db.states import IterationState, JobKind, JobState, PairState, WebhookState

DEFAULTS = GrowthOptions()


def _whole(option: str, description: str) -> Any:
    """Of a growth option that is a whole number."""
    least, greatest = WHOLE_NUMBERS[option]
    return Field(ge=least, le=greatest, description=description)


class GrowOptions(Request):
    """How far to go."""

    contraction: Annotated[
        Literal["targeted", "uniform"], Field(description="Faces where pairs fail, or every face moved in by as much.")
    ] = "targeted"
    contractions: Annotated[
        int | None,
        _whole(
            "contractions",
            "Targeted contractions, each cutting in another way; the largest region counts. "
            "Default: 2 for arms of at most six joints between two bodies, else 1.",
        ),
    ] = None
    bisection_steps: Annotated[int, _whole("bisection_steps", "Certifications spent on uniform contraction after its two ends.")] = (
        DEFAULTS.bisection_steps
    )
    max_rounds: Annotated[
        int | None,
        _whole("max_rounds", "Rounds of the polytope step; default: 3 for arms of at most four joints between two bodies, else 0."),
    ] = None
    pushes: Annotated[
        int | None,
        _whole(
            "pushes", "How often the faces are pushed out after the contractions; default: 10 for such arms, 2 up to six joints, else 0."
        ),
    ] = None
    tolerance: Annotated[
        Real, Field(gt=0, lt=LARGEST_TOLERANCE, description="Growth of the ellipsoid's volume under which the alternation stops.")
    ] = DEFAULTS.tolerance
    backoff: Annotated[int, _whole("backoff", "How often a step that fails to certify is halved.")] = DEFAULTS.backoff
    random_seed: RandomSeed = DEFAULTS.random_seed


class Seed(Request):
    """Where growing begins, and how the first polytope is found; what is left out has the certifier's default."""

    method: Method | None = Field(None, description="Default: `iris_np2` up to 8 joints, `limits` beyond.")
    q: Vector | None = Field(None, description="Joint positions, radians or metres, in position order; for every method but `polytope`.")
    contain: Rows | None = Field(None, description="More joint positions that the region has to contain, as where it meets another one.")
    C: Rows | None = Field(None, description="Faces of the first polytope, in s; for the method `polytope`.")
    d: Offsets | None = None
    center: Vector | None = Field(None, description="A point inside that polytope, in s.")
    half_width: Real | None = Field(None, description="Half the side of the `box`, in s.")
    epsilon: Real | None = Field(None, description="Fraction of the volume that IRIS may leave in collision.")
    delta: Real | None = Field(None, description="Probability with which IRIS may be wrong about that.")
    max_iterations: int | None = Field(None, description="IRIS' alternations between faces and ellipsoid.")
    max_iterations_separating_planes: int | None = Field(None, description="IRIS' rounds of adding faces within each.")
    tolerance: Real | None = Field(None, description="IRIS ends when the ellipsoid's volume grows by less than this fraction.")
    margin: Real | None = Field(None, description="Distance in s at which IRIS' faces stay clear of the collisions found.")
    random_seed: int | None = Field(None, description="Seeds IRIS.")


class WebhookRequest(Request):
    """Whom to tell when the job has ended: a POST, signed as Standard Webhooks has it, repeated until it is answered with success."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"url": "https://planner.example.org/ciris", "secret": "whsec_AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwdHh8="}]
        }
    )

    url: str = Field(max_length=2000, pattern=r"^https?://", description="http:// or https://, of a public address.")
    secret: str = Field(
        pattern=r"^whsec_[A-Za-z0-9+/]{32,88}={0,2}$",
        description="`whsec_` and the base64 of 24 to 64 random bytes, with which the message is signed. It is not shown again.",
    )

    @field_validator("secret")
    @classmethod
    def _is_base64(cls, secret: str) -> str:
        if not 24 <= len(b64decode(secret.removeprefix("whsec_"), validate=True)) <= 64:
            raise ValueError("it must stand for 24 to 64 bytes")
        return secret


class JobRequest(Request):
    """What every job has."""

    scene: SceneName
    priority: int = Field(0, ge=-3, le=3, description="Each step doubles the job's share of the work done for its key.")
    deadline_seconds: Real | None = Field(None, gt=0, le=30 * 86400, description="The job ends after this long, with what it has by then.")
    webhook: WebhookRequest | None = None


class GrowRequest(JobRequest):
    """Grow a certified region around a configuration."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"kind": "grow", "scene": "iiwa-shelf", "seed": {"q": [0, 0.3, 0, -1.8, 0, 0.9, 0]}}]}
    )

    kind: Literal["grow"]
    seed: Seed
    options: GrowOptions = Field(default_factory=GrowOptions)


class PolytopeBody(Request):
    """{s : C s <= d}; the joint limits are always added."""

    C: Rows = Field(description="(m, n), one row a face, in s with the joints in position order.")
    d: Offsets
    center: Vector | None = Field(None, description="An interior point; found when it is not given.")


class CertifyRequest(JobRequest):
    """One outcome per pair for a given polytope."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"kind": "certify", "scene": "planar-2dof", "polytope": {"C": [[1, 0], [-1, 0]], "d": [0.1, 0.1]}}]}
    )

    kind: Literal["certify"]
    polytope: PolytopeBody
    random_seed: RandomSeed = 0


NewJob = Annotated[GrowRequest | CertifyRequest, Field(discriminator="kind")]


class Job(BaseModel):
    """A job as it is now."""

    id: str
    kind: JobKind
    scene: str = Field(description="The scene's id.")
    state: JobState
    outcome: Outcome | None = Field(description="About the polytope asked for, once the job has ended.")
    reason: str | None = Field(description="Why it ended, a sentence.")
    error: Document | None = Field(description="What was wrong (code, message, field, hint) when it failed.")
    options: Document
    priority: int
    region: str | None = Field(description="The id of the last region certified.")
    retry_of: str | None
    attempt: int
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    deadline_at: datetime | None
    ended: bool

    @classmethod
    def of(cls, row: JobRow) -> Self:
        return cls(
            id=row.id,
            kind=JobKind(row.kind),
            scene=row.scene_id,
            state=JobState(row.state),
            outcome=None if row.outcome is None else Outcome(row.outcome),
            reason=row.reason,
            error=row.error,
            options=row.options,
            priority=row.priority,
            region=row.region_id,
            retry_of=row.retry_of,
            attempt=row.attempt,
            created_at=row.created_at,
            started_at=row.started_at,
            finished_at=row.finished_at,
            deadline_at=row.deadline_at,
            ended=not row.transitions[row.state],
        )


class JobPage(Page):
    """Jobs, newest first."""

    jobs: list[Job]


class Webhook(BaseModel):
    """Whether the end of the job has been told."""

    url: str
    state: WebhookState
    attempts: int
    next_at: datetime = Field(description="Not tried before.")
    error: str | None = Field(description="Why the last attempt failed.")

    @classmethod
    def of(cls, row: WebhookRow) -> Self:
        return cls(url=row.url, state=WebhookState(row.state), attempts=row.attempts, next_at=row.next_at, error=row.error)


class Event(BaseModel):
    """Something that happened to a job."""

    seq: int = Field(description="1, 2, 3 ... within the job; the event's id in the stream.")
    kind: str = Field(description="job, iteration, pairs, step, region or lost.")
    data: Document
    created_at: datetime

    @classmethod
    def of(cls, row: EventRow) -> Self:
        return cls(seq=row.seq, kind=row.kind, data=row.data, created_at=row.created_at)


class EventList(BaseModel):
    """Events in order."""

    events: list[Event]


class Iteration(BaseModel):
    """A polytope whose pairs were certified together."""

    index: int
    label: str
    state: IterationState
    faces: int = Field(description="Rows of C, joint limits included.")
    ellipsoid_volume: float | None
    reused: dict[int, int] = Field(description="Pair index to the earlier iteration whose proof serves here too.")
    started_at: datetime
    finished_at: datetime | None


class PairCell(BaseModel):
    """One pair on one iteration's polytope."""

    iteration: int
    pair: int
    state: PairState
    stage: Stage | None
    margin: float | None = Field(description="Certified lower bound, in metres, of the distance between the padded bodies.")
    seconds: float | None
    detail: str | None
    worker: str | None
    witness_q: list[float] | None = Field(description="A configuration in collision, when refuted.")
    proof: str | None = Field(description="SHA-256 of the pair's proof.")


class PairMatrix(BaseModel):
    """Pairs by iterations; a pair without a cell in an iteration is reused there or was not reached."""

    pairs: list[PairInfo]
    iterations: list[Iteration]
    cells: list[PairCell]


class GrowthPoint(BaseModel):
    """A certified region on the way."""

    iteration: int
    region: str
    ellipsoid_volume: float
    seconds: float = Field(description="Since the job started.")


class GrowthCurve(BaseModel):
    """The volume of the certified region over time."""

    points: list[GrowthPoint]
