"""Jobs may tell a receiver that they have ended. These routes say how telling goes, and have it done again."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, status

from api.access import READ, SUBMIT, Db
from api.reading import ReadingRoute
from api.schemas.common import Cursor, JobGiven, Listed
from api.schemas.webhooks import Webhook, WebhookPage, WebhookSummary
from api.writing import writing
from db import jobs, webhooks
from db.states import WebhookState
from db.types import utcnow

router = APIRouter(prefix="/v1", tags=["jobs"], dependencies=[READ], route_class=ReadingRoute)

InState = Annotated[WebhookState | None, Query(description="List only the webhooks in this state.")]


@router.get("/webhooks")
def list_webhooks(db: Db, state: InState = None, after: Cursor = None, limit: Listed = 50) -> WebhookPage:
    """Lists the webhooks of jobs, those of the newest jobs first: whom they tell, and whether that went well."""
    with db.read() as session:
        rows, following = webhooks.page(session, state, after, limit)
    return WebhookPage(webhooks=[WebhookSummary.of(row) for row in rows], next=following)


@router.get("/jobs/{job_id}/webhook")
def get_job_webhook(job_id: JobGiven, db: Db) -> Webhook:
    """Returns the job's webhook: whether it was delivered after the end of the job, and the attempts."""
    with db.read() as session:
        row = webhooks.of_job(session, jobs.get(session, job_id).id)
        return Webhook.with_deliveries(row, webhooks.deliveries(session, row.id))


@router.post("/jobs/{job_id}/webhook/resend", dependencies=[SUBMIT], status_code=status.HTTP_202_ACCEPTED)
@writing
def resend_job_webhook(job_id: JobGiven, db: Db) -> Webhook:
    """Calls the receiver again within seconds, and repeats that as often as at first, whether it had answered before or not.

    The message has the same `webhook-id`, so a receiver can tell that it knows it. The job must have ended.
    """
    with db.write() as session:
        row = webhooks.send_again(session, jobs.lock(session, jobs.get(session, job_id).id), utcnow())
        return Webhook.with_deliveries(row, webhooks.deliveries(session, row.id))
