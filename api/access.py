"""Who is asking and what they may do, and the database for those who may."""

from __future__ import annotations

import asyncio
import math
import time
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request, Security
from fastapi.security import HTTPBearer
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import cookie_parser

from certifier.errors import CirisError
from db import keys
from db.keys import Ring, Scope
from db.session import Database

COOKIE = "ciris_key"
KEYS_SECONDS = 1.0
"""How long what was read of the keys is believed."""
AGAIN_SECONDS = 0.1
"""Between two looks for keys that are not known yet, whoever and however many ask for them."""


@dataclass(frozen=True)
class Caller:
    """Who made a request; without a key where the service asks for none."""

    scope: Scope
    key_id: str | None = None
    name: str = "anybody"


class Keyring:
    """Tells callers by their keys, which are read from the database once in half of ``KEYS_SECONDS`` and not for every request.

    A key that was revoked is refused after that time at the latest; while the database answers, nobody waits for it. What strangers
    send is not kept, and makes nobody read more than once in ``AGAIN_SECONDS``.
    """

    def __init__(self, database: Database, *, open_without_keys: bool) -> None:
        self._database, self._open = database, open_without_keys
        self._ring = Ring({})
        self._read_at = -math.inf
        self._reading: asyncio.Future[None] | None = None

    async def caller(self, given: str | None) -> Caller | None:
        """The caller by the key that came with a request; None for those who may not come in by what is known."""
        ring = await self._as_of(time.monotonic() - KEYS_SECONDS)
        if self._read_at < time.monotonic() - KEYS_SECONDS / 2:
            self._read_soon()
        if given is not None:
            key = ring.check(given)
            return None if key is None else Caller(key.scope, key.id, key.name)
        return Caller(Scope.ADMIN) if self._open and not ring.keys else None

    async def newcomer(self, given: str | None) -> Caller | None:
        """The caller by a key that :meth:`caller` does not know, in case it has just been made."""
        if given is None or not self._ring.misses(given):
            return None
        await self._as_of(time.monotonic(), pause=AGAIN_SECONDS)
        return await self.caller(given)

    async def _as_of(self, moment: float, pause: float = 0.0) -> Ring:
        """The keys as they were at that moment or later. Of many who ask one reads, ``pause`` after the last reading; it fails for all."""
        while self._read_at < moment:
            await asyncio.shield(self._read_soon(pause))
        return self._ring

    def _read_soon(self, pause: float = 0.0) -> asyncio.Future[None]:
        """The reading under way, begun if there is none."""
        if self._reading is None:
            self._reading = asyncio.ensure_future(self._read_again(self._read_at + pause))
            self._reading.add_done_callback(lambda reading: reading.cancelled() or reading.exception())  # nobody may be waiting for it
        return self._reading

    async def _read_again(self, not_before: float) -> None:
        try:
            await asyncio.sleep(not_before - time.monotonic())
            began = time.monotonic()
            self._ring = await run_in_threadpool(self._read)
            self._read_at = began
        finally:
            self._reading = None

    def _read(self) -> Ring:
        with self._database.read() as session:
            return keys.ring(session)


def presented_key(headers: Headers) -> str | None:
    """The key that came with a request, in the Authorization header or else the cookie."""
    kind, _, value = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return value.strip()
    return cookie_parser(headers.get("cookie", "")).get(COOKIE)


class _Needs(HTTPBearer):
    """The dependency of a route that needs a scope: the caller that the guard has let in. What it inherits documents the key."""

    def __init__(self, scope: Scope) -> None:
        super().__init__(scheme_name="key", description="An API key. The service on loopback needs none until one is made.")
        self._scope = scope

    async def __call__(self, request: Request) -> Caller:  # type: ignore[override]
        """The caller, if the scope suffices.

        Raises:
            CirisError: scope_missing.
        """
        caller: Caller = request.state.caller
        if not caller.scope.includes(self._scope):
            problem = f"this needs a key of the scope {self._scope}; the key {caller.name!r} has {caller.scope}"
            raise CirisError("scope_missing", problem, field="Authorization")
        return caller


READ, SUBMIT, ADMIN = (Security(_Needs(scope), scopes=[scope.value]) for scope in Scope)
"""Dependencies of a route: the scope that it needs."""

Submitter = Annotated[Caller, SUBMIT]


async def _database(request: Request) -> Database:
    database: Database = request.app.state.database
    return database


Db = Annotated[Database, Depends(_database)]
