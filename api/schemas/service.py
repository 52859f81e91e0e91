"""These models describe the service itself."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel


class Health(BaseModel):
    """Says that the process answers."""

    status: Literal["ok"] = "ok"


class Readiness(BaseModel):
    """Says whether the service can do its work. A check is `ok` or says what is wrong."""

    ready: bool
    checks: dict[str, str]
