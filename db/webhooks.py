"""A webhook says whom to tell when a job has ended, how often the service tried, and when it tries again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from uuid import uuid4

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import pages
from db.models import DeliveryRow, JobRow, WebhookRow
from db.states import JOB, WebhookState, transition, unfinished
from db.types import utcnow
from db.vault import is_sealed, vault

BACKOFF_SECONDS = (10, 60, 300, 1800, 7200, 21600)
"""The service pauses this many seconds after each failed attempt but the last."""
HELD_SECONDS = 60
"""A claim holds this long. An attempt takes less, so nobody else begins one meanwhile."""
AT_ONCE, OF_PROJECT, OF_RECEIVER = 32, 8, 4
"""A control worker has at most this many deliveries under way: in all, of one project, and to one receiver of a project."""
KEPT = 20
"""Number of attempts that are kept of each webhook, the last ones."""
ANSWER = 500
"""Number of characters of a receiver's answer that are kept."""


Place = tuple[str, str]


@dataclass(frozen=True)
class Delivery:
    """A delivery is one attempt to tell a receiver that a job has ended."""

    webhook: WebhookRow
    job: JobRow

    @property
    def place(self) -> Place:
        """Returns the project that the attempt is made for, and the receiver: scheme, host and port of its address."""
        return self.job.project, "/".join(self.webhook.url.partition("?")[0].split("/")[:3])


@dataclass(frozen=True)
class Answered:
    """Says how an attempt went. ``error`` says why it failed, and is empty where it did not."""

    at: datetime
    seconds: float
    status: int | None
    answer: str
    error: str


def add(session: Session, job_id: str, url: str, secret: str) -> None:
    """Adds a webhook: the service calls the receiver at ``url`` when the job has ended.

    Raises:
        CirisError: no_secret_key, secret_key.
    """
    session.add(WebhookRow(id=str(uuid4()), job_id=job_id, url=url, secret=vault().seal(secret, url)))


def copy(session: Session, job_id: str, other_id: str) -> None:
    """Adds to the other job the webhook of this job, if it has one."""
    row = session.scalar(select(WebhookRow).where(WebhookRow.job_id == job_id))
    if row is not None:
        session.add(WebhookRow(id=str(uuid4()), job_id=other_id, url=row.url, secret=row.secret))


def of_job(session: Session, job_id: str) -> WebhookRow:
    """Returns the job's webhook.

    Raises:
        CirisError: webhook_not_found.
    """
    row = session.scalar(select(WebhookRow).where(WebhookRow.job_id == job_id))
    if row is None:
        raise CirisError("webhook_not_found", f"job {job_id!r} has no webhook", field="job", hint="give one when you create a job")
    return row


def page(session: Session, state: str | None, after: str | None, limit: int) -> tuple[Sequence[WebhookRow], str | None]:
    """Returns one page of webhooks, those of the newest jobs first, and what to pass as ``after`` for the next page.

    Args:
        state: return only the webhooks in this state.

    Raises:
        CirisError: cursor.
    """
    query = select(JobRow).join(WebhookRow, WebhookRow.job_id == JobRow.id)
    told = pages.page(session, JobRow, query if state is None else query.where(WebhookRow.state == state), after, limit)
    rows = session.scalars(select(WebhookRow).where(WebhookRow.job_id.in_([job.id for job in told.rows])))
    of = {row.job_id: row for row in rows}
    return [of[job.id] for job in told.rows], told.next


def claim(session: Session, now: datetime, under_way: Sequence[Place] = ()) -> Sequence[Delivery]:
    """Claims deliveries that are due, and counts each as an attempt. Nobody else gets one until it is settled or its claim is over.

    Projects take turns: the next delivery is of the project that has the fewest under way, and then of the one that waits longest. So
    receivers that do not answer delay others of their project at most.

    A worker that claims a delivery and dies has used up an attempt. A webhook whose last attempt got no answer is given up.

    Args:
        under_way: the places of those that the caller has claimed before and not settled.
    """
    due = (WebhookRow.state == WebhookState.WAITING, WebhookRow.next_at <= now, JobRow.state.not_in(unfinished(JOB)))
    waiting = select(JobRow.project, func.min(WebhookRow.next_at)).join(WebhookRow, WebhookRow.job_id == JobRow.id).where(*due)
    since = dict(session.execute(waiting.group_by(JobRow.project)).all())
    places, of_project = Counter(under_way), Counter(project for project, _ in under_way)
    claimed: list[Delivery] = []
    while places.total() < AT_ONCE and (free := [project for project in since if of_project[project] < OF_PROJECT]):
        project = min(free, key=lambda one: (of_project[one], since[one]))
        full = [receiver for (of, receiver), count in places.items() if of == project and count >= OF_RECEIVER]
        others = (~WebhookRow.url.startswith(receiver, autoescape=True) for receiver in full)
        query = select(WebhookRow, JobRow).join(JobRow, JobRow.id == WebhookRow.job_id).where(*due, JobRow.project == project, *others)
        query = query.order_by(WebhookRow.next_at).limit(1).with_for_update(of=WebhookRow, skip_locked=True)
        found = session.execute(query).one_or_none()
        if found is None:
            del since[project]
            continue
        delivery = Delivery(*found)
        webhook = delivery.webhook
        if webhook.attempts > len(BACKOFF_SECONDS):
            transition(session, WebhookRow, WebhookState.FAILED, WebhookRow.id == webhook.id)
            continue
        webhook.attempts += 1
        webhook.next_at = now + timedelta(seconds=max(HELD_SECONDS, _pause(webhook)))
        claimed.append(delivery)
        places[delivery.place] += 1
        of_project[project] += 1
    return claimed


def _pause(webhook: WebhookRow) -> int:
    """Returns how many seconds pass after the attempt before the next one."""
    return BACKOFF_SECONDS[min(webhook.attempts, len(BACKOFF_SECONDS)) - 1]


def settle(session: Session, webhook_id: str, answered: Answered) -> None:
    """Notes how an attempt went, and when the next one is due. After the last attempt a webhook is given up."""
    row = session.get_one(WebhookRow, webhook_id)
    session.add(
        DeliveryRow(
            webhook_id=webhook_id,
            at=answered.at,
            seconds=answered.seconds,
            status=answered.status,
            answer=answered.answer[:ANSWER].replace("\0", "") or None,
            error=answered.error or None,
        )
    )
    session.flush()
    old = select(DeliveryRow.id).where(DeliveryRow.webhook_id == webhook_id).order_by(DeliveryRow.id.desc()).offset(KEPT)
    session.execute(delete(DeliveryRow).where(DeliveryRow.id.in_(session.scalars(old).all())))
    row.error = answered.error or None
    if not answered.error:
        transition(session, WebhookRow, WebhookState.DELIVERED, WebhookRow.id == webhook_id)
    elif row.attempts > len(BACKOFF_SECONDS):
        transition(session, WebhookRow, WebhookState.FAILED, WebhookRow.id == webhook_id)
    elif row.attempts:  # none where somebody has had the receiver called again meanwhile
        row.next_at = utcnow() + timedelta(seconds=_pause(row))


def deliveries(session: Session, webhook_id: str) -> Sequence[DeliveryRow]:
    """Returns the attempts that are remembered, the last one first."""
    return session.scalars(select(DeliveryRow).where(DeliveryRow.webhook_id == webhook_id).order_by(DeliveryRow.id.desc())).all()


def send_again(session: Session, job: JobRow, now: datetime) -> WebhookRow:
    """Lets the receiver be called again, at once and then as if for the first time, whether it had answered before or not.

    The caller holds the job's lock.

    Raises:
        CirisError: webhook_not_found; webhook_waits, when the job has not ended.
    """
    row = of_job(session, job.id)
    if job.state in unfinished(JOB):
        problem = f"the job is {job.state}; its webhook is called when it has ended"
        raise CirisError("webhook_waits", problem, field="job", hint="wait for the end of the job")
    transition(session, WebhookRow, WebhookState.WAITING, WebhookRow.id == row.id)
    session.refresh(row)
    row.attempts, row.next_at, row.error = 0, now, None
    return row


def seal_all(session: Session) -> int:
    """Encrypts the secrets that an earlier version has stored as they are. Returns how many."""
    rows = [row for row in session.scalars(select(WebhookRow)) if not is_sealed(row.secret)]
    for row in rows:
        row.secret = vault().seal(row.secret, row.url)
    return len(rows)
