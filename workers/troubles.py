"""What a worker does again and again may fail. What failed last is kept here until it goes well, for people to see (workers.presence)."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

log = logging.getLogger(__name__)


class Troubles:
    """Holds what failed when it was tried last. The threads of a worker share it."""

    def __init__(self) -> None:
        self._failed: dict[str, str] = {}

    @contextmanager
    def noting(self, what: str) -> Iterator[None]:
        """Logs and notes an error of the block, and ends it there: it is tried again. A block that goes well takes the note away."""
        try:
            yield
        except Exception as error:
            log.exception("%s failed; it is tried again", what)
            self.note(what, type(error).__name__)
        else:
            self.note(what, None)

    def note(self, what: str, why: str | None) -> None:
        """Notes why something fails; None takes the note away."""
        if why is None:
            self._failed.pop(what, None)
        else:
            self._failed[what] = why

    def said(self) -> str | None:
        """Returns what fails and with which error, in words; None where all goes well."""
        return "; ".join(f"{what} failed: {error}" for what, error in sorted(self._failed.items())) or None
