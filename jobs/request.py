"""What the requests for all kinds of job have in common."""

from __future__ import annotations

from base64 import b64decode

from pydantic import ConfigDict, Field, field_validator

from certifier.jobs.options import JobOptions
from jobs import patterns
from jobs.fields import Request, SceneName, model_of


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


class JobRequest(model_of(JobOptions)):  # type: ignore[misc]
    """Holds what the requests for all kinds of job have in common."""

    kind: str
    scene: SceneName
    webhook: WebhookRequest | None = Field(None, description="Whom to tell when the job has ended; nobody by default.")
