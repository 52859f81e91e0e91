"""These routes show what jobs of some kinds have found besides regions: covers, maps and motions."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Response
from sqlalchemy.orm import Session

from api.access import READ, Db
from api.delivery import unchanging
from api.reading import ReadingRoute
from api.schemas.common import JobGiven
from api.schemas.covers import Cover
from api.schemas.maps import JobMap
from api.schemas.motions import JobMotion
from certifier.errors import CirisError
from db import jobs, maps, proofs, steps
from db.models import JobRow
from db.session import Database
from db.types import utcnow
from jobs.certify_path import MOTION
from jobs.map import Map
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
    return Cover.model_validate({**_ended(job), **found})


@router.get("/{job_id}/map")
def get_job_map(job_id: JobGiven, db: Db) -> JobMap:
    """Returns how far a map is, and what is stored of it."""
    with db.read() as session:
        job = _map_job(session, job_id)
        found = KINDS[job.kind].result(session, job)
    known = found["account"]
    told: dict[str, Any] = {"coverage": None, "cells": 0, "looked_at": 0, "given_up": 0, "curve": []}
    if known is not None:
        told = {
            "coverage": {"value": known.coverage, "stderr": known.error},
            "cells": known.cells,
            "looked_at": known.looked,
            "given_up": known.given_up,
            "curve": known.curve,
        }
    return JobMap.model_validate({**_ended(job), **told, "ended": found["ended"], "former": found["former"], "stored": found["map"]})


@router.get("/{job_id}/map/proof", response_class=Response, responses={200: {"content": {"application/octet-stream": {}}}})
@unchanging
def download_map_proof(job_id: JobGiven, db: Db) -> Response:
    """Returns the proof of the map that a job has grown, together with the scene.

    `ciris verify` checks the file offline.
    """
    with db.read() as session:
        job = _map_job(session, job_id)
        report, _ = _stored_map(session, job)
        data = proofs.get(session, report["proof"])
    return _file(data, f"{job.id}.proof", report["proof"])


@router.get("/{job_id}/map/free-set", response_class=Response, responses={200: {"content": {"application/octet-stream": {}}}})
@unchanging
def download_free_set(job_id: JobGiven, db: Db) -> Response:
    """Returns the free set of the map that a job has grown, for lookups without the service (`ciris.FreeSet` in Python)."""
    with db.read() as session:
        job = _map_job(session, job_id)
        _, data = _stored_map(session, job)
    if data is None:
        hint = "let a map grow for longer; a scene without pairs needs none"
        raise CirisError("proof_not_found", "the map proves no configuration to be free", field="job", hint=hint)
    return _file(data, f"{job.id}.free.npz")


@router.get("/{job_id}/motion")
def get_job_motion(job_id: JobGiven, db: Db) -> JobMotion:
    """Returns what has become of the motion that a job has certified."""
    return JobMotion.model_validate(_verdict(db, job_id)[1])


@router.get("/{job_id}/motion/proof", response_class=Response, responses={200: {"content": {"application/octet-stream": {}}}})
@unchanging
def download_motion_proof(job_id: JobGiven, db: Db) -> Response:
    """Returns the proof of the motion that a job has certified, or of its beginning, together with the scene.

    `ciris verify` checks the file offline.
    """
    job, verdict = _verdict(db, job_id)
    if verdict["proof"] is None:
        raise CirisError("proof_not_found", "nothing is proved of this motion", field="job", hint="the contact is where it begins")
    with db.read() as session:
        data = proofs.get(session, verdict["proof"])
    return _file(data, f"{job}.proof", verdict["proof"])


def _file(data: bytes, name: str, digest: str | None = None) -> Response:
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(data, media_type="application/octet-stream", headers=headers | ({"ETag": f'"{digest}"'} if digest else {}))


def _ended(job: JobRow) -> dict[str, Any]:
    """Returns whether a job has ended, how, and how long it took until now."""
    seconds = None if job.started_at is None else ((job.finished_at or utcnow()) - job.started_at).total_seconds()
    return {"state": job.state, "outcome": job.outcome, "reason": job.reason, "seconds": seconds}


def _map_job(session: Session, job_id: str) -> JobRow:
    """Returns a job that grows a map.

    Raises:
        CirisError: map_not_found.
    """
    job = jobs.get(session, job_id)
    if job.kind != Map.name:
        hint = "its own page and /v1/jobs/{id} describe it"
        raise CirisError("map_not_found", f"the job {job.id} is no map, but a {job.kind} job", field="job", hint=hint)
    return job


def _stored_map(session: Session, job: JobRow) -> tuple[dict[str, Any], bytes | None]:
    """Returns the report on the map of a job, and its free set.

    Raises:
        CirisError: map_not_found.
    """
    found = maps.accepted(session, job.id)
    if found is None:
        problem = f"the map job {job.id} is {job.state} and has no map{f': {job.reason}' if job.reason else ''}"
        raise CirisError("map_not_found", problem, field="job", hint="a map is stored when its job ends; an ended one may be retried")
    return found


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
