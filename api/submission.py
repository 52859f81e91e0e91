"""Requests for jobs are checked here as far as that is possible without Drake, and become rows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

from sqlalchemy.orm import Session

from api import checks
from api.access import Caller
from api.schemas.jobs import CertifyPathRequest, CertifyRequest, CoverRequest, GrowRequest, RecertifyRequest
from certifier.errors import CirisError
from certifier.growth.options import GrowthOptions
from certifier.model import Scene
from db import clock, jobs, regions, scenes, webhooks
from db.models import JobRow
from db.session import Database

AnyRequest = GrowRequest | CertifyRequest | RecertifyRequest | CertifyPathRequest | CoverRequest


@dataclass(frozen=True)
class Checked:
    """A request whose names and numbers fit its scene, and the options that the job will have."""

    body: AnyRequest
    scene_id: str
    options: dict[str, Any]


def checked(db: Database, body: AnyRequest, where: str = "") -> Checked:
    """Checks a request.

    Args:
        where: the field of the whole body that the request is, which fields of errors begin with.

    Raises:
        CirisError: what is wrong.
    """
    try:
        with db.read() as session:
            scene_id = scenes.find(session, body.scene)
        scene = scenes.load(db, scene_id)
        options = _recertify(body, scene, db) if isinstance(body, RecertifyRequest) else _options(body, scene)
        if body.webhook is not None:
            checks.webhook(body.webhook)
    except CirisError as error:
        if where:
            error.field = f"{where}.{error.field}" if error.field else where
        raise
    return Checked(body, scene_id, options)


def submit(session: Session, asked: Checked, caller: Caller, idempotency_key: str | None) -> tuple[JobRow, bool]:
    """Creates the job, and returns it with True, or returns the job made earlier under the same key with False.

    Raises:
        CirisError: as :func:`db.jobs.create` and :func:`db.webhooks.add` say.
    """
    return _submit(session, asked, caller, idempotency_key and f"{_name(caller)}:{idempotency_key}", _digest(asked))


def submit_all(session: Session, asked: Sequence[Checked], caller: Caller, idempotency_key: str | None) -> list[tuple[JobRow, bool]]:
    """Does as :func:`submit` for the jobs of a batch. Its key is none of a single job, and stands for the whole batch.

    Raises:
        CirisError: as :func:`submit`.
    """
    whole = hashlib.sha256(json.dumps([_digest(one) for one in asked]).encode()).hexdigest()
    keys = [idempotency_key and f"batch:{_name(caller)}:{i}:{idempotency_key}" for i in range(len(asked))]
    return [_submit(session, one, caller, key, whole) for one, key in zip(asked, keys, strict=True)]


def _submit(session: Session, asked: Checked, caller: Caller, stored_key: str | None, digest: str) -> tuple[JobRow, bool]:
    body = asked.body
    job, made = jobs.create(
        session,
        kind=body.kind,
        scene_id=asked.scene_id,
        options=asked.options,
        deadline_at=clock.now(session) + timedelta(seconds=body.deadline_seconds) if body.deadline_seconds else None,
        idempotency_key=stored_key,
        request_digest=digest,
        key_id=caller.key_id,
        priority=body.priority,
        given_labels=body.labels,
    )
    if made and body.webhook is not None:
        webhooks.add(session, job.id, body.webhook.url, body.webhook.secret)
    return job, made


def _name(caller: Caller) -> str:
    """Returns whose idempotency keys are meant."""
    return caller.key_id or "open"


def _options(body: GrowRequest | CertifyRequest | CertifyPathRequest | CoverRequest, scene: Scene) -> dict[str, Any]:
    """Returns the document of GrowthOptions, CoverOptions or a motion that the request asks for, its numbers checked against the scene."""
    if isinstance(body, CoverRequest):
        return checks.cover(scene, body.options).to_document()
    if isinstance(body, CertifyPathRequest):
        return checks.motion(scene, body)
    if isinstance(body, GrowRequest):
        seed = checks.seed(scene, body.seed).to_document()
        return GrowthOptions.from_document({"kind": "grow", "seed": seed, **body.options.model_dump()}).to_document()
    checks.polytope(scene, body.polytope)
    return {"kind": "certify", "seed": body.polytope.model_dump(exclude_none=True), "cells": body.cells, "random_seed": body.random_seed}


def _recertify(body: RecertifyRequest, scene: Scene, db: Database) -> dict[str, Any]:
    """Does as :func:`_options` for a region of another scene."""
    with db.read() as session:
        row = regions.get(session, body.region)
        region, digest, manifest, old = row.id, row.proof_digest, row.manifest, row.scene_id
    checks.same_robot(scenes.load(db, old), scene)
    polytope = {"C": manifest["halfspace_normals"], "d": manifest["halfspace_offsets"], "q": checks.kept(scene, manifest)}
    return {"kind": "recertify", "seed": {**polytope, "region": region, "proof": digest}, "random_seed": body.random_seed}


def _digest(asked: Checked) -> str:
    body = asked.body
    document: list[Any] = [asked.scene_id, asked.options, body.priority, body.deadline_seconds, body.webhook and body.webhook.model_dump()]
    document += [body.labels] if body.labels else []
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()
