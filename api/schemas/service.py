"""The service itself."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel


class Health(BaseModel):
    """The process answers."""

    status: Literal["ok"] = "ok"


class Readiness(BaseModel):
    """Whether the service can do its work; a check is `ok` or says what is wrong."""

    ready: bool
    checks: dict[str, str]
