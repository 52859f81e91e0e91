"""These models describe the service itself."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal, Self

from pydantic import BaseModel, Field

from api.schemas.common import Page
from db import keys
from db.audit import Action
from db.keys import MOST_DAYS, Scope
from db.models import ApiKeyRow, AuditRow
from jobs import patterns
from jobs.fields import Request


class Health(BaseModel):
    """Says that the process answers."""

    status: Annotated[Literal["ok"], Field(description="Always `ok`.")] = "ok"


class Readiness(BaseModel):
    """Says whether this process can serve requests. A check is `ok` or says what is wrong."""

    ready: bool = Field(description="True where every check but `queue` is `ok`. Without the queue, jobs are accepted and wait.")
    checks: dict[str, str] = Field(description="Name of a check -> `ok`, or what is wrong and what to do.")


class NewKey(Request):
    """Asks for an API key of the caller's project, or of another one, which admins of the project `default` may do."""

    name: str = Field(pattern=patterns.KEY_NAME, description="No other key of the project may have this name.", examples=["planner"])
    scope: Scope = Field(description="What the key allows; each scope includes those before it: read, submit, admin.")
    days: float | None = Field(None, gt=0, le=MOST_DAYS, description="The key expires after this many days; null for never.", examples=[90])
    project: str | None = Field(
        None, pattern=patterns.KEY_NAME, description="The project that the key belongs to; null for the caller's own.", examples=["welding"]
    )


class KeySummary(BaseModel):
    """Describes an API key, without what is secret."""

    id: str = Field(description="The part of the key that is no secret. Logs name it.")
    name: str = Field(description="The name by which it is revoked.")
    scope: Scope = Field(description="What the key allows.")
    created_at: datetime = Field(description="When it was made.")
    last_used_at: datetime | None = Field(
        description="When it was last used, or up to ten minutes before; null where it was not, since the service keeps this."
    )
    expires_at: datetime | None = Field(description="When it will expire; null for never, and where it has ended.")
    revoked_at: datetime | None = Field(description="When it was revoked, or has expired; null while it is valid.")

    @classmethod
    def of(cls, row: ApiKeyRow) -> Self:
        expires_at, revoked_at = keys.ends(row)
        return cls(
            id=row.id,
            name=row.name,
            scope=Scope(row.scope),
            created_at=row.created_at,
            last_used_at=row.last_used_at,
            expires_at=expires_at,
            revoked_at=revoked_at,
        )


class MadeKey(BaseModel):
    """Holds a new API key. Nobody can ask for it again."""

    name: str = Field(description="The name by which it is revoked.")
    scope: Scope = Field(description="What the key allows.")
    key: str = Field(description="The key itself. The service stores no more than a hash of it.")


class KeyPage(Page):
    """Holds one page of the keys of the caller's project, newest first."""

    keys: list[KeySummary] = Field(description="The keys, the revoked ones too.")


class AuditLine(BaseModel):
    """Says who changed a key or a limit, or deleted something."""

    at: datetime = Field(description="When it was done.")
    who: str = Field(
        description="The key's name and id; the person who signed in; `command line`; or `anybody` where the service asks for no key."
    )
    action: Action = Field(description="What was done.")
    what: str = Field(description="Names what was changed.")

    @classmethod
    def of(cls, row: AuditRow) -> Self:
        return cls(at=row.created_at, who=row.who, action=Action(row.action), what=row.what)


class AuditPage(Page):
    """Holds one page of the log, newest first."""

    lines: list[AuditLine] = Field(description="Lines of the log.")


class Dependents(BaseModel):
    """Counts what is deleted with a scene or a job."""

    jobs: int = Field(description="Jobs of the scene, or those that a cover has made.")
    unfinished: int = Field(description="Jobs that have not ended, the job itself included. Nothing is deleted before they have.")
    regions: int = Field(description="Certified regions.")
    maps: int = Field(description="Maps that are stored.")
    webhooks: int = Field(description="Webhooks that wait: receivers that were not told yet that a job has ended, and would never be.")
    bytes: int = Field(description="Bytes of proofs and cells.")
