"""Who is asking and what they may do, and the database for those who may."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request, Security
from fastapi.security import HTTPBearer, SecurityScopes
from starlette.datastructures import Headers
from starlette.requests import cookie_parser

from certifier.errors import CirisError
from db import keys
from db.keys import Scope
from db.session import Database
from db.settings import settings

COOKIE = "ciris_key"
_BEARER = HTTPBearer(auto_error=False, scheme_name="key", description="An API key. The service on loopback needs none until one is made.")


@dataclass(frozen=True)
class Caller:
    """Who made a request; without a key where the service asks for none."""

    scope: Scope
    key_id: str | None = None
    name: str = "anybody"


def identify(db: Database, headers: Headers) -> Caller | None:
    """The caller by the key in the Authorization header or else the cookie; None for those who may not come in."""
    given = presented_key(headers)
    with db.read() as session:
        if given is not None:
            row = keys.check(session, given)
            return None if row is None else Caller(Scope(row.scope), row.id, row.name)
        return Caller(Scope.ADMIN) if settings().loopback and not keys.exist(session) else None


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
