"""What the requests for all kinds of job have in common."""

from __future__ import annotations

from base64 import b64decode
from typing import Annotated

from pydantic import ConfigDict, Field, field_validator

from jobs import patterns
from jobs.fields import Real, Request, SceneName, Whole


class WebhookRequest(Request):
    """Asks the service to call this receiver with a POST when the job has ended.

    The message is signed as Standard Webhooks describes. The service repeats it until the receiver answers with success, or until the last
    attempt has failed.
    """

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"url": "https://planner.example.org/ciris", "secret": "whsec_AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwdHh8="}]
        }
    )

    url: str = Field(max_length=2000, pattern=patterns.WEBHOOK_URL, description="URL to call, http:// or https://, at a public address.")
    secret: str = Field(
        pattern=patterns.WEBHOOK_SECRET,
        description="`whsec_` and the base64 of 24 to 64 random bytes. The service signs the message with them and never shows them again.",
    )

    @field_validator("secret")
    @classmethod
    def _is_base64(cls, secret: str) -> str:
        if not 24 <= len(b64decode(secret.removeprefix("whsec_"), validate=True)) <= 64:
            raise ValueError("it must stand for 24 to 64 bytes")
        return secret


LabelName = Annotated[str, Field(min_length=1, max_length=64, pattern=patterns.LABEL_NAME)]
LabelValue = Annotated[str, Field(max_length=200, pattern=patterns.ANY)]
Labels = Annotated[dict[LabelName, LabelValue], Field(max_length=20)]


class JobRequest(Request):
    """Holds what the requests for all kinds of job have in common."""

    kind: str
    scene: SceneName
    priority: Whole = Field(0, ge=-3, le=3, description="Each step up doubles the job's share of the work for its API key.")
    deadline_seconds: Real | None = Field(
        None, gt=0, le=30 * 86400, description="The job ends this many seconds after its creation, with the regions it has by then."
    )
    labels: Labels = Field(default_factory=dict, description="Labels to find the job by, at most 20: name -> value.")
    webhook: WebhookRequest | None = Field(None, description="Whom to tell when the job has ended; nobody by default.")
