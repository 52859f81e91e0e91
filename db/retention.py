"""Scenes and jobs are deleted here, with what depends on them, and what has ended long ago expires.

Nothing is deleted without consent: deleting a scene or a job names everything that depends on it first. Regions and scenes
never expire. The proofs of pairs, cells, steps and events of a job that has ended do, and so does all of a job without regions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from sqlalchemy import ColumnElement, Select, Text, cast, delete, exists, func, or_, select, union, update
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import jobs, motions, projects, proofs, regions, scenes
from db.models import (
    EventRow,
    JobRow,
    MapPieceRow,
    MotionRow,
    PairRow,
    ProjectRow,
    ProofRow,
    QuestionRow,
    RegionRow,
    SceneMeshesRow,
    SceneNameRow,
    SceneRow,
    StepRow,
    SubtreesRow,
    WebhookRow,
)
from db.states import ACCEPT, JOB, WebhookState, unfinished

TOGETHER = 20
"""Number of jobs that expire in one transaction."""


@dataclass(frozen=True)
class Dependents:
    """Counts what goes with a scene or a job: its jobs, those of them that have not ended, regions, maps, waiting webhooks, and bytes.

    The bytes are those of proofs and cells. A job is not counted as its own dependent; the regions that a cover has grown are its jobs.
    """

    jobs: int
    unfinished: int
    regions: int
    maps: int
    webhooks: int
    bytes: int

    def __str__(self) -> str:
        counts = {"job": self.jobs, "region": self.regions, "map": self.maps, "waiting webhook": self.webhooks}
        counted = ", ".join(_number(count, name) for name, count in counts.items() if count)
        return f"{counted} and {self.bytes / 1e6:.1f} MB of proofs and cells"


def of_scene(session: Session, scene_id: str) -> Dependents:
    """Returns what depends on a scene.

    Raises:
        SceneError: scene_not_found.
    """
    return _counted(session, _of_scene(scenes.find(session, scene_id)))


def of_job(session: Session, job_id: str) -> Dependents:
    """Returns what depends on a job.

    Raises:
        CirisError: job_not_found.
    """
    job = jobs.get(session, job_id)
    found = _counted(session, _of_job(job.id))
    return replace(found, jobs=found.jobs - 1)


def delete_scene(session: Session, scene_id: str, *, dependents: bool) -> None:
    """Deletes a scene with its names, and with ``dependents`` its jobs and regions. Only a whole id will do.

    Raises:
        SceneError: scene_not_found.
        CirisError: has_dependents, not_ended.
    """
    if scenes.find(session, scene_id) != scene_id:
        raise CirisError("scene_not_found", f"no scene has the id {scene_id!r}", field="scene", hint="give all of its id to delete it")
    session.execute(select(SceneRow.id).where(SceneRow.id == scene_id).with_for_update())  # nobody creates a job for it now
    which = _of_scene(scene_id)
    found = _counted(session, which)
    _check(found, found.jobs, f"scene {scene_id}", dependents)
    _delete_jobs(session, which)
    motions.delete_all(session, scene_id)
    session.execute(delete(QuestionRow).where(QuestionRow.scene_id == scene_id))
    session.execute(delete(SceneNameRow).where(SceneNameRow.scene_id == scene_id))
    session.execute(delete(SceneRow).where(SceneRow.id == scene_id))


def delete_job(session: Session, job_id: str, *, dependents: bool) -> None:
    """Deletes a job that has ended, and with ``dependents`` its regions and the jobs of a cover. Only a whole id will do.

    Raises:
        CirisError: job_not_found, has_dependents, not_ended.
    """
    job = jobs.get(session, job_id)
    if job.id != job_id:
        raise CirisError("job_not_found", f"no job has the id {job_id!r}", field="job", hint="give all of its id to delete it")
    found = of_job(session, job.id)
    _check(found, found.jobs + found.regions + found.maps + found.webhooks, f"job {job_id}", dependents)
    _delete_jobs(session, _of_job(job.id))


def expire(session: Session, now: datetime) -> int:
    """Deletes some of what has expired in the projects that keep things for a number of days. Returns how many jobs it was about.

    A job without regions goes, once its webhook does not wait any more. Of one with regions, only these and its own row stay.
    Configurations that somebody asked about go, too.
    """
    done = 0
    for project in session.scalars(select(ProjectRow).where(projects.expires())):
        before = now - timedelta(days=project.keep_days or 0.0)
        session.execute(delete(QuestionRow).where(QuestionRow.project == project.name, QuestionRow.asked_at < before))
        # A cover goes when all of its jobs may go.
        other = JobRow.__table__.alias()
        child = exists().where(other.c.parent_id == JobRow.id, or_(other.c.finished_at.is_(None), other.c.finished_at >= before))
        old = (JobRow.project == project.name, JobRow.finished_at < before, ~child)
        has_region = exists().where(RegionRow.job_id == JobRow.id)
        has_child = exists().where(other.c.parent_id == JobRow.id)
        told = ~exists().where(WebhookRow.job_id == JobRow.id, WebhookRow.state == WebhookState.WAITING)
        gone = list(session.scalars(select(JobRow.id).where(*old, ~has_region, ~has_child, told).limit(TOGETHER)))
        _delete_jobs(session, JobRow.id.in_(gone))
        bulky = or_(*(exists().where(model.job_id == JobRow.id) for model in _BULK))
        kept = list(session.scalars(select(JobRow.id).where(*old, has_region, bulky).limit(TOGETHER)))
        _empty(session, kept)
        done += len(gone) + len(kept)
    return done


_BULK = (PairRow, SubtreesRow, StepRow, EventRow)
_PROVED = (PairRow, RegionRow, StepRow)


def _number(count: int, name: str) -> str:
    return f"{count} {name}{'' if count == 1 else 's'}"


def _of_scene(scene_id: str) -> ColumnElement[bool]:
    return JobRow.scene_id == scene_id


def _of_job(job_id: str) -> ColumnElement[bool]:
    return or_(JobRow.id == job_id, JobRow.parent_id == job_id)


def _counted(session: Session, which: ColumnElement[bool]) -> Dependents:
    mine = select(JobRow.id).where(which)
    count = select(func.count()).select_from(JobRow).where(which)
    stored = (StepRow.kind == ACCEPT, StepRow.proof_digest.is_not(None))  # only maps have their proof with this step
    to_tell = (WebhookRow.job_id.in_(mine), WebhookRow.state == WebhookState.WAITING)
    return Dependents(
        jobs=session.scalar(count) or 0,
        unfinished=session.scalar(count.where(JobRow.state.in_(unfinished(JOB)))) or 0,
        regions=session.scalar(select(func.count()).select_from(RegionRow).where(RegionRow.job_id.in_(mine))) or 0,
        maps=session.scalar(select(func.count()).select_from(StepRow).where(StepRow.job_id.in_(mine), *stored)) or 0,
        webhooks=session.scalar(select(func.count()).select_from(WebhookRow).where(*to_tell)) or 0,
        bytes=_bytes(session, mine),
    )


def _bytes(session: Session, mine: Select[str]) -> int:
    """Returns the bytes of the proofs, cells and maps of these jobs. A proof that several of them have counts once."""
    digests = union(*(select(model.proof_digest).where(model.job_id.in_(mine)) for model in _PROVED))
    stored = session.scalar(select(func.sum(func.length(ProofRow.data))).where(ProofRow.digest.in_(digests)))
    others = (
        session.scalar(select(func.sum(func.length(model.data))).where(model.job_id.in_(mine)))
        for model in (SubtreesRow, MapPieceRow, StepRow)
    )
    return int(stored or 0) + sum(int(size or 0) for size in others)


def stored(session: Session, project: str) -> int:
    """Returns how many bytes of scenes, their meshes, jobs, proofs, cells and motions a project stores."""
    documents = select(func.sum(func.length(cast(SceneRow.document, Text)))).where(SceneRow.project == project)
    drawn = select(func.sum(func.length(SceneMeshesRow.data))).join(SceneRow).where(SceneRow.project == project)
    moved = select(func.sum(func.length(MotionRow.arrays) + func.length(ProofRow.data)))
    moved = moved.join(ProofRow, ProofRow.digest == MotionRow.proof_digest).where(MotionRow.project == project)
    asked = select(func.sum(JobRow.bytes)).where(JobRow.project == project)
    return (
        int(session.scalar(documents) or 0)
        + int(session.scalar(drawn) or 0)
        + int(session.scalar(asked) or 0)
        + int(session.scalar(moved) or 0)
        + _bytes(session, select(JobRow.id).where(JobRow.project == project))
    )


def _check(found: Dependents, number: int, what: str, dependents: bool) -> None:
    if found.unfinished:
        problem = f"{what} has jobs that have not ended, {found.unfinished} in all"
        raise CirisError("not_ended", problem, field="job", hint="cancel what you do not need, and wait for the end")
    if number and not dependents:
        raise CirisError(
            "has_dependents", f"with {what} go {found}", field="dependents", hint="say dependents=delete (--dependents) to delete them too"
        )


def _delete_jobs(session: Session, which: ColumnElement[bool]) -> None:
    """Deletes jobs with all that they have, and proofs that nobody else has. They must have ended."""
    ids = list(session.scalars(select(JobRow.id).where(which)))
    if not ids:
        return
    for scene_id in sorted(session.scalars(select(RegionRow.scene_id).where(RegionRow.job_id.in_(ids)).distinct())):
        regions.changed(session, scene_id)
    digests = _proofs(session, ids)
    session.execute(delete(RegionRow).where(RegionRow.job_id.in_(ids)))
    session.execute(update(JobRow).where(JobRow.retry_of.in_(ids)).values(retry_of=None))
    session.execute(delete(JobRow).where(JobRow.parent_id.in_(ids)))
    session.execute(delete(JobRow).where(JobRow.id.in_(ids)))
    proofs.drop_unused(session, digests)


def _empty(session: Session, ids: Sequence[str]) -> None:
    """Deletes the pairs, cells, steps and events of jobs, but not their regions and iterations."""
    digests = _proofs(session, ids)
    for model in _BULK:
        session.execute(delete(model).where(model.job_id.in_(ids)))
    proofs.drop_unused(session, digests)


def _proofs(session: Session, ids: Sequence[str]) -> set[str]:
    found: set[str] = set()
    for model in _PROVED:
        mine = select(model.proof_digest).where(model.job_id.in_(ids), model.proof_digest.is_not(None))
        found.update(digest for digest in session.scalars(mine.distinct()) if digest is not None)
    return found
