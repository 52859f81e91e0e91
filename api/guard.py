"""The guard stands before all routes: it checks where a request comes from, its length, its encoding and its key, and how often the
caller asks.

The service on the loopback interface has no keys unless somebody makes one. So a web page that the user's browser shows must not
be able to talk to the service, in either of two ways: under a name of its own that resolves to this machine, or with a form that
is sent across sites. A caller without a key is refused before the body of the request is read.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from http import HTTPStatus
from ipaddress import ip_address, ip_network

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.access import Caller, Keyring, presented
from api.limits import Buckets
from api.oidc import CALLBACK
from certifier.errors import CirisError
from db.session import UNAVAILABLE

BODY_BYTES = 16 * 2**20
"""The largest body of a request, in bytes, for every route but uploads. The largest valid request is smaller."""
UPLOAD_BYTES = 64 * 2**20
UPLOADS = "/v1/scenes"
HELD_BYTES = 4 * BODY_BYTES
"""The bodies of a project's requests that are read and answered at the same time have at most this many bytes. Uploads lie on the disk."""
URL_BYTES = 32 * 2**10
HEALTH = frozenset({"/healthz", "/readyz"})
PUBLIC = HEALTH | {"/login", "/login/oidc", CALLBACK, "/login/project", "/logout"}
SAME_SITE = frozenset({"same-origin", "none"})
"""A browser says so of requests that come from the service's own pages, or from the person: by a bookmark or the address line."""
STATIC = "/static/"
SIGN_INS_PER_SECOND = 5.0
"""One address may return from the identity provider this often, on average. At each return, the service asks the provider."""
OF_PROJECT = 2.0
"""All keys and people of a project together may make that many times as many requests as one of them."""
WATCHED = frozenset({"/metrics"})
"""Monitoring asks for these. They are answered while the database hangs."""


class TooManyRequests(CirisError):
    """The caller, or its project, has sent too many requests and must wait."""

    def __init__(self, seconds: float, who: str = "caller") -> None:
        super().__init__("too_many_requests", f"more requests than one {who} may make", hint="wait as long as Retry-After says")
        self.headers = {"Retry-After": str(math.ceil(seconds))}


class KeyNeeded(CirisError):
    """The caller has no key and no session, or one that is not valid."""

    def __init__(self, headers: Headers) -> None:
        wrong = "this is not a valid API key" if "authorization" in headers else "this session has ended, or works in no project; sign in"
        message = "this service needs an API key" if presented(headers) is None else wrong
        super().__init__("key_needed", message, field="Authorization", hint="send `Authorization: Bearer KEY`; `ciris key add` makes one")
        self.headers = {"WWW-Authenticate": "Bearer"}


class Guard:
    """The guard is an ASGI middleware. It passes a request on, or answers it with an error.

    Args:
        hosts: names under which the service may be called; None for any.
        rate: requests a second that one key or person, or one address without a key, may make for long.
        respond: makes the response for an error.
    """

    def __init__(
        self, app: ASGIApp, keyring: Keyring, hosts: frozenset[str] | None, rate: float, respond: Callable[[Request, Exception], Response]
    ) -> None:
        self._app, self._keyring, self._hosts, self._respond = app, keyring, hosts, respond
        self._keys, self._addresses, self._sign_ins = Buckets(rate), Buckets(rate), Buckets(SIGN_INS_PER_SECOND)
        self._projects = Buckets(OF_PROJECT * rate)
        self._held = Counter[str | None]()
        """Maps a project to the number of bytes of the bodies that are held for it."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        upload = scope["path"] == UPLOADS
        limit = UPLOAD_BYTES if upload else BODY_BYTES
        try:
            _check_url(scope)
            self._check_origin(scope["method"], headers)
            _check_length(headers, limit)
            _check_encoding(headers)
            await self._check_caller(scope, headers)
        except (CirisError, *UNAVAILABLE) as error:
            await self._respond(Request(scope), error)(scope, receive, send)
            return
        caller: Caller | None = scope.get("state", {}).get("caller")
        project = None if caller is None else caller.project
        counted = _counted(receive, limit)
        with nullcontext(counted) if upload else _held(counted, self._held, project) as body:
            await self._app(scope, body, send)

    def _check_origin(self, method: str, headers: Headers) -> None:
        host = headers.get("host", "")
        if self._hosts is not None and _name(host) not in self._hosts:
            raise CirisError("unknown_host", f"this service is not {host!r}", field="Host", hint="call it by 127.0.0.1 or localhost")
        origin = headers.get("origin")
        if method in ("GET", "HEAD", "OPTIONS"):
            return
        foreign = origin is not None and origin.partition("://")[2] != host
        if foreign or headers.get("sec-fetch-site", "none") not in SAME_SITE:
            hint = "send them from the service's own pages, or from a program"
            raise CirisError("cross_site", f"requests from {origin or 'another site'} are not accepted", field="Origin", hint=hint)

    async def _check_caller(self, scope: Scope, headers: Headers) -> None:
        """Finds out who asks (``request.state.caller``), except on public paths, and counts the request.

        A caller with a valid key, or who has signed in, is counted by the key or the person, wherever the caller is. So others behind the
        same address cannot use up the caller's requests. All callers of a project are counted together, too. Everybody else is counted by
        address, before the guard does anything else for them; so is the first request of a key in this process. Health checks are not
        counted: who shares an address with them must not have the service ended.
        """
        if scope["path"] in HEALTH:
            return
        public = scope["path"] in PUBLIC or scope["path"].startswith(STATIC)
        given = None if public else presented(headers)
        caller = None if public else await self._keyring.caller(given, patient=scope["path"] not in WATCHED)
        id = caller and caller.id
        wait = self._keys.take(id) if id else self._addresses.take(_network(scope))
        if wait == 0 and scope["path"] == CALLBACK:
            wait = self._sign_ins.take(_network(scope))
        if wait > 0:
            raise TooManyRequests(wait)
        if caller is None and not public:
            caller = await self._keyring.newcomer(given)
            if caller is None:
                raise KeyNeeded(headers)
        if caller is not None and caller.id and (wait := self._projects.take(caller.project)) > 0:
            raise TooManyRequests(wait, "project")
        scope.setdefault("state", {})["caller"] = caller


def _network(scope: Scope) -> str:
    """Returns where a request comes from: its IPv4 address, or the /64 network of its IPv6 address.

    A caller with one IPv6 address has all addresses of its network.
    """
    address = str(scope["client"][0]) if scope.get("client") else ""
    try:
        ip = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    return str(ip if ip.version == 4 else ip.ipv4_mapped or ip_network((ip, 64), strict=False))


def _name(host: str) -> str:
    """Returns the host without its port and brackets."""
    name = host.rpartition(":")[0] if ":" in host and not host.endswith("]") else host
    return name.strip("[]")


def _check_url(scope: Scope) -> None:
    """Refuses an address that is longer than any that is asked for, and a zero byte in it: no database can look it up."""
    if len(scope["path"]) + len(scope["query_string"]) > URL_BYTES:
        problem = f"the address has more than {URL_BYTES // 2**10} KiB"
        raise CirisError("too_large", problem, field="url", hint="ask for less at a time")
    if "\0" in scope["path"] or b"%00" in scope["query_string"]:
        raise CirisError("invalid_request", "the address holds a zero byte", field="url", hint="leave it out")


def _too_large(limit: int) -> str:
    return f"the request has more than {limit // 2**20} MiB"


def _check_length(headers: Headers, limit: int) -> None:
    length = headers.get("content-length", "")
    if length.isdigit() and int(length) > limit:
        raise CirisError("too_large", _too_large(limit), field="body", hint="send less")


def _check_encoding(headers: Headers) -> None:
    """Refuses a body that is said to be compressed: a small one could become larger than any limit."""
    given = headers.get("content-encoding", "identity")
    if given.lower() != "identity":
        hint = "send it as it is, without Content-Encoding"
        raise CirisError("content_encoding", f"the service does not unpack bodies in {given!a}", field="Content-Encoding", hint=hint)


def _counted(receive: Receive, limit: int) -> Receive:
    """Returns a ``receive`` that stops when the body becomes longer than the limit, whatever length was announced.

    It raises an HTTPException, because FastAPI takes every other error that occurs while it reads a body for a body that cannot be parsed.
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


@contextmanager
def _held(receive: Receive, held: Counter[str | None], project: str | None) -> Iterator[Receive]:
    """Makes a ``receive`` that stops, with an HTTPException, when too much is held for the project. Nothing of it is held afterwards.

    Args:
        held: maps a project to the number of bytes of the bodies that are held for it.
    """
    received = 0

    async def counted() -> Message:
        nonlocal received
        message = await receive()
        size = len(message.get("body", b""))
        received += size
        held[project] += size
        if held[project] > HELD_BYTES:
            problem = f"requests with {HELD_BYTES // 2**20} MiB are being answered already"
            hint = "send fewer at a time"
            raise HTTPException(HTTPStatus.SERVICE_UNAVAILABLE) from CirisError("busy", problem, field="body", hint=hint)
        return message

    try:
        yield counted
    finally:
        held[project] -= received
        if not held[project]:
            del held[project]
