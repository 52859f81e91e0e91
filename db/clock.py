"""Leases go by the database's clock, because workers on other machines may have theirs wrong."""

from __future__ import annotations

from datetime import datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.types import Utc, utcnow


def now(session: Session) -> datetime:
    """Returns the time that the database's server has. SQLite has none: everybody who uses it is on one machine."""
    if session.get_bind().dialect.name == "sqlite":
        return utcnow()
    return session.scalars(select(func.clock_timestamp(type_=Utc()))).one()
