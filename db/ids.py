"""Ids may be given by their first characters, as the dashboard and the command line show them."""

from __future__ import annotations

from typing import TypeVar

from sqlalchemy import select
from sqlalchemy.orm import DeclarativeBase, InstrumentedAttribute, Session

from certifier.errors import CirisError

Row = TypeVar("Row", bound=DeclarativeBase)
SHORTEST = 4
"""Least number of characters of an id that is given in short."""


def expanded(session: Session, column: InstrumentedAttribute[str], given: str) -> str:
    """Returns the only id that begins with the given text, or else the text itself, which may be an id or not.

    Raises:
        CirisError: ambiguous_id, when several ids begin with it.
    """
    if len(given) < SHORTEST:
        return given
    found = session.scalars(select(column).where(column.startswith(given, autoescape=True)).limit(2)).all()
    if len(found) > 1 and given not in found:
        raise CirisError(
            "ambiguous_id", f"several ids begin with {given!r}", field=column.class_.__tablename__.rstrip("s"), hint="give more of it"
        )
    return found[0] if len(found) == 1 else given


def found(session: Session, model: type[Row], given: str) -> Row | None:
    """Returns the row with this id, or with the only id that begins like this; None where there is none.

    Raises:
        CirisError: ambiguous_id, when several ids begin with it.
    """
    return session.get(model, given) or session.get(model, expanded(session, model.id, given))  # type: ignore[attr-defined]
