"""A project's people see other ids of events than the database has: numbers that say nothing of how many events other projects have.

The ids of the database are counted over all projects. They are permuted by a key of the project (a Feistel network: Luby, Rackoff 1988).
"""

from __future__ import annotations

import hashlib

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.models import DEFAULT_PROJECT, ProjectRow
from db.session import project_of

HALF = 26
"""A number has two halves of this many bits, and is one that JavaScript tells from others."""
MOST = 2 ** (2 * HALF) - 1
ROUNDS = 8


class EventIds:
    """Translates ids of events for the people of a project."""

    def __init__(self, key: bytes) -> None:
        self._key = key

    def shown(self, id: int) -> int:
        """Returns the number that people see of an event."""
        left, right = id >> HALF, id % 2**HALF
        for number in range(ROUNDS):
            left, right = right, left ^ self._mixed(number, right)
        return left << HALF | right

    def meant(self, shown: int) -> int:
        """Returns the id of an event from what people see of it; from any other number most probably one that no event has yet."""
        left, right = shown >> HALF, shown % 2**HALF
        for number in reversed(range(ROUNDS)):
            left, right = right ^ self._mixed(number, left), left
        return left << HALF | right

    def _mixed(self, number: int, half: int) -> int:
        data = number.to_bytes(1, "big") + half.to_bytes(4, "big")
        return int.from_bytes(hashlib.blake2b(data, key=self._key, digest_size=4).digest(), "big") % 2**HALF


def of_project(session: Session) -> EventIds:
    """Returns how the session's project sees ids of events."""
    project = project_of(session) or DEFAULT_PROJECT
    return EventIds(session.scalars(select(ProjectRow.events_key).where(ProjectRow.name == project)).one())
