"""Writing transactions: with what is to be sent once they are committed, and such as must not be lost."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from sqlalchemy.orm import Session

from db.session import UNAVAILABLE, database

log = logging.getLogger(__name__)

Afterwards = list[Callable[[], object]]
Saved = TypeVar("Saved")
RETRY_SECONDS = 1.0


@contextmanager
def writing() -> Iterator[tuple[Session, Afterwards]]:
    """A writing transaction and a list of calls to make after its commit; they are dropped when it is rolled back."""
    afterwards: Afterwards = []
    with database().write() as session:
        yield session, afterwards
    for call in afterwards:
        call()


def persistently(save: Callable[[], Saved]) -> Saved:
    """What ``save()`` returns, which is tried again for as long as the database is away: what it saves may have taken an hour."""
    while True:
        try:
            return save()
        except UNAVAILABLE as error:
            log.warning("the database cannot be used; trying again: %s", error)
            time.sleep(RETRY_SECONDS)
