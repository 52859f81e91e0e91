"""A writing transaction with what is to be sent once it is committed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from sqlalchemy.orm import Session

from db.session import database

Afterwards = list[Callable[[], object]]


@contextmanager
def writing() -> Iterator[tuple[Session, Afterwards]]:
    """A writing transaction and a list of calls to make after its commit; they are dropped when it is rolled back."""
    afterwards: Afterwards = []
    with database().write() as session:
        yield session, afterwards
    for call in afterwards:
        call()
