"""Some requests are answered by a child process: reading an uploaded scene, checking a proof, finding a motion. Their number is limited."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, TypeVar, TypeVarTuple

from anyio import CapacityLimiter, Semaphore, to_thread
from fastapi import Depends, Request

from certifier.errors import CirisError
from certifier.isolation.child import run_in_child
from certifier.model import Scene
from db.settings import settings

AT_ONCE, OF_PROJECT = 3, 2
"""At most this many run at once: each may take minutes and gigabytes. They never occupy the threads of other requests. A project has fewer
places than there are, so that another one need not wait for it.
"""
WAITING, OF_PROJECT_WAITING = 32, 16
MOTIONS, MOTION_SECONDS = "planner.sampling.child", 60.0
"""What answers questions about motions, and how long it may take."""

Answer = TypeVar("Answer")
Arguments = TypeVarTuple("Arguments")


class ChildLimiter:
    """Lets ``AT_ONCE`` requests of this kind run at once, ``OF_PROJECT`` of one project, and a limited number wait."""

    def __init__(self) -> None:
        self._limiter = CapacityLimiter(AT_ONCE)
        self._asked = Counter[str]()
        """Maps a project to the number of its requests that run or wait."""
        self._projects: dict[str, Semaphore] = {}

    async def run(self, project: str, function: Callable[[*Arguments], Answer], *arguments: *Arguments) -> Answer:
        """Runs ``function(*arguments)`` in a thread when its turn comes, and returns the result.

        Raises:
            CirisError: busy, when too many requests wait already.
        """
        if self._asked[project] >= OF_PROJECT + OF_PROJECT_WAITING or self._asked.total() >= AT_ONCE + WAITING:
            raise CirisError("busy", "too many requests of this kind wait already", hint="try again in a while")
        self._asked[project] += 1
        try:
            async with self._projects.setdefault(project, Semaphore(OF_PROJECT)):
                return await to_thread.run_sync(function, *arguments, limiter=self._limiter)
        finally:
            self._asked[project] -= 1
            if not self._asked[project]:
                del self._asked[project], self._projects[project]


@dataclass(frozen=True)
class Places:
    """The places of one caller's project among all."""

    limiter: ChildLimiter
    project: str

    async def run(self, function: Callable[[*Arguments], Answer], *arguments: *Arguments) -> Answer:
        """As :meth:`ChildLimiter.run`."""
        return await self.limiter.run(self.project, function, *arguments)


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


async def _places(request: Request) -> Places:
    return Places(request.app.state.children, request.state.caller.project)


Children = Annotated[Places, Depends(_places)]
