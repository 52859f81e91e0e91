"""What stands before the routes: no visits from other web sites, bodies of limited size, a key where one is needed, a limited rate.

The service has no keys on the loopback interface unless somebody makes one, so a page that the user's browser happens to show must
not be able to talk to it: neither under a name of its own that resolves to this machine, nor by sending forms across sites.
Whoever has no key is turned away before the body of the request is read.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from http import HTTPStatus
from ipaddress import ip_address, ip_network

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.access import Keyring, presented_key
from api.limits import Buckets
from certifier.errors import CirisError
from db.session import UNAVAILABLE

BODY_BYTES = 16 * 2**20
"""More than the largest request of every route but uploads."""
UPLOAD_BYTES = 64 * 2**20
UPLOADS = "/v1/scenes"
PUBLIC = frozenset({"/healthz", "/readyz", "/login", "/logout"})
STATIC = "/static/"


class TooManyRequests(CirisError):
    """The caller is to wait."""

    def __init__(self, seconds: float) -> None:
        super().__init__("too_many_requests", "more requests than one caller may make", hint="wait as long as Retry-After says")
        self.headers = {"Retry-After": str(math.ceil(seconds))}


class KeyNeeded(CirisError):
    """The caller has no key, or one that is not valid."""

    def __init__(self, given: str | None) -> None:
        message = "this service needs an API key" if given is None else "this is not a valid API key"
        super().__init__("key_needed", message, field="Authorization", hint="send `Authorization: Bearer KEY`; `ciris key add` makes one")
        self.headers = {"WWW-Authenticate": "Bearer"}


class Guard:
    """ASGI middleware.

    Args:
        hosts: names under which the service may be called; None for any.
        respond: the response for an error.
    """

    def __init__(
        self, app: ASGIApp, keyring: Keyring, hosts: frozenset[str] | None, rate: float, respond: Callable[[Request, Exception], Response]
    ) -> None:
        self._app, self._keyring, self._hosts, self._respond = app, keyring, hosts, respond
        self._keys, self._addresses = Buckets(rate), Buckets(rate)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        limit = UPLOAD_BYTES if scope["path"] == UPLOADS else BODY_BYTES
        try:
            _check_url(scope)
            self._check_origin(scope["method"], headers)
            _check_length(headers, limit)
            await self._check_caller(scope, headers)
        except (CirisError, *UNAVAILABLE) as error:
            await self._respond(Request(scope), error)(scope, receive, send)
            return
        await self._app(scope, _counted(receive, limit), send)

    def _check_origin(self, method: str, headers: Headers) -> None:
        host = headers.get("host", "")
        if self._hosts is not None and _name(host) not in self._hosts:
            raise CirisError("unknown_host", f"this service is not {host!r}", field="Host", hint="call it by 127.0.0.1 or localhost")
        origin = headers.get("origin")
        if method not in ("GET", "HEAD", "OPTIONS") and origin is not None and origin.partition("://")[2] != host:
            raise CirisError("cross_site", f"requests from {origin} are not accepted", field="Origin")

    async def _check_caller(self, scope: Scope, headers: Headers) -> None:
        """Finds out who asks (``request.state.caller``), unless anybody may, and counts the request.

        Who has a valid key is counted by it, wherever they are, so that nobody who shares their address can use up what they may ask.
        Everybody else is counted by address, before anything is done for them.
        """
        public = scope["path"] in PUBLIC or scope["path"].startswith(STATIC)
        given = None if public else presented_key(headers)
        caller = None if public else await self._keyring.caller(given)
        key_id = caller and caller.key_id
        wait = self._keys.take(key_id) if key_id else self._addresses.take(_network(scope))
        if wait > 0:
            raise TooManyRequests(wait)
        if caller is None and not public:
            caller = await self._keyring.newcomer(given)
            if caller is None:
                raise KeyNeeded(given)
        scope.setdefault("state", {})["caller"] = caller


def _network(scope: Scope) -> str:
    """Where a request comes from: its address, or the network of an IPv6 one, since who has one of those has all of its network's."""
    address = str(scope["client"][0]) if scope.get("client") else ""
    try:
        ip = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    return str(ip if ip.version == 4 else ip.ipv4_mapped or ip_network((ip, 64), strict=False))


def _name(host: str) -> str:
    """The host without its port and brackets."""
    name = host.rpartition(":")[0] if ":" in host and not host.endswith("]") else host
    return name.strip("[]")


def _check_url(scope: Scope) -> None:
    """Refuses what no database can look up."""
    if "\0" in scope["path"] or b"%00" in scope["query_string"]:
        raise CirisError("invalid_request", "the address holds a zero byte")


def _too_large(limit: int) -> str:
    return f"the request has more than {limit // 2**20} MiB"


def _check_length(headers: Headers, limit: int) -> None:
    length = headers.get("content-length", "")
    if length.isdigit() and int(length) > limit:
        raise CirisError("too_large", _too_large(limit))


def _counted(receive: Receive, limit: int) -> Receive:
    """``receive`` that refuses to go on once too much came, whatever length was announced.

    It does so by an HTTPException: FastAPI takes any other error while it reads a body for a body that cannot be parsed.
    """
    received = 0

    async def counted() -> Message:
        nonlocal received
        message = await receive()
        received += len(message.get("body", b""))
        if received > limit:
            raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _too_large(limit))
        return message

    return counted
