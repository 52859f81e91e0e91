"""The service's fixtures; and ``service``, the Python client of either kind, which a test uses in the same words."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Iterator
from typing import Any

import pytest

import ciris
from tests.api.conftest import certified, client, database, environment, planar, planar_region, region, running, scene, url, worker

__all__ = ["certified", "client", "database", "environment", "planar", "planar_region", "region", "running", "scene", "url", "worker"]


class Awaited:
    """An object of the asynchronous client whose methods a test may call as those of the synchronous one: each is awaited here."""

    def __init__(self, one: Any, loop: asyncio.AbstractEventLoop) -> None:
        self._one, self._loop = one, loop

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._one, name)
        return self._called(found) if inspect.ismethod(found) else self._wrapped(found)

    def __repr__(self) -> str:
        return repr(self._one)

    def _called(self, method: Any) -> Any:
        def call(*arguments: Any, **options: Any) -> Any:
            answer = method(*arguments, **options)
            if inspect.isasyncgen(answer):
                return self._loop.run_until_complete(_all(answer))
            return self._wrapped(self._loop.run_until_complete(answer) if inspect.isawaitable(answer) else answer)

        return call

    def _wrapped(self, found: Any) -> Any:
        if isinstance(found, list):
            return [self._wrapped(one) for one in found]
        return Awaited(found, self._loop) if isinstance(found, ciris.AsyncJob | ciris.AsyncRegion) else found


async def _all(answers: Any) -> list[Any]:
    return [answer async for answer in answers]


@pytest.fixture(params=["synchronous", "asynchronous"])
def service(request: pytest.FixtureRequest, url: str) -> Iterator[Any]:
    if request.param == "synchronous":
        with ciris.connect(url) as service:
            yield service
        return
    loop = asyncio.new_event_loop()
    waiting = ciris.connect_async(url)
    yield Awaited(waiting, loop)
    loop.run_until_complete(waiting.aclose())
    loop.close()
