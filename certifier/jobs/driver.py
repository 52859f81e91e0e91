"""One loop drives every job. Its store is the memory of this process (:mod:`certifier.jobs.local`), or the database of the service."""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

from certifier.errors import CirisError

Turn = TypeVar("Turn")


class Store(Protocol[Turn]):
    """A store holds a job: its state, the action that it waits for, and the report on this action."""

    def turn(self) -> Turn | None:
        """Returns what is to be decided now; None where the job has ended, waits for its work, or is decided about by another process."""

    def decide(self, turn: Turn) -> Any:
        """Returns what is next.

        Raises:
            CirisError: why the job cannot go on.
        """

    def save(self, turn: Turn, decision: Any | CirisError) -> bool:
        """Saves a decision, or why there is none, and begins its work. Returns whether the next turn may have come already."""


def drive(store: Store[Any]) -> None:
    """Takes a job as far as it goes without waiting for its work. It does no harm to call it too often or at any time."""
    goes_on = True
    while goes_on and (turn := store.turn()) is not None:
        try:
            decision = store.decide(turn)
        except CirisError as error:
            decision = error
        goes_on = store.save(turn, decision)
