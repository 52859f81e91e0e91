"""The audit log says who changed keys, grants and limits, promoted scenes, deleted what, and paused or drained workers.

It is written with the change, in the same transaction.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from enum import StrEnum
from uuid import uuid4

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from db import pages
from db.models import DEFAULT_PROJECT, AuditRow
from db.pages import Page

COMMAND_LINE = "command line"
"""The name of a person in a shell with access to the database is not known."""

KEPT_DAYS = 400
"""A line stays for this many days: a year, and some days to look back at it."""
TOGETHER = 1000
"""At most this many lines are forgotten in one transaction."""


class Action(StrEnum):
    """Says what was done."""

    PROJECT_MADE = "project_made"
    LIMITS_SET = "limits_set"
    KEY_MADE = "key_made"
    KEY_REVOKED = "key_revoked"
    GRANT_MADE = "grant_made"
    GRANT_REVOKED = "grant_revoked"
    SCENE_PROMOTED = "scene_promoted"
    SCENE_DELETED = "scene_deleted"
    JOB_DELETED = "job_deleted"
    REGION_DELETED = "region_deleted"
    WORKER_PAUSED = "worker_paused"
    WORKER_RESUMED = "worker_resumed"
    WORKER_DRAINED = "worker_drained"


def note(session: Session, project: str, who: str, action: Action, what: str) -> None:
    """Adds a line to a project's log."""
    session.add(AuditRow(id=str(uuid4()), project=project, who=who, action=action, what=what))


def note_of_service(session: Session, project: str, who: str, action: Action, what: str) -> None:
    """Adds a line about what those who run the service did to a project: to its log, and to their own, that of ``DEFAULT_PROJECT``."""
    note(session, project, who, action, what)
    if project != DEFAULT_PROJECT:
        note(session, DEFAULT_PROJECT, who, action, what if what == project else f"{project}: {what}")


def forgettable(session: Session, now: datetime) -> bool:
    """Returns whether some line is older than KEPT_DAYS."""
    return session.scalar(select(AuditRow.id).where(AuditRow.created_at < now - timedelta(days=KEPT_DAYS)).limit(1)) is not None


def forget(session: Session, now: datetime) -> None:
    """Deletes some of the lines that are older than KEPT_DAYS."""
    old = select(AuditRow.id).where(AuditRow.created_at < now - timedelta(days=KEPT_DAYS)).limit(TOGETHER)
    session.execute(delete(AuditRow).where(AuditRow.id.in_(session.scalars(old).all())))


def page(session: Session, after: str | None = None, limit: int = 100) -> Page[AuditRow]:
    """Returns one page of the log of the session's project.

    Raises:
        CirisError: cursor.
    """
    return pages.page(session, AuditRow, select(AuditRow), after, limit)
