"""Requests for jobs are checked here as far as that is possible without Drake, and become rows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from sqlalchemy.orm import Session

from api.access import Caller
from api.named import with_positions
from certifier.errors import CirisError
from db import jobs, scenes, webhooks
from db.models import JobRow
from db.session import Database
from db.settings import settings
from jobs.registry import KINDS
from jobs.request import JobRequest, WebhookRequest
from workers import addresses


@dataclass(frozen=True)
class Checked:
    """A request whose names and numbers fit its scene, its options, those that a new job has then, and warnings about it."""

    body: JobRequest
    scene_id: str
    options: dict[str, Any]
    completed: dict[str, Any]
    warnings: list[str]


def checked(db: Database, body: JobRequest, where: str = "") -> Checked:
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
        scene.check_pairs()
        body = with_positions(db, scene, body)
        options = KINDS[body.kind].options(body, scene, db)
        if body.webhook is not None:
            check_webhook(body.webhook)
    except CirisError as error:
        if where:
            error.field = f"{where}.{error.field}" if error.field else where
        raise
    kind = KINDS[body.kind]
    return Checked(body, scene_id, options, kind.completed(options, scene_id, scene, db), kind.warnings(options, scene))


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
        options=asked.completed,
        deadline_seconds=body.deadline_seconds,
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
    return caller.id or "open"


def _digest(asked: Checked) -> str:
    body = asked.body
    document: list[Any] = [asked.scene_id, asked.options, body.priority, body.deadline_seconds, body.webhook and body.webhook.model_dump()]
    document += [body.labels] if body.labels else []
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def check_webhook(body: WebhookRequest) -> None:
    """Refuses a webhook whose receiver the service could never call.

    Raises:
        CirisError: webhook_url, webhook_address.
    """
    try:
        url = urlsplit(body.url)
        usable = url.hostname and url.username is None and url.port != 0
    except ValueError:
        usable = False
    if not usable or not body.url.isascii() or not body.url.isprintable() or " " in body.url:
        raise CirisError(
            "webhook_url", f"{body.url!r} cannot be called", field="webhook.url", hint="write https://host/path, without credentials"
        )
    addresses.check(url.hostname or "", url.port or (443 if url.scheme == "https" else 80), settings().webhook_hosts)
