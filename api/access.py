"""Who is asking and what they may do, and the database for those who may."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request, Security
from fastapi.security import HTTPBearer, SecurityScopes
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import cookie_parser

from certifier.errors import CirisError
from db import keys
from db.keys import Ring, Scope
from db.session import Database

COOKIE = "ciris_key"
KEYS_SECONDS = 1.0
_BEARER = HTTPBearer(auto_error=False, scheme_name="key", description="An API key. The service on loopback needs none until one is made.")


@dataclass(frozen=True)
class Caller:
    """Who made a request; without a key where the service asks for none."""

    scope: Scope
    key_id: str | None = None
    name: str = "anybody"


class Keyring:
    """Tells callers by their keys, which are read from the database once in ``KEYS_SECONDS`` and not for every request.

    A key that was revoked is refused after that time at the latest; one that was just made is looked for at once.
    """

    def __init__(self, database: Database, *, open_without_keys: bool) -> None:
        self._database, self._open = database, open_without_keys
        self._ring: Ring | None = None
        self._read_at = -KEYS_SECONDS

    async def caller(self, headers: Headers) -> Caller | None:
        """The caller by the key in the Authorization header or else the cookie; None for those who may not come in."""
        given, ring = presented_key(headers), self._ring
        if ring is None or time.monotonic() - self._read_at > KEYS_SECONDS or (given is not None and not ring.knows(given)):
            self._read_at = time.monotonic()
            ring = self._ring = await run_in_threadpool(self._read)
        if given is not None:
            row = ring.check(given)
            return None if row is None else Caller(Scope(row.scope), row.id, row.name)
        return Caller(Scope.ADMIN) if self._open and not ring.rows else None

    def _read(self) -> Ring:
        try:
            with self._database.read() as session:
                return keys.ring(session)
        except Exception:
            self._ring = None  # nobody gets in by what was known before
            raise


def presented_key(headers: Headers) -> str | None:
    """The key that came with a request."""
    kind, _, value = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return value.strip()
    return cookie_parser(headers.get("cookie", "")).get(COOKIE)


async def _authorize(request: Request, needed: SecurityScopes, _documented: Annotated[object, Depends(_BEARER)]) -> Caller:
    """The caller that the guard has let in, if the scope suffices.

    Raises:
        CirisError: scope_missing.
    """
    caller: Caller = request.state.caller
    for scope in needed.scopes:
        if not caller.scope.includes(Scope(scope)):
            problem = f"this needs a key of the scope {scope}; the key {caller.name!r} has {caller.scope}"
            raise CirisError("scope_missing", problem, field="Authorization")
    return caller


READ, SUBMIT, ADMIN = (Security(_authorize, scopes=[scope.value]) for scope in Scope)
"""Dependencies of a route: the scope that it needs."""

Submitter = Annotated[Caller, SUBMIT]


async def _database(request: Request) -> Database:
    database: Database = request.app.state.database
    return database


Db = Annotated[Database, Depends(_database)]
