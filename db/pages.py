"""Lists come one page at a time, the newest row first.

A cursor holds the place of the last row of its page, not the row itself. So it stays valid when that row is deleted. No row that
exists all the while is left out or shown twice.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Generic, TypeVar

from sqlalchemy import Select, tuple_
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db.models import ApiKeyRow, AuditRow, JobRow, RegionRow, SceneRow, WorkerRow

Row = TypeVar("Row", ApiKeyRow, AuditRow, JobRow, RegionRow, SceneRow, WorkerRow)


@dataclass(frozen=True)
class Page(Generic[Row]):
    """A page holds rows, newest first, what to pass as ``after`` for the next page (None on the last), and as ``before`` for the page
    before it (None on the first).
    """

    rows: Sequence[Row]
    next: str | None
    previous: str | None = None


def page(session: Session, model: type[Row], query: Select[Row], after: str | None, limit: int, before: str | None = None) -> Page[Row]:
    """Returns one page of the rows that the query finds.

    Raises:
        CirisError: cursor, when ``after`` or ``before`` did not come from a page.
    """
    if before is not None:
        newer = query.where(tuple_(model.created_at, model.id) > tuple_(*_place(before)))
        nearest = session.scalars(newer.order_by(model.created_at, model.id).limit(limit + 1)).all()
        rows = nearest[:limit][::-1]
        return Page(rows, _cursor(rows[-1]) if rows else None, _cursor(rows[0]) if len(nearest) > limit else None)
    if after is not None:
        query = query.where(tuple_(model.created_at, model.id) < tuple_(*_place(after)))
    rows = session.scalars(query.order_by(model.created_at.desc(), model.id.desc()).limit(limit + 1)).all()
    return Page(rows[:limit], _cursor(rows[limit - 1]) if len(rows) > limit else None, _cursor(rows[0]) if after and rows else None)


def _cursor(row: ApiKeyRow | AuditRow | JobRow | RegionRow | SceneRow | WorkerRow) -> str:
    return base64.urlsafe_b64encode(f"{row.created_at.isoformat()} {row.id}".encode()).decode()


def _place(cursor: str) -> tuple[datetime, str]:
    try:
        created_at, _, row_id = base64.b64decode(cursor, altchars="-_", validate=True).decode().partition(" ")
        place = datetime.fromisoformat(created_at)
        if place.tzinfo is None or not row_id.isprintable():
            raise ValueError
    except ValueError:
        raise unknown() from None
    return place, row_id


def unknown() -> CirisError:
    """Returns the error for a cursor that did not come from a page."""
    return CirisError("cursor", "this is not the `next` of a page", field="after", hint="leave it out to begin with the first page")
