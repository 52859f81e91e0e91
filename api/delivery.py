"""How answers travel, whatever route makes them: HEAD where there is GET, and what did not change is not sent again.

A route whose function is marked as :func:`unchanging` answers with an entity tag. A client that sends the tag back gets 304 without a body
as long as the answer is the same. It has to ask each time, because anything may be deleted and any key revoked.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from http import HTTPStatus
from typing import Any, TypeVar

from anyio import CancelScope
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

COMPRESSED_BYTES, COMPRESSION = 2048, 5
"""Answers of at least this many bytes are compressed, at this level of zlib."""
NOT_COMPRESSED = (*DEFAULT_EXCLUDED_CONTENT_TYPES, "application/octet-stream", "application/x-npz")
"""Proofs and arrays are zips already, and a stream of events must not be held back."""
KEPT = "private, no-cache"
"""The client may keep the answer, and asks whether it is still so before it uses it."""
_MARK = "_ciris_unchanging"

F = TypeVar("F", bound=Callable[..., Any])


def unchanging(function: F) -> F:
    """Marks the function of a route whose answers seldom or never change, and are asked for again."""
    setattr(function, _MARK, True)
    return function


class Head:
    """This ASGI middleware answers HEAD as GET, without the body. Every GET route has it."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return
        with CancelScope() as answering:

            async def without_body(message: Message) -> None:
                if message["type"] == "http.response.start":
                    await send(message)
                    await send({"type": "http.response.body", "body": b""})
                    answering.cancel()  # a stream of events would never end

            await self._app({**scope, "method": "GET"}, receive, without_body)


class Compressed(GZipMiddleware):
    """Compresses answers for those who take gzip, and lets nobody keep one for those who take another encoding.

    The base class looks for the word in the header, and does not see a weight of 0, which refuses it. It leaves answers without a body
    as they are, such as 304, which has to name what the whole answer depends on (RFC 9110, 15.4.5).
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            taken = b"gzip" if _takes_gzip(",".join(Headers(scope=scope).getlist("accept-encoding"))) else b"identity"
            others = [(name, value) for name, value in scope["headers"] if name != b"accept-encoding"]
            scope = {**scope, "headers": [*others, (b"accept-encoding", taken)]}

        async def varied(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] == HTTPStatus.NOT_MODIFIED:
                MutableHeaders(scope=message).add_vary_header("Accept-Encoding")
            await send(message)

        await super().__call__(scope, receive, varied)


def _takes_gzip(given: str) -> bool:
    """Says whether Accept-Encoding allows gzip: with a weight above 0, under its name or, where it is not named, as one of all others."""
    weights = {}
    for one in given.lower().split(","):
        name, _, parameter = (part.strip() for part in one.partition(";"))
        weights[name] = parameter.replace(" ", "").removeprefix("q=") if parameter else "1"
    weight = weights.get("gzip", weights.get("*", "0"))
    try:
        return float(weight) > 0
    except ValueError:
        return False


class Methods:
    """This ASGI middleware makes ``Allow`` of a 405 name every method of the address. The router names those of one of its routes.

    Who serves files is no route, and names its methods itself.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def complete(message: Message) -> None:
            refused = message["type"] == "http.response.start" and message["status"] == HTTPStatus.METHOD_NOT_ALLOWED
            if refused and (allowed := _allowed(scope)):
                MutableHeaders(scope=message)["Allow"] = ", ".join(sorted(allowed))
            await send(message)

        await self._app(scope, receive, complete)


def every(routes: Iterable[BaseRoute]) -> Iterator[Any]:
    """Returns the routes, and in the place of each router that FastAPI keeps among them its routes, with all that they got from it."""
    for route in routes:
        contexts = getattr(route, "effective_route_contexts", None)
        yield from [route] if contexts is None else contexts()


def _allowed(scope: Scope) -> set[str]:
    found: set[str] = set()
    for route in every(scope["app"].routes):
        if route.matches(scope)[0] != Match.NONE:
            found |= set(getattr(route, "methods", None) or ())
    return found | ({"HEAD"} if "GET" in found else set())


class Unchanged:
    """This ASGI middleware tags the answers of routes that are marked, and answers 304 to clients that have them.

    A route that knows a digest of what it sends may set ``ETag`` itself. Else the tag is made from the answer. It is a weak one: the
    same answer may travel compressed.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        start: Message | None = None

        async def tagged(message: Message) -> None:
            nonlocal start
            if message["type"] == "http.response.start" and message["status"] == HTTPStatus.OK and is_unchanging(scope.get("endpoint")):
                start = message
                return
            if start is None:
                await send(message)
                return
            headers = MutableHeaders(scope=start)
            tag = headers.setdefault("ETag", f'W/"{hashlib.sha256(message["body"]).hexdigest()[:32]}"')
            headers["Cache-Control"] = KEPT
            if _has(Headers(scope=scope).get("if-none-match", ""), tag):
                start["status"] = HTTPStatus.NOT_MODIFIED
                for name in ("Content-Length", "Content-Type", "Content-Disposition"):
                    del headers[name]
                message = {**message, "body": b""}
            await send(start)
            start = None
            await send(message)

        await self._app(scope, receive, tagged)


def is_unchanging(endpoint: object) -> bool:
    """Says whether the function of a route is marked as :func:`unchanging`."""
    return getattr(endpoint, _MARK, False)


def _has(given: str, tag: str) -> bool:
    """Says whether If-None-Match names the tag. Whether a tag is weak does not count there (RFC 9110, 13.1.2)."""
    known = {one.strip().removeprefix("W/") for one in given.split(",")}
    return given.strip() == "*" or tag.removeprefix("W/") in known
