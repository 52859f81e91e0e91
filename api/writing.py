"""Routes that change something may wait long for their turn to write, so they wait in threads of their own.

On SQLite one process writes at a time, and a writer waits for up to half a minute. A request that only reads must not wait behind it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Awaitable, Callable
from contextvars import copy_context
from functools import partial, wraps
from typing import ParamSpec, TypeVar

from api.turns import Turns
from certifier.errors import CirisError

WRITERS = 2
"""This many threads answer routes that write."""
WAITING, OF_PROJECT_WAITING = 200, 100
"""Number of requests that may wait for them: of all projects, and of one."""

Given = ParamSpec("Given")
Answer = TypeVar("Answer")
_threads = Turns("write", WRITERS, WRITERS)
_asked = Counter[str | None]()
"""Maps a project to the number of its requests that are answered or wait."""


def writing(endpoint: Callable[Given, Answer]) -> Callable[Given, Awaitable[Answer]]:
    """Makes a route of a function that writes.

    Raises:
        CirisError: busy, when too many requests wait already.
    """

    @wraps(endpoint)
    async def change(*arguments: Given.args, **options: Given.kwargs) -> Answer:
        project = getattr(options.get("db"), "project", None)
        if _asked.total() >= WRITERS + WAITING or _asked[project] >= WRITERS + OF_PROJECT_WAITING:
            raise CirisError("busy", "too many requests that change something wait already", hint="try again in a while")
        _asked[project] += 1
        try:
            return await _threads.run(project, partial(copy_context().run, endpoint, *arguments, **options))
        finally:
            _asked[project] -= 1
            if not _asked[project]:
                del _asked[project]

    return change
