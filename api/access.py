"""This module finds out who sends a request and what the caller may do, and gives the routes the database."""

from __future__ import annotations

import asyncio
import hashlib
import logging
import math
import shlex
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
from db import keys, sessions, version
from db.keys import Key, Scope
from db.models import DEFAULT_PROJECT
from db.session import UNAVAILABLE, Database
from db.sessions import SignedIn
from db.types import utcnow

log = logging.getLogger(__name__)

COOKIE = "ciris_session"
KEYS_SECONDS = 1.0
"""A key or session that was read from the database is trusted for this many seconds."""
PATIENCE_SECONDS = 0.3
"""A request of monitoring waits this many seconds for the keys."""
AGAIN_SECONDS = 0.03
"""When requests bring unknown keys or sessions, the database is read at most once in this many seconds, however many requests there are."""
LATELY_SECONDS, TOGETHER = 30.0, 500
"""Of the keys and sessions that were used within LATELY_SECONDS, the last TOGETHER are read again with any other."""
MOST_KEYS = 10_000
"""This many keys and sessions are remembered. The one that was not used for longest is looked up again when it comes."""
NOTES_SECONDS = 5.0
"""When it could not be noted that keys were used, this is tried again after this many seconds."""
_thread = ThreadPoolExecutor(1, "keys")
"""Every request may wait for the keys, so their reading waits for no other request."""
_notes = ThreadPoolExecutor(1, "uses of keys")
"""Nobody waits for these notes, which may wait for the database's lock."""


@dataclass(frozen=True)
class Caller:
    """A caller is the sender of a request: a key, or a person who signed in at the identity provider; neither where the service asks for
    no key.

    Attributes:
        subject: the provider's name for the person, which never changes.
        signed_in: whether the request came with a session.
    """

    scope: Scope
    project: str = DEFAULT_PROJECT
    key_id: str | None = None
    name: str = "anybody"
    subject: str | None = None
    signed_in: bool = False

    @property
    def id(self) -> str | None:
        """Returns by what the caller is counted and found in logs: the key's id, or the person's in this project; None for anybody."""
        if self.subject is None:
            return self.key_id
        return f"person-{hashlib.sha256(f'{self.project} {self.subject}'.encode()).hexdigest()[:16]}"

    @property
    def runs_service(self) -> bool:
        """Whether this is an admin of the project ``default``. They see to what all projects share, and to the projects."""
        return self.project == DEFAULT_PROJECT and self.scope.includes(Scope.ADMIN)

    def __str__(self) -> str:
        if self.subject is not None:
            return f"{self.name} (OIDC, subject {self.subject})"
        return self.name if self.key_id is None else f"{self.name} ({self.key_id})"


@dataclass(frozen=True)
class _Known:
    """A key or session as the database had it at ``read_at``."""

    held: Key | SignedIn
    read_at: float


class Keyring:
    """A keyring recognises callers by their keys and sessions. It looks each up by its id, whatever others there are. What is said of
    keys here holds for sessions, too.

    It remembers the ``MOST_KEYS`` keys that were used last. While there are requests, it reads those that were used lately again about
    twice in ``KEYS_SECONDS``, all at once. So a revoked key is refused after ``KEYS_SECONDS`` at the latest, and a key that is in use
    hardly ever waits for a reading while the database answers. What strangers send is not stored, and makes the keyring read at most once
    in ``AGAIN_SECONDS``.

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
        self._lately: dict[str, float] = {}
        """When keys and sessions were used, by their ids, the last one at the end."""
        self._read_at = -math.inf
        self._reading: asyncio.Future[None] | None = None
        self._used: set[str] = set()
        """The ids of keys and sessions whose use is to be noted."""
        self._noting: asyncio.Future[None] | None = None

    async def caller(self, given: str | None, *, patient: bool = True) -> Caller | None:
        """Returns the caller to whom the key or session of a request belongs; None when what is known now does not let this caller in.

        Where the service asks for no key, nobody can have signed in. A session is then one of another service on this machine.

        Args:
            patient: False for a request that must be answered while the database hangs: what was read last counts then.

        Raises:
            sqlalchemy.exc.SQLAlchemyError: the keys cannot be read.
        """
        if given is None or (self._open and sessions.id_of(given) is not None):
            return Caller(Scope.ADMIN) if await self._is_open(patient) else None
        id = _id_of(given)
        held = None if id is None else await self._held(id, patient)
        if held is None or not held.opens(given):
            return None
        if not held.used_lately():
            self._note_soon(held.id)
        return _caller(held)

    async def newcomer(self, given: str | None) -> Caller | None:
        """Returns the caller of a key that :meth:`caller` does not know, because nobody has used it here; else None."""
        id = None if given is None else _id_of(given)
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

    async def _held(self, id: str, patient: bool) -> Key | SignedIn | None:
        """Returns the key or session of this id as it was ``KEYS_SECONDS`` ago or later; None where none is known."""
        while (known := self._known.get(id)) is not None and known.read_at < time.monotonic() - KEYS_SECONDS:
            if not await _done(self._read(id), patient):
                break
        if known is None:
            return None
        self._lately.pop(id, None)
        self._lately[id] = time.monotonic()
        if known.read_at < time.monotonic() - KEYS_SECONDS / 2:
            self._read_soon()
        return known.held

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
            began = time.monotonic()
            last = list(self._lately.items())[-TOGETHER:]
            self._lately = {id: used_at for id, used_at in last if used_at > began - LATELY_SECONDS}
            ids, self._wanted = self._wanted | self._lately.keys(), set()
            found, self._open = await asyncio.get_running_loop().run_in_executor(_thread, self._look_up, ids)
            for id in ids - found.keys():
                self._known.pop(id, None)
            self._known.update({id: _Known(held, began) for id, held in found.items()})
            self._read_at = began
        finally:
            self._reading = None

    def _note_soon(self, id: str) -> None:
        """Has the use of a key or session noted."""
        self._used.add(id)
        if self._noting is None:
            self._noting = asyncio.ensure_future(self._note_uses())

    async def _note_uses(self) -> None:
        """Notes which keys and sessions were used, until nothing is to be noted."""
        try:
            while self._used:
                ids, self._used, now = self._used, set(), utcnow()
                try:
                    await asyncio.get_running_loop().run_in_executor(_notes, self._note, ids, now)
                except (CirisError, *UNAVAILABLE) as error:
                    log.warning("when keys were used could not be noted; trying again at their next use: %s", error)
                    await asyncio.sleep(NOTES_SECONDS)
                    continue
                self._used -= ids
                for id in ids & self._known.keys():
                    known = self._known[id]
                    self._known[id] = replace(known, held=replace(known.held, last_used_at=now))
        finally:
            self._noting = None

    def _note(self, ids: set[str], now: datetime) -> None:
        with self._database.write() as session:
            keys.note_use(session, ids, now)
            sessions.note_use(session, ids, now)

    def _look_up(self, ids: set[str]) -> tuple[dict[str, Key | SignedIn], bool]:
        """Returns the keys and sessions that have these ids, by id, and whether the service is open."""
        with self._database.read() as session:
            version.check(session)
            return {**keys.find(session, ids), **sessions.find(session, ids)}, self._open and not keys.exist(session)


def _id_of(given: str) -> str | None:
    """Returns the id of the key or session that came with a request; None where it has the form of neither."""
    return keys.id_of(given) or sessions.id_of(given)


def _caller(held: Key | SignedIn) -> Caller | None:
    """Returns the caller whom a key or session lets in; None for a person who works in no project."""
    key = held if isinstance(held, Key) else held.key
    if key is not None:
        return Caller(key.scope, key.project, key.id, key.name, signed_in=held is not key)
    if not isinstance(held, SignedIn) or held.person is None or held.project is None:
        return None
    project, scope = held.project
    return Caller(scope, project, None, held.person.name, held.person.subject, signed_in=True)


async def _done(reading: Awaitable[None], patient: bool) -> bool:
    """Waits for a reading, and says whether it is done: for as long as it takes, or for a moment."""
    try:
        await (reading if patient else asyncio.wait_for(reading, PATIENCE_SECONDS))
    except (TimeoutError, *UNAVAILABLE):
        if patient:
            raise
        return False
    return True


def presented(headers: Headers) -> str | None:
    """Returns what came with a request: the key of the Authorization header, or else the session of the cookie."""
    kind, _, value = headers.get("authorization", "").partition(" ")
    return value.strip() if kind.lower() == "bearer" else session_of(headers)


def session_of(headers: Headers) -> str | None:
    """Returns the token of the cookie; None where there is none. What has another form, such as a key, counts as none."""
    token = cookie_parser(headers.get("cookie", "")).get(COOKIE, "")
    return token if sessions.id_of(token) is not None else None


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
            who = f"the key {caller.name!r}" if caller.subject is None else f"{caller.name!r}"
            whom = "PERSON" if caller.name == caller.subject and "@" in caller.name else shlex.quote(caller.name)
            makes = "key add NAME" if caller.subject is None else f"project grant {caller.project} --person {whom}"
            problem = f"this needs a key of the scope {self._scope}; {who} has {caller.scope}"
            raise CirisError("scope_missing", problem, field="Authorization", hint=f"`ciris {makes} --scope {self._scope}` makes one")
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
        problem = f"{caller.name!r} belongs to the project {caller.project}, and this is about other projects or all of them"
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
