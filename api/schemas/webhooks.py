"""These models say how telling the receivers of jobs goes."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any, Self

from pydantic import BaseModel, Field

from api.schemas.common import Page
from db.models import DeliveryRow, WebhookRow
from db.states import WebhookState
from db.webhooks import KEPT


class Delivery(BaseModel):
    """Says how one attempt to call the receiver went."""

    at: datetime = Field(description="When the attempt began.")
    seconds: float = Field(description="How long it took.")
    status: int | None = Field(description="The receiver's HTTP status; null where it gave none.")
    answer: str | None = Field(description="How the body of its answer begins; null where it had none.")
    error: str | None = Field(description="Why the attempt failed; null where it did not.")

    @classmethod
    def of(cls, row: DeliveryRow) -> Self:
        return cls(at=row.at, seconds=row.seconds, status=row.status, answer=row.answer, error=row.error)


class WebhookSummary(BaseModel):
    """Says whether the webhook was delivered, which reports the end of the job."""

    job: str = Field(description="Id of the job.")
    url: str = Field(description="The address that is called.")
    state: WebhookState = Field(description="Whether the webhook was delivered.")
    attempts: int = Field(description="How often it was called, since it was last asked for.")
    next_at: datetime = Field(description="The service does not try before this time.")
    error: str | None = Field(description="Why the last attempt failed.")

    @classmethod
    def of(cls, row: WebhookRow) -> Self:
        return cls.model_validate(_facts(row))


class Webhook(WebhookSummary):
    """Says whether the webhook was delivered, which reports the end of the job, and lists the last attempts."""

    deliveries: list[Delivery] = Field(description=f"The last attempts, the newest first, at most {KEPT}.")

    @classmethod
    def with_deliveries(cls, row: WebhookRow, deliveries: Sequence[DeliveryRow]) -> Self:
        return cls(**_facts(row), deliveries=[Delivery.of(one) for one in deliveries])


class WebhookPage(Page):
    """Holds one page of webhooks, those of the newest jobs first."""

    webhooks: list[WebhookSummary] = Field(description="The webhooks of this page.")


def _facts(row: WebhookRow) -> dict[str, Any]:
    return {
        "job": row.job_id,
        "url": row.url,
        "state": WebhookState(row.state),
        "attempts": row.attempts,
        "next_at": row.next_at,
        "error": row.error,
    }
