"""These are column types: times with their zone, and named arrays."""

from __future__ import annotations

import io
from datetime import UTC, datetime
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import DateTime, Dialect, LargeBinary
from sqlalchemy.types import TypeDecorator

Arrays = dict[str, NDArray[np.float64]]

_ONE_AT_A_TIME = Lock()
"""numpy parses the headers of arrays by ``ast``. In Python 3.11, this raises SystemError when two threads do so (python/cpython#106905)."""


def utcnow() -> datetime:
    """Returns the time now, with its zone."""
    return datetime.now(UTC)


class Utc(TypeDecorator[datetime]):
    """This column holds a time with its zone. Databases without zones (SQLite) store it in UTC."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        return value and value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        return value and (value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC))


class Npz(TypeDecorator[Arrays]):
    """This column holds named arrays of doubles, stored as the bytes of an npz file."""

    impl = LargeBinary
    cache_ok = True

    def process_bind_param(self, value: Arrays | None, dialect: Dialect) -> bytes | None:
        if value is None:
            return None
        buffer = io.BytesIO()
        doubles: dict[str, Any] = {name: np.asarray(array, dtype=float) for name, array in value.items()}
        np.savez(buffer, **doubles)
        return buffer.getvalue()

    def process_result_value(self, value: Any, dialect: Dialect) -> Arrays | None:
        if value is None:
            return None
        with _ONE_AT_A_TIME, np.load(io.BytesIO(value), allow_pickle=False) as arrays:
            return dict(arrays)
