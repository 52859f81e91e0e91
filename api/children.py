"""Requests that are answered by a child process: reading an upload, checking a proof."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, TypeVar, TypeVarTuple

from anyio import CapacityLimiter, to_thread
from fastapi import Depends, Request

from certifier.errors import CirisError

AT_ONCE = 2
"""Each may take minutes and gigabytes, and none may take the threads of other requests."""
WAITING = 16

Answer = TypeVar("Answer")
Arguments = TypeVarTuple("Arguments")


class ChildLimiter:
    """A few such requests at once, a few more that wait."""

    def __init__(self) -> None:
        self._limiter = CapacityLimiter(AT_ONCE)

    async def run(self, function: Callable[[*Arguments], Answer], *arguments: *Arguments) -> Answer:
        """``function(*arguments)`` in a thread, once it is its turn.

        Raises:
            CirisError: busy, when too many wait already.
        """
        if self._limiter.statistics().tasks_waiting >= WAITING:
            raise CirisError("busy", "too many requests of this kind wait already", hint="try again in a while")
        return await to_thread.run_sync(function, *arguments, limiter=self._limiter)


async def _limiter(request: Request) -> ChildLimiter:
    limiter: ChildLimiter = request.app.state.children
    return limiter


Children = Annotated[ChildLimiter, Depends(_limiter)]
