"""Some requests are answered by a child process: reading an uploaded scene, checking a proof, finding a motion. Their number is limited."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Any, TypeVar, TypeVarTuple

from anyio import CapacityLimiter, to_thread
from fastapi import Depends, Request

from certifier.errors import CirisError
from certifier.isolation.child import run_in_child
from certifier.model import Scene
from db.settings import settings

AT_ONCE = 2
"""At most this many run at once: each may take minutes and gigabytes. They never occupy the threads of other requests."""
WAITING = 16
MOTIONS, MOTION_SECONDS = "planner.sampling.child", 60.0
"""What answers questions about motions, and how long it may take."""

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


def about_motions(function: str, scene: Scene, payload: dict[str, Any]) -> Any:
    """Returns what a function of the process that knows about motions says of a scene.

    Raises:
        CirisError: the function's own error, or what befell the process.
    """
    memory, kept = settings().child_memory_bytes, (scene.hash, _document(scene))
    return run_in_child(f"{MOTIONS}:{function}", payload, timeout_s=MOTION_SECONDS, memory_bytes=memory, kept=kept, fork=False)


@lru_cache(maxsize=4)
def _document(scene: Scene) -> str:
    return json.dumps(scene.to_document())


async def _limiter(request: Request) -> ChildLimiter:
    limiter: ChildLimiter = request.app.state.children
    return limiter


Children = Annotated[ChildLimiter, Depends(_limiter)]
