"""Routes that change something may wait long for their turn to write, so they wait in threads of their own.

On SQLite one process writes at a time, and a writer waits for up to half a minute. A request that only reads must not wait behind it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from functools import partial, wraps
from typing import ParamSpec, TypeVar

from certifier.errors import CirisError

WRITERS = 2
"""This many threads answer routes that write."""
WAITING = 200
"""Number of requests that may wait for them."""

Given = ParamSpec("Given")
Answer = TypeVar("Answer")
_threads = ThreadPoolExecutor(WRITERS, "write")
_waiting: set[object] = set()


def writing(endpoint: Callable[Given, Answer]) -> Callable[Given, Awaitable[Answer]]:
    """Makes a route of a function that writes.

    Raises:
        CirisError: busy, when too many requests wait already.
    """

    @wraps(endpoint)
    async def change(*arguments: Given.args, **options: Given.kwargs) -> Answer:
        if len(_waiting) >= WRITERS + WAITING:
            raise CirisError("busy", "too many requests that change something wait already", hint="try again in a while")
        turn = object()
        _waiting.add(turn)
        try:
            asked = partial(copy_context().run, endpoint, *arguments, **options)
            return await asyncio.get_running_loop().run_in_executor(_threads, asked)
        finally:
            _waiting.discard(turn)

    return change
