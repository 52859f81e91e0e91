"""This module says whether the disk of an SQLite database has room, and tells errors for want of room from others.

While it has none, nothing new is begun: the API takes no scenes and jobs, and the workers claim nothing. What is under way is saved in
the room that is kept for it, or as soon as there is room again. PostgreSQL's disk belongs to its own server, and only its errors tell.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

RESERVE_BYTES = 32 * 2**20
"""With less room than this nothing new is begun. What is under way is saved in it, and deleting needs some of it too."""
LOOK_SECONDS = 1.0
"""A look at the disk is believed for this many seconds."""
_POSTGRESQL_FULL = "53100"


class Disk:
    """Holds the directory of a database, and what the last look at its disk has told.

    Args:
        directory: None for a database whose disk cannot be looked at from here.
    """

    def __init__(self, directory: Path | None) -> None:
        self._directory = directory
        self._until, self._told = 0.0, ""

    def trouble(self) -> str:
        """Returns why nothing new is to be stored, and what to do; empty where there is room. Many may ask, and few look."""
        if self._directory is not None and time.monotonic() >= self._until:
            self._told = _look(self._directory)
            self._until = time.monotonic() + LOOK_SECONDS
        return self._told


def _look(directory: Path) -> str:
    try:
        found = os.statvfs(directory)
        free = found.f_bavail * found.f_frsize
        if free < RESERVE_BYTES:
            left = f"the disk of the data has {free / 2**20:.0f} MiB left, and work needs {RESERVE_BYTES // 2**20} MiB"
            return f"{left}; free some room there, and the service goes on by itself"
        # Quotas, and file systems that an error has made read-only, show when something is written, and not before.
        with tempfile.TemporaryFile(dir=directory, buffering=0) as probe:
            probe.write(b"\0")
    except OSError as error:
        return f"the disk of the data cannot be written ({error.strerror}); mend that, and the service goes on by itself"
    return ""


def lacks_room(error: BaseException) -> bool:
    """Says whether a database's error comes from a disk that is full, read-only or broken."""
    cause = getattr(error, "orig", None)
    sqlite = getattr(cause, "sqlite_errorname", None) or ""
    return sqlite.startswith(("SQLITE_FULL", "SQLITE_READONLY", "SQLITE_IOERR")) or getattr(cause, "sqlstate", None) == _POSTGRESQL_FULL
