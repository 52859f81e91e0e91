"""Questions about many points take long, so they wait for each other, and not in the way of those about few."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial, wraps
from typing import Any, TypeVar

from pydantic import BaseModel

from certifier.errors import CirisError

SMALL, LARGE = 2, 1
"""Number of threads that answer small questions, and large ones. Each takes a connection to the database while it reads."""
WAITING = 20
"""Number of large questions that may wait in one process."""

Answer = TypeVar("Answer")
_small, _large = ThreadPoolExecutor(SMALL, "small-questions"), ThreadPoolExecutor(LARGE, "large-questions")
_waiting: set[object] = set()


def asking(few: int) -> Callable[[Callable[..., Answer]], Callable[..., Awaitable[Answer]]]:
    """Makes a route of a function that answers a question. One large question is answered at a time, beside small ones.

    Args:
        few: a question about more points, motions, waypoints or pieces than this is large.

    Raises:
        CirisError: busy, when too many large questions wait already.
    """

    def route(endpoint: Callable[..., Answer]) -> Callable[..., Awaitable[Answer]]:
        @wraps(endpoint)
        async def ask(body: BaseModel, **options: Any) -> Answer:
            loop, answer = asyncio.get_running_loop(), partial(endpoint, body, **options)
            if _size(body) <= few:
                return await loop.run_in_executor(_small, answer)
            if len(_waiting) > WAITING:
                raise CirisError(
                    "busy", "too many large questions wait already", hint=f"try again in a while, or ask about {few} at a time"
                )
            turn = object()
            _waiting.add(turn)
            try:
                return await loop.run_in_executor(_large, answer)
            finally:
                _waiting.discard(turn)

        return ask

    return route


def _size(body: BaseModel) -> int:
    return sum(len(value) for name, value in body if name in ("q", "s", "bezier", "control_points") and value is not None)
