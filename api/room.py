"""A project has a limit of bytes to store, and all projects together the room on the disk.

Each API process counts the bytes of projects now and then, and refuses more scenes and jobs when there is no room.
"""

from __future__ import annotations

import time
from typing import Annotated

from fastapi import Depends, Request

from certifier.errors import CirisError
from db import projects, retention
from db.session import Database

COUNT_SECONDS, COST = 10.0, 10.0
"""A count is believed for COUNT_SECONDS, or for COST times as long as it took where that is longer."""


class Room:
    """Knows how much room projects have. What a job under way stores is counted, but never refused."""

    def __init__(self) -> None:
        self._counted: dict[str, tuple[float, int]] = {}

    def stored(self, db: Database, project: str) -> int:
        """Returns how many bytes a project stores, as of a short while ago."""
        until, size = self._counted.get(project, (0.0, 0))
        began = time.monotonic()
        if began >= until:
            with db.read() as session:
                size = retention.stored(session, project)
            now = time.monotonic()
            self._counted[project] = now + max(COUNT_SECONDS, COST * (now - began)), size
        return size

    def check(self, db: Database, project: str) -> None:
        """Refuses to store more where a project has reached its limit, or the disk.

        Raises:
            CirisError: storage_quota, no_room.
        """
        if trouble := db.disk.trouble():
            raise CirisError("no_room", f"nothing new is stored now: {trouble}", hint="try again later, or delete what is not needed")
        with db.read() as session:
            most = projects.get(session, project).max_bytes
        if most is not None and self.stored(db, project) >= most:
            problem = f"the project {project} stores as many bytes as it may, {most}"
            raise CirisError("storage_quota", problem, hint="delete jobs, regions or scenes, or have the limit raised: `ciris project set`")


async def _room(request: Request) -> Room:
    room: Room = request.app.state.room
    return room


KeptRoom = Annotated[Room, Depends(_room)]
