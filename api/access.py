"""This module finds out who sends a request and what the caller may do, and gives the routes the database."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Awaitable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request, Security
from fastapi.security import HTTPBearer
from sqlalchemy.exc import TimeoutError as DatabaseTimeoutError
from starlette.datastructures import Headers
from starlette.requests import cookie_parser

from certifier.errors import CirisError
from db import keys, version
from db.keys import Ring, Scope
from db.models import DEFAULT_PROJECT
from db.session import UNAVAILABLE, Database

COOKIE = "ciris_key"
KEYS_SECONDS = 1.0
"""The keys that were read from the database are trusted for this many seconds."""
PATIENCE_SECONDS = 0.3
"""A request of monitoring waits this many seconds for the keys."""
AGAIN_SECONDS = 0.1
"""When requests bring unknown keys, the database is read at most once in this many seconds, however many requests there are."""
_thread = ThreadPoolExecutor(1, "keys")
"""Every request may wait for the keys, so their reading waits for no other request."""


@dataclass(frozen=True)
class Caller:
    """A caller is the sender of a request. The caller has no key where the service asks for none."""

    scope: Scope
    project: str = DEFAULT_PROJECT
    key_id: str | None = None
    name: str = "anybody"

    def __str__(self) -> str:
        return self.name if self.key_id is None else f"{self.name} ({self.key_id})"


class Keyring:
    """A keyring recognises callers by their keys. It reads the keys about twice in ``KEYS_SECONDS``, not for every request.

    A revoked key is refused after ``KEYS_SECONDS`` at the latest. While the database answers, no request waits for a reading. What
    strangers send is not stored, and makes the keyring read the database at most once in ``AGAIN_SECONDS``.

    It does not read a database of another version: ``database_version`` refuses every caller until the database is of this one.
    """

    def __init__(self, database: Database, *, open_without_keys: bool) -> None:
        self._database, self._open = database, open_without_keys
        self._ring = Ring({})
        self._read_at = -math.inf
        self._reading: asyncio.Future[None] | None = None

    async def caller(self, given: str | None, *, patient: bool = True) -> Caller | None:
        """Returns the caller to whom the key of a request belongs; None when the keys known now do not let this caller in.

        Args:
            patient: False for a request that must be answered while the database hangs: the keys that were read last count then.

        Raises:
            sqlalchemy.exc.SQLAlchemyError: the keys cannot be read.
        """
        fresh = self._as_of(time.monotonic() - KEYS_SECONDS)
        ring = await (fresh if patient else self._soon(fresh))
        if self._read_at < time.monotonic() - KEYS_SECONDS / 2:
            self._read_soon()
        if given is not None:
            key = ring.check(given)
            return None if key is None else Caller(key.scope, key.project, key.id, key.name)
        return Caller(Scope.ADMIN) if self._open and not ring.keys else None

    async def newcomer(self, given: str | None) -> Caller | None:
        """Returns the caller of a key that :meth:`caller` does not know, which may have just been made; else None."""
        if given is None or not self._ring.misses(given):
            return None
        await self._as_of(time.monotonic(), pause=AGAIN_SECONDS)
        return await self.caller(given)

    async def _as_of(self, moment: float, pause: float = 0.0) -> Ring:
        """Returns the keys as they were at that moment or later.

        Of many requests that wait, one reads: ``pause`` seconds after the last reading began. If it fails, it fails for all of them.
        """
        while self._read_at < moment:
            await asyncio.shield(self._read_soon(pause))
        return self._ring

    async def _soon(self, reading: Awaitable[Ring]) -> Ring:
        """Returns the ring of the reading or, where it takes too long or fails, the last one that was read."""
        try:
            return await asyncio.wait_for(reading, PATIENCE_SECONDS)
        except (TimeoutError, *UNAVAILABLE):
            if self._read_at == -math.inf:
                raise DatabaseTimeoutError("the keys could not be read in time") from None
            return self._ring

    def _read_soon(self, pause: float = 0.0) -> asyncio.Future[None]:
        """Returns the reading that is under way, and starts one if there is none."""
        if self._reading is None:
            self._reading = asyncio.ensure_future(self._read_again(self._read_at + pause))
            # Looking at the error keeps asyncio from complaining about it when nobody waits for the reading.
            self._reading.add_done_callback(lambda reading: reading.cancelled() or reading.exception())
        return self._reading

    async def _read_again(self, not_before: float) -> None:
        try:
            await asyncio.sleep(not_before - time.monotonic())
            began = time.monotonic()
            self._ring = await asyncio.get_running_loop().run_in_executor(_thread, self._read)
            self._read_at = began
        finally:
            self._reading = None

    def _read(self) -> Ring:
        with self._database.read() as session:
            version.check(session)
            return keys.ring(session)


def presented_key(headers: Headers) -> str | None:
    """Returns the key that came with a request: that of the Authorization header, or else that of the cookie."""
    kind, _, value = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return value.strip()
    return cookie_parser(headers.get("cookie", "")).get(COOKIE)


class _Needs(HTTPBearer):
    """A route depends on this when it needs a scope. It returns the caller whom the guard has let in.

    The base class makes the OpenAPI document say that the route needs a key.
    """

    def __init__(self, scope: Scope) -> None:
        super().__init__(scheme_name="key", description="An API key. The service on loopback needs none until one is made.")
        self._scope = scope

    async def __call__(self, request: Request) -> Caller:  # type: ignore[override]
        """Returns the caller if the scope of its key suffices.

        Raises:
            CirisError: scope_missing.
        """
        caller: Caller = request.state.caller
        if not caller.scope.includes(self._scope):
            problem = f"this needs a key of the scope {self._scope}; the key {caller.name!r} has {caller.scope}"
            raise CirisError("scope_missing", problem, field="Authorization", hint=f"`ciris key add NAME --scope {self._scope}` makes one")
        return caller


READ, SUBMIT, ADMIN = (Security(_Needs(scope), scopes=[scope.value]) for scope in Scope)
"""A route depends on one of these to demand that scope."""

Reader = Annotated[Caller, READ]
Submitter = Annotated[Caller, SUBMIT]
Admin = Annotated[Caller, ADMIN]


async def _whole(request: Request) -> Database:
    database: Database = request.app.state.database
    return database


async def _own(request: Request) -> Database:
    database, caller = await _whole(request), request.state.caller
    return database.of(caller.project)


Db = Annotated[Database, Depends(_own)]
"""The database as the caller's project sees it."""
WholeDb = Annotated[Database, Depends(_whole)]
"""All of the database: for what is about the service, and for signing in."""
