"""The bodies of requests are read strictly, and large ones by turns.

JSON's usual reader would take the last of two values with one key, without a word. While it reads, no other thread of the process
runs, so it must not read for long: a body may have no more values than any request needs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Coroutine
from functools import partial
from http import HTTPStatus
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from jiter import from_json
from starlette.exceptions import HTTPException

from api.turns import Turns
from certifier.errors import CirisError

MOST = {b",": 200_000, b":": 20_000, b"[": 50_000, b"{": 20_000}
"""A body has at most this many of each: values, keys, lists and objects, and those signs in texts. Requests with the most values have
10 000 points of 20 joints, or a hundred jobs of 2000 numbers.
"""
SMALL = 128 * 2**10
"""Bodies of at most this many bytes are read at once, in some milliseconds at most."""
_threads = Turns("bodies", 1, 1)


class StrictRoute(APIRoute):
    """Use it as ``APIRouter(route_class=...)``. It refuses JSON in which an object has a key twice, or that is too large to read."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        answer = super().get_route_handler()

        async def strict(request: Request) -> Response:
            return await answer(_Strict(request.scope, request.receive))

        return strict


class _Strict(Request):
    async def json(self) -> Any:
        body = await self.body()
        if len(body) <= SMALL:
            return _read(body)
        return await _threads.run(self.state.caller.project, partial(_read, body))


def _read(body: bytes) -> Any:
    """Returns what the JSON says.

    Raises:
        HTTPException: from the error to answer with. FastAPI takes every other error for a body that cannot be parsed.
    """
    if any(body.count(sign) > most for sign, most in MOST.items()):
        hint = "send it in parts"
        raise HTTPException(HTTPStatus.BAD_REQUEST) from CirisError(
            "too_large", "the body has more values, keys or lists than any request needs", field="body", hint=hint
        )
    try:
        return from_json(body, catch_duplicate_keys=True)
    except ValueError as error:
        raise HTTPException(HTTPStatus.BAD_REQUEST) from _explained(str(error))


def _explained(said: str) -> CirisError:
    """Returns the error for what the reader of JSON says."""
    if twice := re.match('Detected duplicate key (".*") at line', said, re.DOTALL):
        return CirisError("invalid_request", f"an object has the key {twice[1]} twice", field="body", hint="leave one of them out")
    return CirisError("malformed_json", f"the body is not JSON: {said}", field="body", hint="/openapi.json describes every request")
