"""Questions about many points take long, so they wait for each other, and not in the way of those about few."""

from __future__ import annotations

from collections import Counter
from collections.abc import Awaitable, Callable
from functools import partial, wraps
from typing import Any, TypeVar

from pydantic import BaseModel

from api.turns import Turns
from certifier.errors import CirisError

SMALL, LARGE = 2, 1
"""Number of threads that answer small questions, and large ones. Each takes a connection to the database while it reads."""
WAITING, OF_PROJECT_WAITING = 20, 10
"""Number of large questions that may wait in one process: of all projects, and of one."""

Answer = TypeVar("Answer")
_small, _large = Turns("small-questions", SMALL, SMALL), Turns("large-questions", LARGE, LARGE)
_asked = Counter[str | None]()
"""Maps a project to the number of its large questions that are answered or wait."""


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
            project, answer = getattr(options.get("db"), "project", None), partial(endpoint, body, **options)
            if _size(body) <= few:
                return await _small.run(project, answer)
            if _asked.total() > WAITING or _asked[project] > OF_PROJECT_WAITING:
                raise CirisError(
                    "busy", "too many large questions wait already", hint=f"try again in a while, or ask about {few} at a time"
                )
            _asked[project] += 1
            try:
                return await _large.run(project, answer)
            finally:
                _asked[project] -= 1
                if not _asked[project]:
                    del _asked[project]

        return ask

    return route


def _size(body: BaseModel) -> int:
    return sum(len(value) for name, value in body if name in ("q", "s", "bezier", "control_points") and value is not None)
