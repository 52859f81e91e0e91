"""A solve worker has a slot for each process that it runs at a time. It has one process more, for new jobs and regions (workers.spare).

Slots are locks that the kernel keeps for a process, so that one that dies leaves its slot.
"""

from __future__ import annotations

import fcntl
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager


class Slots:
    """Holds the slots of the processes that are forked from this one. A process takes at most one.

    Args:
        count: how many processes work at a time.
    """

    def __init__(self, count: int) -> None:
        self._file, self._count = tempfile.TemporaryFile(), count  # noqa: SIM115 - it lives as long as the process
        self._mine: int | None = None

    @contextmanager
    def one(self) -> Iterator[bool]:
        """Takes a slot for the block, if one is free, and says whether the block has one. It is left after the block in any case."""
        try:
            yield self.take()
        finally:
            self._leave()

    def take(self) -> bool:
        """Takes a free slot, unless this process has one, and says whether it has one now."""
        for number in range(self._count):
            if self._mine is not None:
                break
            try:
                fcntl.lockf(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, number)
            except (BlockingIOError, PermissionError):
                continue
            self._mine = number
        return self._mine is not None

    def _leave(self) -> None:
        if self._mine is not None:
            fcntl.lockf(self._file, fcntl.LOCK_UN, 1, self._mine)
            self._mine = None
