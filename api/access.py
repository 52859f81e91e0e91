"""This module finds out who sends a request and what the caller may do, and gives the routes the database."""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections.abc import Awaitable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Annotated

from cachetools import LRUCache
from fastapi import Depends, Request, Security
from fastapi.security import HTTPBearer
from sqlalchemy.exc import TimeoutError as DatabaseTimeoutError
from starlette.datastructures import Headers
from starlette.requests import cookie_parser

from certifier.errors import CirisError
from db import keys, version
from db.keys import Key, Scope
from db.models import DEFAULT_PROJECT
from db.session import UNAVAILABLE, Database
from db.types import utcnow

log = logging.getLogger(__name__)

COOKIE = "ciris_key"
KEYS_SECONDS = 1.0
"""A key that was read from the database is trusted for this many seconds."""
PATIENCE_SECONDS = 0.3
"""A request of monitoring waits this many seconds for the keys."""
AGAIN_SECONDS = 0.1
"""When requests bring unknown keys, the database is read at most once in this many seconds, however many requests there are."""
MOST_KEYS = 10_000
"""This many keys are remembered. The one that was not used for longest is looked up again when it comes."""
NOTES_SECONDS = 5.0
"""When it could not be noted that keys were used, this is tried again after this many seconds."""
_thread = ThreadPoolExecutor(1, "keys")
"""Every request may wait for the keys, so their reading waits for no other request."""
_notes = ThreadPoolExecutor(1, "uses of keys")
"""Nobody waits for these notes, which may wait for the database's lock."""


@dataclass(frozen=True)
class Caller:
    """A caller is the sender of a request. The caller has no key where the service asks for none."""

    scope: Scope
    project: str = DEFAULT_PROJECT
    key_id: str | None = None
    name: str = "anybody"

    @property
    def runs_service(self) -> bool:
        """Whether this is an admin of the project ``default``. They see to what all projects share, and to the projects."""
        return self.project == DEFAULT_PROJECT and self.scope.includes(Scope.ADMIN)

    def __str__(self) -> str:
        return self.name if self.key_id is None else f"{self.name} ({self.key_id})"


@dataclass(frozen=True)
class _Known:
    """A key as the database had it at ``read_at``."""

    key: Key
    read_at: float


class Keyring:
    """A keyring recognises callers by their keys. It looks each key up by its id, whatever other keys there are.

    It remembers the ``MOST_KEYS`` keys that were used last. About twice in ``KEYS_SECONDS`` it reads those that were used meanwhile
    again, all at once. So a revoked key is refused after ``KEYS_SECONDS`` at the latest, and a key that is in use never waits for a
    reading while the database answers. What strangers send is not stored, and makes the keyring read at most once in ``AGAIN_SECONDS``.

    It has the use of a key noted, about every ten minutes while the key is in use (``db.keys.NOTED``). No request waits for that.

    It does not read a database of another version: ``database_version`` refuses every caller until the database is of this one.
    """

    def __init__(self, database: Database, *, open_without_keys: bool) -> None:
        self._database = database
        self._open = open_without_keys
        """Whether callers without a key are let in, as far as is known. Once there is a key, they never are again."""
        self._known: LRUCache[str, _Known] = LRUCache(MOST_KEYS)
        self._wanted: set[str] = set()
        """The ids that the next reading is to look up."""
        self._read_at = -math.inf
        self._reading: asyncio.Future[None] | None = None
        self._used: set[str] = set()
        """The ids of keys whose use is to be noted."""
        self._noting: asyncio.Future[None] | None = None

    async def caller(self, given: str | None, *, patient: bool = True) -> Caller | None:
        """Returns the caller to whom the key of a request belongs; None when what is known now does not let this caller in.

        Args:
            patient: False for a request that must be answered while the database hangs: what was read last counts then.

        Raises:
            sqlalchemy.exc.SQLAlchemyError: the keys cannot be read.
        """
        if given is None:
            return Caller(Scope.ADMIN) if await self._is_open(patient) else None
        id = keys.id_of(given)
        key = None if id is None else await self._key(id, patient)
        if key is None or not key.opens(given):
            return None
        if not key.used_lately():
            self._note_soon(key.id)
        return Caller(key.scope, key.project, key.id, key.name)

    async def newcomer(self, given: str | None) -> Caller | None:
        """Returns the caller of a key that :meth:`caller` does not know, because nobody has used it here; else None."""
        id = None if given is None else keys.id_of(given)
        if id is None or id in self._known:
            return None
        asked = time.monotonic()
        while self._read_at < asked:
            await self._read(id, pause=AGAIN_SECONDS)
        return await self.caller(given)

    async def _is_open(self, patient: bool) -> bool:
        """Says whether the service had no key ``KEYS_SECONDS`` ago or later."""
        while self._open and self._read_at < time.monotonic() - KEYS_SECONDS:
            if not await _done(self._read(), patient):
                if self._read_at == -math.inf:
                    raise DatabaseTimeoutError("the keys could not be read in time")
                break
        if self._open and self._read_at < time.monotonic() - KEYS_SECONDS / 2:
            self._read_soon()
        return self._open

    async def _key(self, id: str, patient: bool) -> Key | None:
        """Returns the key of this id as it was ``KEYS_SECONDS`` ago or later; None where none is known."""
        while (known := self._known.get(id)) is not None and known.read_at < time.monotonic() - KEYS_SECONDS:
            if not await _done(self._read(id), patient):
                break
        if known is None:
            return None
        self._wanted.add(id)
        if known.read_at < time.monotonic() - KEYS_SECONDS / 2:
            self._read_soon()
        return known.key

    async def _read(self, *ids: str, pause: float = 0.0) -> None:
        """Waits for the reading that is under way, or for the next one, which looks up these ids too.

        Of many requests that wait, one reads: ``pause`` seconds after the last reading began. If it fails, it fails for all of them.
        """
        self._wanted.update(ids)
        await asyncio.shield(self._read_soon(pause))

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
            began, ids, self._wanted = time.monotonic(), self._wanted, set()
            found, self._open = await asyncio.get_running_loop().run_in_executor(_thread, self._look_up, ids)
            for id in ids - found.keys():
                self._known.pop(id, None)
            self._known.update({id: _Known(key, began) for id, key in found.items()})
            self._read_at = began
        finally:
            self._reading = None

    def _note_soon(self, id: str) -> None:
        """Has a key's use noted."""
        self._used.add(id)
        if self._noting is None:
            self._noting = asyncio.ensure_future(self._note_uses())

    async def _note_uses(self) -> None:
        """Notes which keys were used, until nothing is to be noted."""
        try:
            while self._used:
                ids, self._used, now = self._used, set(), utcnow()
                try:
                    await asyncio.get_running_loop().run_in_executor(_notes, self._note, ids, now)
                except (CirisError, *UNAVAILABLE) as error:
                    log.warning("when keys were used could not be noted; trying again at their next use: %s", error)
                    await asyncio.sleep(NOTES_SECONDS)
                    continue
                for id in ids & self._known.keys():
                    known = self._known[id]
                    self._known[id] = replace(known, key=replace(known.key, last_used_at=now))
        finally:
            self._noting = None

    def _note(self, ids: set[str], now: datetime) -> None:
        with self._database.write() as session:
            keys.note_use(session, ids, now)

    def _look_up(self, ids: set[str]) -> tuple[dict[str, Key], bool]:
        """Returns the keys that have these ids, by id, and whether the service is open."""
        with self._database.read() as session:
            version.check(session)
            return keys.find(session, ids), self._open and not keys.exist(session)


async def _done(reading: Awaitable[None], patient: bool) -> bool:
    """Waits for a reading, and says whether it is done: for as long as it takes, or for a moment."""
    try:
        await (reading if patient else asyncio.wait_for(reading, PATIENCE_SECONDS))
    except (TimeoutError, *UNAVAILABLE):
        if patient:
            raise
        return False
    return True


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


async def _operator(caller: Admin) -> Caller:
    check_runs_service(caller)
    return caller


def check_runs_service(caller: Caller) -> None:
    """Refuses what is about other projects to everybody but those who run the service, before anything is looked up.

    Raises:
        CirisError: other_projects.
    """
    if not caller.runs_service:
        problem = f"the key {caller.name!r} belongs to the project {caller.project}, and this is about other projects or all of them"
        raise CirisError(
            "other_projects", problem, field="Authorization", hint="ask those who run the service: admins of the project default"
        )


Operator = Annotated[Caller, Depends(_operator)]
"""An admin of the project ``default``."""


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
