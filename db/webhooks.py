"""A webhook says whom to tell when a job has ended, how often the service tried, and when it tries again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from uuid import uuid4

from sqlalchemy import select
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db.models import JobRow, WebhookRow
from db.states import JOB, WebhookState, transition, unfinished

BACKOFF_SECONDS = (10, 60, 300, 1800, 7200, 21600)
"""The service pauses this many seconds after each failed attempt but the last."""


@dataclass(frozen=True)
class Delivery:
    """A delivery is one attempt to tell a receiver that a job has ended."""

    webhook: WebhookRow
    job: JobRow


def add(session: Session, job_id: str, url: str, secret: str) -> None:
    """Adds a webhook: the receiver at ``url`` is told when the job has ended."""
    session.add(WebhookRow(id=str(uuid4()), job_id=job_id, url=url, secret=secret))


def copy(session: Session, job_id: str, other_id: str) -> None:
    """Adds to the other job the webhook of this job, if it has one."""
    row = session.scalar(select(WebhookRow).where(WebhookRow.job_id == job_id))
    if row is not None:
        add(session, other_id, row.url, row.secret)


def of_job(session: Session, job_id: str) -> WebhookRow:
    """Returns the job's webhook.

    Raises:
        CirisError: webhook_not_found.
    """
    row = session.scalar(select(WebhookRow).where(WebhookRow.job_id == job_id))
    if row is None:
        raise CirisError("webhook_not_found", f"job {job_id!r} has no webhook", field="job", hint="give one when you create a job")
    return row


def claim(session: Session, now: datetime, limit: int = 50) -> Sequence[Delivery]:
    """Claims the deliveries that are due, and counts each as an attempt. Nobody else gets it until its pause is over.

    A worker that claims a delivery and dies has used up an attempt. A webhook whose last attempt got no answer is given up.
    """
    due = (WebhookRow.state == WebhookState.WAITING, WebhookRow.next_at <= now)
    query = select(WebhookRow, JobRow).join(JobRow, JobRow.id == WebhookRow.job_id).where(*due, JobRow.state.not_in(unfinished(JOB)))
    query = query.order_by(WebhookRow.next_at).limit(limit).with_for_update(of=WebhookRow, skip_locked=True)
    claimed = []
    for webhook, job in session.execute(query):
        if webhook.attempts > len(BACKOFF_SECONDS):
            transition(session, WebhookRow, WebhookState.FAILED, WebhookRow.id == webhook.id)
            continue
        webhook.attempts += 1
        webhook.next_at = now + timedelta(seconds=BACKOFF_SECONDS[min(webhook.attempts, len(BACKOFF_SECONDS)) - 1])
        claimed.append(Delivery(webhook, job))
    return claimed


def delivered(session: Session, webhook_id: str) -> None:
    """Notes that the receiver has taken the message."""
    transition(session, WebhookRow, WebhookState.DELIVERED, WebhookRow.id == webhook_id, error=None)


def failed(session: Session, webhook_id: str, error: str) -> None:
    """Notes that the attempt failed. After the last attempt the webhook is given up."""
    row = session.get_one(WebhookRow, webhook_id)
    row.error = error
    if row.attempts > len(BACKOFF_SECONDS):
        transition(session, WebhookRow, WebhookState.FAILED, WebhookRow.id == webhook_id)
