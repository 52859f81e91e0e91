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
from threading import Thread
from typing import Generic, TypeVar

from kombu.exceptions import OperationalError
from redis.exceptions import RedisError
from sqlalchemy.exc import SQLAlchemyError

from certifier.errors import CirisError
from db import version
from db.session import Database
from db.statistics import Statistics, collect
from workers.app import CONTROL, SOLVE, waiting

WAIT_SECONDS = 0.5
"""Nobody waits longer than this for an answer."""
QUICK_SECONDS, COST, BELIEVED_SECONDS, STATISTICS_SECONDS = 0.1, 10.0, 1.0, 60.0
"""An answer that took longer than QUICK_SECONDS is believed for COST times as long as that, but at most for BELIEVED_SECONDS, or
STATISTICS_SECONDS for statistics. So nobody slows the others by asking again and again.
"""
KEPT_SECONDS = 300.0
"""Statistics that are older than this are not shown any more."""
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


class Probes:
    """Holds what an API process asks about what it needs.

    Args:
        db: all of the database.
    """

    def __init__(self, db: Database) -> None:
        self._database, self._queue = Probe(lambda: _database(db)), Probe(_messages)
        self._disk = Probe(lambda: db.disk.trouble() or OK) if db.sqlite else None
        self._statistics = Probe(lambda: _collected(db), STATISTICS_SECONDS)
        self._last: tuple[float, Statistics] | None = None

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
        """Returns the statistics and how many seconds old they are.

        They are counted anew, but a large database may need longer for that than anybody waits. Then these are the last ones, or None
        where there are none of the last ``KEPT_SECONDS``.
        """
        with suppress(SQLAlchemyError, TimeoutError):
            self._last = await self._statistics.answer()
        began, statistics = self._last or (-math.inf, None)
        age = time.monotonic() - began
        return None if statistics is None or age > KEPT_SECONDS else (age, statistics)


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


def _collected(db: Database) -> tuple[float, Statistics]:
    """Returns when the statistics were counted, by the monotonic clock, and the statistics."""
    began = time.monotonic()
    with db.read() as session:
        return began, collect(session)
