"""What stands before the routes: limits on the size of bodies (FastAPI's own answers no problem+json), no visits from other web sites.

The service has no keys on the loopback interface, so a page that the user's browser happens to show must not be able to talk
to it: neither under a name of its own that resolves to this machine, nor by sending forms across sites.
"""

from __future__ import annotations

from http import HTTPStatus

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api import problems
from certifier.errors import CirisError

MAX_BODY_BYTES = 64 * 2**20
LOOPBACK_NAMES = frozenset({"127.0.0.1", "localhost", "::1"})


class Guard:
    """ASGI middleware: refuses bodies of more than ``MAX_BODY_BYTES``, cross-site changes, and hosts that are not allowed.

    Args:
        hosts: names under which the service may be called; None for any.
    """

    def __init__(self, app: ASGIApp, hosts: frozenset[str] | None) -> None:
        self._app, self._hosts = app, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        try:
            self._check_origin(scope["method"], headers)
            _check_length(headers)
        except CirisError as error:
            await problems.as_json(problems.problem_of(error))(scope, receive, send)
            return
        await self._app(scope, _counted(receive), send)

    def _check_origin(self, method: str, headers: Headers) -> None:
        host = headers.get("host", "")
        if self._hosts is not None and _name(host) not in self._hosts:
            raise CirisError("unknown_host", f"this service is not {host!r}", field="Host", hint="call it by 127.0.0.1 or localhost")
        origin = headers.get("origin")
        if method not in ("GET", "HEAD", "OPTIONS") and origin is not None and origin.partition("://")[2] != host:
            raise CirisError("cross_site", f"requests from {origin} are not accepted", field="Origin")


def _name(host: str) -> str:
    """The host without its port and brackets."""
    name = host.rpartition(":")[0] if ":" in host and not host.endswith("]") else host
    return name.strip("[]")


def _too_large() -> str:
    return f"the request has more than {MAX_BODY_BYTES // 2**20} MiB"


def _check_length(headers: Headers) -> None:
    length = headers.get("content-length", "")
    if length.isdigit() and int(length) > MAX_BODY_BYTES:
        raise CirisError("too_large", _too_large())


def _counted(receive: Receive) -> Receive:
    """``receive`` that refuses to go on once too much came, whatever length was announced.

    It does so by an HTTPException: FastAPI takes any other error while it reads a body for a body that cannot be parsed.
    """
    received = 0

    async def counted() -> Message:
        nonlocal received
        message = await receive()
        received += len(message.get("body", b""))
        if received > MAX_BODY_BYTES:
            raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _too_large())
        return message

    return counted
