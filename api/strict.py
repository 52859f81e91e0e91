"""The bodies of requests are read strictly: JSON's reader would take the last of two values with one key, without a word."""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

from certifier.errors import CirisError


class StrictRoute(APIRoute):
    """Use it as ``APIRouter(route_class=...)``. It refuses JSON in which an object has a key twice."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        answer = super().get_route_handler()

        async def strict(request: Request) -> Response:
            try:
                return await answer(_Strict(request.scope, request.receive))
            except HTTPException as error:
                if isinstance(error.__cause__, CirisError):  # which FastAPI takes for a body that cannot be parsed
                    raise error.__cause__ from None
                raise

        return strict


class _Strict(Request):
    async def json(self) -> Any:
        return json.loads(await self.body(), object_pairs_hook=_unique)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        problem = f"an object has the key {twice!a} twice"
        raise CirisError("invalid_request", problem, field="body", hint="leave one of them out")
    return found
