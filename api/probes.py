"""What the service needs may hang: the database, the queue, the disk. Here it is asked in such a way that nobody waits long.

A thread asks, and only one at a time asks the same thing. So however often monitoring comes, what hangs takes one thread.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from threading import Lock, Thread
from typing import Annotated, Generic, TypeVar

from fastapi import Depends, Request
from kombu.exceptions import OperationalError
from redis.exceptions import RedisError
from sqlalchemy.exc import SQLAlchemyError

from certifier.errors import CirisError
from db import inventory, statistics, version
from db.inventory import Contents
from db.session import Database
from db.statistics import Statistics
from workers.app import CONTROL, SOLVE, waiting

WAIT_SECONDS = 0.5
"""Nobody waits longer than this for an answer."""
QUICK_SECONDS, COST, BELIEVED_SECONDS, STATISTICS_SECONDS = 0.1, 10.0, 1.0, 60.0
"""An answer that took longer than QUICK_SECONDS is believed for COST times as long as that, but at most for BELIEVED_SECONDS, or
STATISTICS_SECONDS for what is counted in all of the database. So nobody slows the others by asking again and again.
"""
KEPT_SECONDS = 300.0
"""What was counted longer ago than this is not shown any more."""
OK = "ok"
SILENT = f"it does not answer within {WAIT_SECONDS:g} s"

T = TypeVar("T")


class Probe(Generic[T]):
    """A probe asks one thing. Use it from one event loop.

    An answer that took long is believed for a while, but at most for ``seconds``. An error is not.

    Args:
        ask: returns the answer. It runs in a thread of its own and may take as long as it likes.
    """

    def __init__(self, ask: Callable[[], T], seconds: float = BELIEVED_SECONDS) -> None:
        self._ask, self._seconds = ask, seconds
        self._asked: Future[T] | None = None
        self._until = -math.inf

    async def answer(self) -> T:
        """Returns the answer, and raises what asking raises.

        Raises:
            TimeoutError: there is no answer within ``WAIT_SECONDS``. The question stays asked.
        """
        if self._asked is None or (self._asked.done() and time.monotonic() >= self._until):
            self._until = -math.inf
            self._asked = _in_thread(self._timed)
        return await asyncio.wait_for(asyncio.shield(asyncio.wrap_future(self._asked)), WAIT_SECONDS)

    def _timed(self) -> T:
        began = time.monotonic()
        found = self._ask()
        now = time.monotonic()
        self._until = now + min(COST * max(now - began - QUICK_SECONDS, 0.0), self._seconds)
        return found


def _in_thread(ask: Callable[[], T]) -> Future[T]:
    asked: Future[T] = Future()

    def run() -> None:
        try:
            asked.set_result(ask())
        except BaseException as error:  # whoever waits for the answer gets it
            asked.set_exception(error)

    Thread(target=run, name="probe", daemon=True).start()
    return asked


class Counts(Generic[T]):
    """Counts something in all of the database, which may take long where it is large.

    Args:
        count: returns what it has counted, in a thread of its own.
        turn: the thread that counts holds it, so that all counts with the same turn need one connection to the database.
    """

    def __init__(self, count: Callable[[], T], turn: Lock) -> None:
        def begun() -> tuple[float, T]:
            with turn:
                return time.monotonic(), count()

        self._probe = Probe(begun, STATISTICS_SECONDS)
        self._last: tuple[float, T] | None = None

    async def answer(self) -> tuple[float, T] | None:
        """Returns how many seconds ago it was counted, and what.

        It is counted anew, but that may need longer than anybody waits. Then this is the last count, or None where there is none of the
        last ``KEPT_SECONDS``.
        """
        with suppress(SQLAlchemyError, TimeoutError):
            self._last = await self._probe.answer()
        if self._last is None:
            return None
        began, counted = self._last
        age = time.monotonic() - began
        return None if age > KEPT_SECONDS else (age, counted)


class Probes:
    """Holds what an API process asks about what it needs.

    Args:
        db: all of the database.
    """

    def __init__(self, db: Database) -> None:
        self._database, self._queue = Probe(lambda: _database(db)), Probe(_messages)
        self._disk = Probe(lambda: db.disk.trouble() or OK) if db.sqlite else None
        turn = Lock()
        self._statistics, self._contents = Counts(lambda: _statistics(db), turn), Counts(lambda: inventory.collect(db), turn)

    async def checks(self) -> dict[str, str]:
        """Returns what each check says: ``OK``, or what is wrong."""
        checks = {"database": _said(self._database), "queue": self._queue_says()}
        if self._disk is not None:
            checks["disk"] = _said(self._disk)
        return dict(zip(checks, await asyncio.gather(*checks.values()), strict=True))

    async def messages(self) -> dict[str, int]:
        """Returns how many messages wait in each queue; nothing where the queue gives no answer."""
        try:
            return await self._queue.answer()
        except (OperationalError, RedisError, TimeoutError):
            return {}

    async def _queue_says(self) -> str:
        try:
            await self._queue.answer()
        except TimeoutError:
            return SILENT
        except (OperationalError, RedisError) as error:
            return f"Redis cannot be reached: {type(error).__name__}"  # everybody may ask; its own words name hosts and ports
        return OK

    async def statistics(self) -> tuple[float, Statistics] | None:
        """Returns the statistics and how many seconds old they are; None where they are not counted yet."""
        return await self._statistics.answer()

    async def contents(self) -> tuple[float, dict[str, Contents]] | None:
        """Returns what every project has, and how many seconds ago it was counted; None where it is not counted yet."""
        return await self._contents.answer()


async def _kept(request: Request) -> Probes:
    probes: Probes = request.app.state.probes
    return probes


Asked = Annotated[Probes, Depends(_kept)]


async def _said(check: Probe[str]) -> str:
    try:
        return await check.answer()
    except TimeoutError:
        return SILENT


def _database(db: Database) -> str:
    try:
        with db.read() as session:
            version.check(session)
    except CirisError as error:
        return error.message
    except SQLAlchemyError as error:
        return f"cannot be used: {type(error).__name__}"
    return OK


def _messages() -> dict[str, int]:
    return {queue: waiting(queue) for queue in (CONTROL, SOLVE)}


def _statistics(db: Database) -> Statistics:
    with db.read() as session:
        return statistics.collect(session)
