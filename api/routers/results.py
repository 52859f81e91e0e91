"""These routes show what jobs of some kinds have found besides regions: covers and motions."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Response

from api.access import READ, Db
from api.reading import ReadingRoute
from api.schemas.common import JobGiven
from api.schemas.covers import Cover
from api.schemas.motions import JobMotion
from certifier.errors import CirisError
from db import jobs, proofs, steps
from db.session import Database
from db.types import utcnow
from jobs.certify_path import MOTION
from jobs.registry import KINDS

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], dependencies=[READ], route_class=ReadingRoute)


@router.get("/{job_id}/cover")
def get_job_cover(job_id: JobGiven, db: Db) -> Cover:
    """Returns the results of a cover: how much is covered, which regions are connected, and which it has grown."""
    with db.read() as session:
        job = jobs.get(session, job_id)
        kind = KINDS[job.kind]
        if not kind.makes_jobs:
            message = f"the job {job.id} is no cover, but a {job.kind} job"
            raise CirisError("cover_not_found", message, field="job", hint="its own page and /v1/jobs/{id} describe it")
        found = kind.result(session, job)
    seconds = None if job.started_at is None else ((job.finished_at or utcnow()) - job.started_at).total_seconds()
    return Cover.model_validate({"state": job.state, "outcome": job.outcome, "reason": job.reason, "seconds": seconds, **found})


@router.get("/{job_id}/motion")
def get_job_motion(job_id: JobGiven, db: Db) -> JobMotion:
    """Returns what has become of the motion that a job has certified."""
    return JobMotion.model_validate(_verdict(db, job_id)[1])


@router.get("/{job_id}/motion/proof", response_class=Response, responses={200: {"content": {"application/octet-stream": {}}}})
def download_motion_proof(job_id: JobGiven, db: Db) -> Response:
    """Returns the proof of the motion that a job has certified, or of its beginning, together with the scene.

    `ciris verify` checks the file offline.
    """
    job, verdict = _verdict(db, job_id)
    if verdict["proof"] is None:
        raise CirisError("proof_not_found", "nothing is proved of this motion", field="job", hint="the contact is where it begins")
    with db.read() as session:
        data = proofs.get(session, verdict["proof"])
    headers = {"Content-Disposition": f'attachment; filename="{job}.proof"'}
    return Response(data, media_type="application/octet-stream", headers=headers)


def _verdict(db: Database, job_id: str) -> tuple[str, dict[str, Any]]:
    """Returns the id of a job, and the report of its step that has certified a motion.

    Raises:
        CirisError: motion_not_found.
    """
    with db.read() as session:
        job = jobs.get(session, job_id)
        verdict = steps.found(session, job.id, MOTION)
        if verdict is None:
            message = f"the {job.kind} job {job.id} is {job.state} and has no verdict of a motion{f': {job.reason}' if job.reason else ''}"
            hint = "a certify-path job has one when it has ended before its deadline"
            raise CirisError("motion_not_found", message, field="job", hint=hint)
        return job.id, verdict
