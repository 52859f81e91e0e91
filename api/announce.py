"""The API tells the control worker about jobs, one message after the other.

So a Redis that is slow or away does not occupy the threads that answer requests.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from anyio import CapacityLimiter, to_thread
from fastapi import BackgroundTasks, Depends, Request

from workers.app import send_coordinate

WAITING = 1000
"""At most this many messages wait. The API drops the ones beyond, and the sweeper sends them later."""


class Announcer:
    """An announcer sends messages to the control worker. It sends each one after the route has answered."""

    def __init__(self) -> None:
        self._limiter = CapacityLimiter(1)

    async def announce(self, job_id: str) -> None:
        """Asks the control worker to coordinate the job."""
        if self._limiter.statistics().tasks_waiting < WAITING:
            await to_thread.run_sync(send_coordinate, job_id, limiter=self._limiter)


async def _announcing(request: Request, background: BackgroundTasks) -> Callable[[str], None]:
    announcer: Announcer = request.app.state.announcer
    return lambda job_id: background.add_task(announcer.announce, job_id)


Announce = Annotated[Callable[[str], None], Depends(_announcing)]
"""Has the job with this id announced, once the route has answered."""
