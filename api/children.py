"""Some requests are answered by a child process: reading an uploaded scene, checking a proof. This module limits how many."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, TypeVar, TypeVarTuple

from anyio import CapacityLimiter, to_thread
from fastapi import Depends, Request

from certifier.errors import CirisError

AT_ONCE = 2
"""At most this many run at once: each may take minutes and gigabytes. They never occupy the threads of other requests."""
WAITING = 16

Answer = TypeVar("Answer")
Arguments = TypeVarTuple("Arguments")


class ChildLimiter:
    """Lets ``AT_ONCE`` requests of this kind run at once, and ``WAITING`` more wait."""

    def __init__(self) -> None:
        self._limiter = CapacityLimiter(AT_ONCE)

    async def run(self, function: Callable[[*Arguments], Answer], *arguments: *Arguments) -> Answer:
        """Runs ``function(*arguments)`` in a thread when its turn comes, and returns the result.

        Raises:
            CirisError: busy, when too many requests wait already.
        """
        if self._limiter.statistics().tasks_waiting >= WAITING:
            raise CirisError("busy", "too many requests of this kind wait already", hint="try again in a while")
        return await to_thread.run_sync(function, *arguments, limiter=self._limiter)


async def _limiter(request: Request) -> ChildLimiter:
    limiter: ChildLimiter = request.app.state.children
    return limiter


Children = Annotated[ChildLimiter, Depends(_limiter)]
