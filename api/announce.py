"""Telling the control worker of jobs: one message after the other, so that a Redis that is slow or away takes no threads of requests."""

from __future__ import annotations

from typing import Annotated

from anyio import CapacityLimiter, to_thread
from fastapi import Depends, Request

from workers.app import send_coordinate

WAITING = 1000
"""Messages that may wait; the sweeper sends what is dropped."""


class Announcer:
    """Sends messages after the answers that they follow from."""

    def __init__(self) -> None:
        self._limiter = CapacityLimiter(1)

    async def announce(self, job_id: str) -> None:
        """Asks for a coordination of the job."""
        if self._limiter.statistics().tasks_waiting < WAITING:
            await to_thread.run_sync(send_coordinate, job_id, limiter=self._limiter)


async def _announcer(request: Request) -> Announcer:
    announcer: Announcer = request.app.state.announcer
    return announcer


Announcements = Annotated[Announcer, Depends(_announcer)]
