"""This module opens writing transactions: those after whose commit something is sent, and those that must not be lost."""

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
    """Opens a writing transaction, with a list of calls to make after its commit. After a rollback the calls are not made."""
    afterwards: Afterwards = []
    with database().write() as session:
        yield session, afterwards
    for call in afterwards:
        call()


def persistently(save: Callable[[], Saved]) -> Saved:
    """Calls ``save()`` again and again while the database is away, and returns its result: what it saves may have taken an hour."""
    while True:
        try:
            return save()
        except UNAVAILABLE as error:
            log.warning("the database cannot be used; trying again: %s", error)
            time.sleep(RETRY_SECONDS)
