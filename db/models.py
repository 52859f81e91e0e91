"""These are the tables. The database is the truth about every job; messages carry only ids."""

from __future__ import annotations

import secrets
from datetime import datetime
from functools import partial
from typing import Any, ClassVar

from sqlalchemy import JSON, BigInteger, ForeignKey, Index, LargeBinary, MetaData, String, Text, UniqueConstraint, text
from sqlalchemy.orm import DeclarativeBase, Mapped, declared_attr, mapped_column

from db import states
from db.types import Arrays, Npz, Utc, utcnow

Document = dict[str, Any]
DEFAULT_PROJECT = "default"
"""This project is always there. A service without keys works in it."""


class Base(DeclarativeBase):
    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_N_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map: ClassVar[dict[Any, Any]] = {
        datetime: Utc,
        Document: JSON(none_as_null=True),
        list[int]: JSON(none_as_null=True),
        list[str]: JSON(none_as_null=True),
        Arrays: Npz,
        bytes: LargeBinary,
        str: Text,
    }


class ProjectRow(Base):
    """A project is a team's part of the service. Its keys see its scenes, jobs and regions, and nothing of other projects."""

    __tablename__ = "projects"

    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    max_bytes: Mapped[int | None] = mapped_column(BigInteger)
    """Largest number of bytes that it may store; None for any number."""
    keep_days: Mapped[float | None]
    """Jobs without a region are deleted this many days after their end; None where they stay."""
    max_solver_seconds: Mapped[float | None]
    """No new job is taken in a calendar month in which solvers have worked for it this long; None for any time."""
    created_at: Mapped[datetime] = mapped_column(default=utcnow)
    events_key: Mapped[bytes] = mapped_column(default=partial(secrets.token_bytes, 16))
    """Random, and shown to nobody. By it the project's people see ids of events (db.event_ids)."""


class Owned:
    """Such a row belongs to a project. A session of a project finds no rows of other projects (db.session)."""

    @declared_attr
    def project(cls) -> Mapped[str]:
        return mapped_column(String(64), ForeignKey("projects.name"), default=DEFAULT_PROJECT)


class SolverTimeRow(Owned, Base):
    """This row counts how long solvers have worked for an API key of a project in a calendar month."""

    __tablename__ = "solver_time"

    project: Mapped[str] = mapped_column(String(64), ForeignKey("projects.name"), primary_key=True)
    key_id: Mapped[str] = mapped_column(String(36), primary_key=True, default="")
    """The key's id, also when it is forgotten; empty for jobs of no key."""
    month: Mapped[str] = mapped_column(String(7), primary_key=True)
    """In UTC, as 2026-11."""
    seconds: Mapped[float]
    lately: Mapped[float] = mapped_column(default=0.0)
    """The same as it was at ``counted_at``, but half of what was before is forgotten every db.solver_time.HALF_LIFE_SECONDS."""
    counted_at: Mapped[datetime | None]
    """When something was counted last."""


class SceneRow(Owned, Base):
    """A scene of a project never changes. Two projects with the same scene have a row each, so that neither can tell of the other."""

    __tablename__ = "scenes"
    __table_args__ = (UniqueConstraint("project", "hash"),)

    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    """What db.scenes makes of the hash and the project."""
    name: Mapped[str]
    """The name that it was last added or staged under. That name may mean another scene."""
    hash: Mapped[str] = mapped_column(String(64))
    document: Mapped[Document]
    """The document that certifier.model.Scene.to_document() returns."""
    created_at: Mapped[datetime] = mapped_column(default=utcnow)


class SceneMeshesRow(Base):
    """The meshes of a scene's models, for people to look at (db.meshes)."""

    __tablename__ = "scene_meshes"

    scene_id: Mapped[str] = mapped_column(ForeignKey("scenes.id", ondelete="CASCADE"), primary_key=True)
    data: Mapped[bytes]
    """Compressed JSON: what certifier.scene.drawn.document() returns."""


class SceneNameRow(Owned, Base):
    """A version of a name in a project. The name means the scene of its last version. ``NAME@staged`` is a name, too (db.staging)."""

    __tablename__ = "scene_names"

    project: Mapped[str] = mapped_column(String(64), ForeignKey("projects.name"), primary_key=True)
    name: Mapped[str] = mapped_column(primary_key=True)
    version: Mapped[int] = mapped_column(primary_key=True)
    scene_id: Mapped[str] = mapped_column(ForeignKey("scenes.id"), index=True)
    configurations: Mapped[Document] = mapped_column(default=dict)
    """The named configurations: positions of joints by their names, in radians or metres."""
    created_at: Mapped[datetime] = mapped_column(default=utcnow)


def _proofs_of(table: str) -> Index:
    """Returns the index by which a proof's deletion finds out whether rows of the table have it, where most have none.

    SQLite does not use it for a column that is never null.
    """
    present = text("proof_digest IS NOT NULL")
    return Index(f"ix_{table}_proof_digest", "proof_digest", sqlite_where=present, postgresql_where=present)


class Leased:
    """A worker claims such a row before it works on it. It has one holder at a time, for a limited time, a limited number of times."""

    attempts: Mapped[int] = mapped_column(default=0)
    """How often a worker began the row."""
    deaths: Mapped[int] = mapped_column(default=0)
    """How often the process that held the row died alone, so that the row may be the cause."""
    worker: Mapped[str | None]
    """The worker that holds the row, or held it last: ``host:pid:start``."""
    parent: Mapped[str | None]
    """The process that forked this worker, in the same form."""
    lease_token: Mapped[str | None] = mapped_column(String(36))
    """The holder is the process that knows the token. Every claim makes a new one."""
    lease_since: Mapped[datetime | None]
    """When the holder took the row. Renewing the lease does not change it."""
    lease_until: Mapped[datetime | None]


class ApiKeyRow(Owned, Base):
    """A key lets its holder into a project. The key itself is shown once and not stored."""

    __tablename__ = "api_keys"
    __table_args__ = (Index(None, "project", "created_at", "id"), Index(None, "project", "name"), Index(None, "revoked_at"))

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    """The part of the key that is no secret."""
    name: Mapped[str]
    digest: Mapped[str] = mapped_column(String(64))
    """SHA-256 of the key."""
    scope: Mapped[str] = mapped_column(String(16))
    """A value of db.keys.Scope."""
    created_at: Mapped[datetime] = mapped_column(default=utcnow)
    revoked_at: Mapped[datetime | None]
    """From this time on it is refused. It may be in the future, where the key was made to expire."""
    last_used_at: Mapped[datetime | None]
    """A little before its last use (db.keys.NOTED)."""


class GrantRow(Owned, Base):
    """A grant lets a person, or a group of people, whom the identity provider names into a project."""

    __tablename__ = "grants"
    __table_args__ = (UniqueConstraint("kind", "name", "project"),)

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    kind: Mapped[str] = mapped_column(String(16))
    """A value of db.grants.Kind."""
    name: Mapped[str]
    """The person's e-mail address in small letters or subject, or the group, as the provider says it."""
    scope: Mapped[str] = mapped_column(String(16))
    """A value of db.keys.Scope."""
    created_at: Mapped[datetime] = mapped_column(default=utcnow)


class SessionRow(Base):
    """A session lasts from signing in to signing out. It is a key's, or a person's, who may then have chosen a project by a grant."""

    __tablename__ = "sessions"
    __table_args__ = (Index(None, "key_id", "created_at"), Index(None, "subject", "created_at"), Index(None, "expires_at"))

    digest: Mapped[str] = mapped_column(String(64), primary_key=True)
    """SHA-256 of the token that the browser has."""
    key_id: Mapped[str | None] = mapped_column(ForeignKey("api_keys.id", ondelete="CASCADE"))
    subject: Mapped[str | None]
    """The person's name for programs, as the identity provider says it; None in a session of a key."""
    issuer: Mapped[str | None]
    """The identity provider that said so. Once the service has another one, the session lets nobody in."""
    email: Mapped[str | None]
    """The person's e-mail address in small letters, if the provider has verified it."""
    groups: Mapped[list[str]] = mapped_column(default=list)
    """The person's groups when the person signed in."""
    grant_id: Mapped[str | None] = mapped_column(ForeignKey("grants.id", ondelete="SET NULL"), index=True)
    """The grant by which the person works in a project; None before one is chosen, and once it is withdrawn."""
    created_at: Mapped[datetime] = mapped_column(default=utcnow)
    expires_at: Mapped[datetime]
    last_used_at: Mapped[datetime | None]
    """A little before its last use (db.keys.NOTED)."""


class AuditRow(Owned, Base):
    """This row says who changed what a project's people rely on: a key, a limit, what a name means, something that was deleted.

    Nobody changes such a row.
    """

    __tablename__ = "audit"
    __table_args__ = (Index(None, "project", "created_at", "id"), Index(None, "created_at"))

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    who: Mapped[str]
    """The name and id of the key that was used, or of the person who signed in; ``command line``; ``anybody`` where no key is asked for."""
    action: Mapped[str] = mapped_column(String(32))
    """A value of db.audit.Action."""
    what: Mapped[str]
    """Names what was changed."""
    created_at: Mapped[datetime] = mapped_column(default=utcnow)


class JobRow(Owned, Base):
    """A job is one request to grow a region or a map, to certify a polytope or a motion, or to cover a scene; or a region of a cover."""

    __tablename__ = "jobs"
    __table_args__ = (
        Index(None, "state", "project", "key_id"),
        Index(None, "project", "created_at", "id"),
        Index(None, "project", "bytes"),
        UniqueConstraint("parent_id", "number"),
    )
    transitions: ClassVar[states.Table] = states.JOB

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    kind: Mapped[str] = mapped_column(String(16))
    """The name of a kind of jobs.registry."""
    scene_id: Mapped[str] = mapped_column(ForeignKey("scenes.id"), index=True)
    state: Mapped[str] = mapped_column(String(16), default=states.JobState.QUEUED)
    outcome: Mapped[str | None] = mapped_column(String(16))
    """A value of certifier.outcome.Outcome, once the job has ended."""
    reason: Mapped[str | None]
    """A sentence that says why the job ended."""
    error: Mapped[Document | None]
    """What CirisError.to_document() returned, when the job failed."""
    options: Mapped[Document]
    """What certifier.growth.options.GrowthOptions.to_document() returned; for a cover, planner.cover.options.CoverOptions.to_document();
    for a map, the fields of certifier.map.options.MapOptions; for a motion, what certifier.motion.given.motion_of() takes, with ``space``
    where it was given, ``tube``, ``padding`` and ``clearance``."""
    action: Mapped[Document | None] = mapped_column(deferred=True)
    """The action that the job waits for: its kind, the iteration of a certification, the outcome and reason of an end.

    The rest of the action is in the iteration and its pairs, or in the step.
    """
    idempotency_key: Mapped[str | None] = mapped_column(String(255), unique=True)
    request_digest: Mapped[str | None] = mapped_column(String(64))
    """SHA-256 of the request. It tells a repetition from a different request under the same key."""
    key_id: Mapped[str | None] = mapped_column(ForeignKey("api_keys.id"), index=True)
    """Id of the API key whose job it is; None where the service asks for no key, or has forgotten it."""
    priority: Mapped[int] = mapped_column(default=0)
    """Each step up doubles the job's share of its key's work."""
    served: Mapped[float] = mapped_column(default=0.0)
    """Seconds of work that the job was given, divided by its share of its project. The least goes next, all else being equal (db.work)."""
    retry_of: Mapped[str | None] = mapped_column(ForeignKey("jobs.id"))
    attempt: Mapped[int] = mapped_column(default=1)
    """1, or one more than the attempt of ``retry_of``."""
    parent_id: Mapped[str | None] = mapped_column(ForeignKey("jobs.id"))
    """The cover that the job grows a region for; None where somebody asked for the job."""
    number: Mapped[int | None]
    """Its number among the regions that the cover has begun; None where somebody asked for the job."""
    open_pairs: Mapped[int] = mapped_column(default=0)
    """How many of the job's pairs are open. Every move of a pair changes this count, so that nobody has to count the rows."""
    running_pairs: Mapped[int] = mapped_column(default=0)
    """How many of the job's pairs are running."""
    pieces: Mapped[int | None]
    """How many pairs, or parts of pairs, its last iteration has; None before the first one."""
    next_pair: Mapped[int] = mapped_column(default=0)
    """No open pair that has killed no process has a lower id. Claims look from here on."""
    region_id: Mapped[str | None] = mapped_column(String(36))
    """Id of the last region accepted."""
    accept_after: Mapped[datetime] = mapped_column(default=utcnow)
    """No region is accepted before this time, unless growing has ended: accepting leaves most of the time to growing."""
    event_seq: Mapped[int] = mapped_column(default=0)
    """``seq`` of the last event."""
    turn: Mapped[int] = mapped_column(default=0)
    """How many transitions of the growth have been saved. A coordinator saves only onto the turn it started from."""
    coordinator: Mapped[str | None]
    """The process that is computing the next transition (``host:pid:start``)."""
    coordinator_since: Mapped[datetime | None]
    """When it began."""
    coordinator_until: Mapped[datetime | None]
    """Until this time that process is believed to be at work."""
    coordinator_attempts: Mapped[int] = mapped_column(default=0)
    """How often the next transition was begun."""
    coordinator_parent: Mapped[str | None]
    """The process that had forked ``coordinator``."""
    coordinator_deaths: Mapped[int] = mapped_column(default=0)
    """How many processes died over the next transition while those that had forked them lived."""
    created_at: Mapped[datetime] = mapped_column(default=utcnow)
    started_at: Mapped[datetime | None]
    claimed_at: Mapped[datetime | None]
    """When a solver first began to work on it."""
    finished_at: Mapped[datetime | None]
    deadline_at: Mapped[datetime | None]
    bytes: Mapped[int] = mapped_column(BigInteger, default=0)
    """What counts of the row for its project: the options and labels, and something for the rest (db.jobs). They never change."""
    traceparent: Mapped[str | None] = mapped_column(String(55))
    """Of the request that created the job (db.traces); None where nobody traces."""


class JobLabelRow(Base):
    """A label of a job: whatever people want to find it by."""

    __tablename__ = "job_labels"
    __table_args__ = (Index(None, "name", "value"),)

    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)
    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    value: Mapped[str] = mapped_column(String(200))


class GrowthRow(Base):
    """This row holds what the growth of a job knows, or what a cover knows.

    It is as long as the scene has pairs, and SQLite writes the whole of a row anew. So it has a table of its own, because every claim
    changes the row of its job.
    """

    __tablename__ = "growths"

    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)
    document: Mapped[Document]
    """The document of the job's state after the last decision: certifier.growth.state.GrowthState, or planner.cover.state.CoverState; of a
    map, jobs.mapping.Account after the last round."""


class IterationRow(Base):
    """An iteration is a polytope whose pairs are certified together."""

    __tablename__ = "iterations"
    transitions: ClassVar[states.Table] = states.ITERATION

    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)
    index: Mapped[int] = mapped_column(primary_key=True)
    label: Mapped[str]
    """Says to people what this polytope is."""
    action: Mapped[Document]
    """The document of the certifier.growth.actions.Certify that asked for it. What follows is what queries ask for of it."""
    faces: Mapped[int]
    """Number of faces, m."""
    state: Mapped[str] = mapped_column(String(16), default=states.IterationState.RUNNING)
    failures: Mapped[int | None]
    """How many failures end the iteration; None when none does."""
    parts: Mapped[Document] = mapped_column(default=dict)
    """Pair index (as a string) -> into how many parts its open cells are divided, where there are several."""
    together: Mapped[Document] = mapped_column(default=dict)
    """Pair index (as a string) -> the indices of the other pairs of its group, which have no rows of their own."""
    reuse: Mapped[Document]
    """Pair index (as a string) -> the iteration whose proof serves here too."""
    ellipsoid_volume: Mapped[float | None]
    started_at: Mapped[datetime] = mapped_column(default=utcnow)
    finished_at: Mapped[datetime | None]


class PairRow(Leased, Base):
    """This row holds one pair of geometries on the polytope of one iteration, or a part of it, and its result."""

    __tablename__ = "pairs"
    __table_args__ = (
        UniqueConstraint("job_id", "iteration", "pair_index", "part"),
        Index(None, "state", "lease_token", postgresql_where=text("state = 'running'")),
        Index(None, "job_id", "state", "deaths", "id"),
        _proofs_of("pairs"),
    )
    transitions: ClassVar[states.Table] = states.PAIR

    id: Mapped[int] = mapped_column(primary_key=True)
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"))
    iteration: Mapped[int]
    pair_index: Mapped[int]
    """The pair's position in Scene.pairs."""
    part: Mapped[int] = mapped_column(default=0)
    """The number of the part, from 0. A pair has several where its open cells are divided among several pieces of work."""
    a: Mapped[str]
    b: Mapped[str]
    state: Mapped[str] = mapped_column(String(16), default=states.PairState.OPEN)
    forecast_seconds: Mapped[float] = mapped_column(default=0.0)
    stage: Mapped[str | None] = mapped_column(String(16))
    """A value of certifier.outcome.Stage."""
    margin: Mapped[float | None]
    seconds: Mapped[float | None]
    detail: Mapped[str | None]
    witness_s: Mapped[list[float] | None] = mapped_column(JSON(none_as_null=True))
    weakness: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    """The document of a certifier.pair.result.Weakness, until the job's next action is decided."""
    proof_digest: Mapped[str | None] = mapped_column(ForeignKey("proofs.digest"))
    open_cells: Mapped[int | None]
    """How many of the cells that the search was given or made are open."""


class SubtreesRow(Base):
    """This row holds what a search over partitions has proved already of a part of a pair that is not certified. It is no proof.

    A job has those of its open pairs. After its end only their outlines are left, for people to look at.
    """

    __tablename__ = "subtrees"

    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)
    pair_index: Mapped[int] = mapped_column(primary_key=True)
    iteration: Mapped[int] = mapped_column(primary_key=True)
    """The iteration whose result it is part of."""
    part: Mapped[int] = mapped_column(primary_key=True)
    data: Mapped[bytes]
    """What certifier.pair.result.PairResult calls ``subtrees``; empty once the job has ended."""
    outline: Mapped[bytes | None]
    """What certifier.pair.result.PairResult calls ``outline``; None where an earlier version has saved it."""


class StepRow(Leased, Base):
    """A step is a piece of a job that is no pair: seeding, the polytope step, accepting a region, a look at what is covered, a motion, a
    map and the pieces of its rounds."""

    __tablename__ = "steps"
    __table_args__ = (
        UniqueConstraint("job_id", "turn", "kind", "number"),
        Index(None, "state", "lease_until"),
        Index(None, "job_id", "state"),
        _proofs_of("steps"),
    )
    transitions: ClassVar[states.Table] = states.STEP

    id: Mapped[int] = mapped_column(primary_key=True)
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"))
    turn: Mapped[int]
    """The job's turn that asked for the step."""
    kind: Mapped[str] = mapped_column(String(16))
    """``accept``, or what the kind of the job calls it."""
    number: Mapped[int] = mapped_column(default=0)
    """The number of a piece of a map's round, from 0."""
    state: Mapped[str] = mapped_column(String(16), default=states.StepState.OPEN)
    input: Mapped[Document]
    """What the step works on: the action, or the accepted polytope."""
    report: Mapped[Document | None]
    """What the step found, or the CirisError document that says why it failed."""
    proof_digest: Mapped[str | None] = mapped_column(ForeignKey("proofs.digest"))
    """The proof of the motion that the step has certified, or of the map that it has accepted."""
    data: Mapped[bytes | None] = mapped_column(deferred=True)
    """Of a piece of a map's round, its tasks, and then what was found; of a map that was accepted, its free set as a file."""
    seconds: Mapped[float | None]


class MapPieceRow(Base):
    """What was found for a piece of a round of a map. All of them together are the map, until its proof is stored."""

    __tablename__ = "map_pieces"

    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)
    round: Mapped[int] = mapped_column(primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True)
    data: Mapped[bytes]
    """What certifier.map.packed.pack_entries() returned."""


class MapPairRow(Base):
    """What a stored map proves of a pair: how many cells its trees have with a plane. Other maps begin with what it proves."""

    __tablename__ = "map_pairs"

    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)
    content: Mapped[str] = mapped_column(String(16), primary_key=True, index=True)
    """The beginning of the hash of what the pair is about (certifier.proof.sub_scene)."""
    cells: Mapped[int]


class ProofRow(Base):
    """This row holds a proof file, addressed by its content."""

    __tablename__ = "proofs"

    digest: Mapped[str] = mapped_column(String(64), primary_key=True)
    """SHA-256 of ``data``."""
    data: Mapped[bytes]
    created_at: Mapped[datetime] = mapped_column(default=utcnow)


class RegionRow(Owned, Base):
    """A region is a polytope all of whose pairs are certified. ``proof_digest`` names the proof of this."""

    __tablename__ = "regions"
    __table_args__ = (UniqueConstraint("job_id", "iteration"), Index(None, "project", "created_at", "id"))

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id"))
    scene_id: Mapped[str] = mapped_column(ForeignKey("scenes.id"), index=True)
    number: Mapped[int]
    """The version of the scene's library when the region was added. Who sees a region also sees those with lower numbers."""
    linked: Mapped[int] = mapped_column(default=0)
    """Its overlaps with the regions of lower numbers are known up to this number."""
    iteration: Mapped[int]
    guarantee: Mapped[str] = mapped_column(String(16))
    """A value of certifier.outcome.Guarantee."""
    manifest: Mapped[Document]
    arrays: Mapped[Arrays]
    """C (m, n), d (m,) with the joint limits, in s."""
    box: Mapped[Arrays]
    """``lower`` and ``upper``, (n,), of a box in s that contains the region."""
    faces: Mapped[int]
    """Number of faces, m."""
    proof_digest: Mapped[str] = mapped_column(ForeignKey("proofs.digest"), index=True)
    ellipsoid_volume: Mapped[float]
    """In s."""
    summary: Mapped[Document]
    """What lists show of the manifest: certifier.jobs.region.SUMMARY."""
    created_at: Mapped[datetime] = mapped_column(default=utcnow)


class LibraryRow(Base):
    """This row counts the changes of a scene's regions. A scene's own row never changes, and is long. Without regions there is no row."""

    __tablename__ = "libraries"

    scene_id: Mapped[str] = mapped_column(String(64), primary_key=True)
    """The row outlives its scene. So a version never means other regions, even when the scene is added again."""
    version: Mapped[int] = mapped_column(default=0)
    """How often a region of the scene was added or deleted."""
    motions: Mapped[int] = mapped_column(default=0)
    """How often a motion of the scene was added or deleted."""


class MotionRow(Owned, Base):
    """A motion that was planned in a scene and proved, with a tube about it. ``proof_digest`` names the proof, without the scene."""

    __tablename__ = "motions"
    __table_args__ = (UniqueConstraint("scene_id", "number"),)

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    scene_id: Mapped[str] = mapped_column(ForeignKey("scenes.id"))
    number: Mapped[int]
    """What the scene's library counted as its motions when this one was added. The oldest ones go first."""
    arrays: Mapped[Arrays]
    """``path`` (k, n), the configurations that the proof is about, straight in q between them; ``q`` (K, n) and ``t`` (K,), the motion with
    its times, which is in the tube; ``speed`` and ``acceleration`` (n,), the limits that it keeps; ``direct`` (1,), whether it was asked
    for from start to goal alone."""
    tube: Mapped[float]
    """Half the width of the tube, in radians or metres."""
    proof_digest: Mapped[str] = mapped_column(ForeignKey("proofs.digest"), index=True)
    created_at: Mapped[datetime] = mapped_column(default=utcnow)


class QuestionRow(Owned, Base):
    """A configuration of a scene that somebody asked about, and that nothing proved then (db.questions)."""

    __tablename__ = "questions"
    __table_args__ = (Index(None, "project", "asked_at"),)

    scene_id: Mapped[str] = mapped_column(ForeignKey("scenes.id"), primary_key=True)
    digest: Mapped[str] = mapped_column(String(32), primary_key=True)
    """Tells configurations apart."""
    q: Mapped[list[float]] = mapped_column(JSON(none_as_null=True))
    asked_at: Mapped[datetime]
    """When somebody asked last."""


class OverlapRow(Base):
    """Two regions of a scene overlap: a ball fits into both."""

    __tablename__ = "overlaps"

    later: Mapped[str] = mapped_column(String(36), ForeignKey("regions.id", ondelete="CASCADE"), primary_key=True)
    """Id of the region with the higher number."""
    earlier: Mapped[str] = mapped_column(String(36), ForeignKey("regions.id", ondelete="CASCADE"), primary_key=True, index=True)
    depth: Mapped[float]
    """Radius of the largest ball, in s."""
    witness: Mapped[list[float]] = mapped_column(JSON(none_as_null=True))
    """(n,) its centre, in s."""


class EventRow(Base):
    """An event says what happened to a job."""

    __tablename__ = "events"
    __table_args__ = (UniqueConstraint("job_id", "seq"), {"sqlite_autoincrement": True})

    id: Mapped[int] = mapped_column(primary_key=True)
    """No id comes again after a deletion, because clients ask for what is after the last one that they have seen."""
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"))
    seq: Mapped[int]
    """The event's number within the job: 1, 2, 3 ..."""
    kind: Mapped[str] = mapped_column(String(32))
    data: Mapped[Document]
    created_at: Mapped[datetime] = mapped_column(default=utcnow)


class WebhookRow(Base):
    """A webhook names the receiver to call when a job has ended."""

    __tablename__ = "webhooks"
    __table_args__ = (Index(None, "state", "next_at"),)
    transitions: ClassVar[states.Table] = states.WEBHOOK

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), unique=True)
    url: Mapped[str]
    secret: Mapped[str]
    """``whsec_`` and the base64 of the bytes that sign the message, encrypted by db.vault together with the URL."""
    state: Mapped[str] = mapped_column(String(16), default=states.WebhookState.WAITING)
    attempts: Mapped[int] = mapped_column(default=0)
    """How often the receiver was called."""
    next_at: Mapped[datetime] = mapped_column(default=utcnow)
    """The receiver is not called before this time."""
    error: Mapped[str | None]
    """Why the last attempt failed."""


class DeliveryRow(Base):
    """This row says how one attempt to call a webhook's receiver went."""

    __tablename__ = "deliveries"
    __table_args__ = (Index(None, "webhook_id", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    webhook_id: Mapped[str] = mapped_column(ForeignKey("webhooks.id", ondelete="CASCADE"))
    at: Mapped[datetime]
    seconds: Mapped[float]
    status: Mapped[int | None]
    """The receiver's HTTP status; None where it gave none."""
    answer: Mapped[str | None]
    """How the body of its answer begins."""
    error: Mapped[str | None]
    """Why the attempt failed; None where it did not."""


class WorkerRow(Base):
    """A worker is a process that takes messages from a queue. It writes its row itself, and tells again and again that it lives."""

    __tablename__ = "workers"

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    process: Mapped[str] = mapped_column(unique=True)
    """``host:pid:start``. Leases name it as the parent of the process that holds them."""
    kind: Mapped[str] = mapped_column(String(16))
    """The queue that it serves: control or solve."""
    version: Mapped[str]
    """Version of ciris."""
    processes: Mapped[int]
    """Number of pieces of work that it does at the same time."""
    cores: Mapped[int]
    memory_bytes: Mapped[int] = mapped_column(BigInteger)
    wanted: Mapped[str] = mapped_column(String(16), default=states.WorkerState.RUNNING)
    """What people want of it, a value of WorkerState."""
    state: Mapped[str] = mapped_column(String(16))
    """What it does, as it said last, a value of WorkerState."""
    trouble: Mapped[str | None]
    """What fails of what it does again and again, as it said last; None where all goes well."""
    created_at: Mapped[datetime]
    """When it began, by the database's clock."""
    seen_at: Mapped[datetime]
    """When it said last that it lives, by the database's clock."""
