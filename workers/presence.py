"""A worker says in the database that it lives and what it does, and does what people want of it: it runs, pauses or drains.

It says so from its start on, also while it loads or compiles what it calls and takes no work yet.

A paused worker takes no message from its queue, and a draining one ends with status 0 when it has finished what it holds. Messages that
it leaves are there for the other workers: each worker that claims a piece and leaves more sends the next message. A worker whose database
has been migrated to another version ends at once: it could not save what it finds.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from importlib import metadata
from typing import Any

from celery.worker import state as celery_state

from certifier.errors import CirisError
from db import machine, version, workers
from db.leases import this_worker
from db.session import UNAVAILABLE, Database
from db.settings import settings
from db.states import WorkerState
from db.workers import Made, WorkerKind
from workers.troubles import Troubles

log = logging.getLogger(__name__)

LOOK_SECONDS = 2.0
"""The worker looks each time this many seconds have passed what is wanted of it."""
CHANGE_SECONDS = 0.1
"""It looks again after this many seconds whether it does what it was asked to do a moment ago."""
TELL_SECONDS = 10.0
"""It says this often that it lives."""


class Presence:
    """Tells of this worker, and listens for it, in a thread of its own.

    The solve worker starts its processes by forking. A process must not be forked while a thread uses the database: it would inherit
    SQLite's locks as the thread had them. So a fork waits for the end of a visit to the database, and finds no connection.

    Args:
        ended: set when the worker ends.
        troubles: what fails of what the worker does again and again.

    Attributes:
        refused: True once the database is of another version. The worker ends then.
    """

    refused = False

    def __init__(self, kind: WorkerKind, ended: threading.Event, troubles: Troubles) -> None:
        processes = settings().solve_processes if kind is WorkerKind.SOLVE else 1
        self._made = Made(this_worker(), kind, metadata.version("ciris"), processes, machine.cores(), machine.memory_bytes())
        self._ended, self._troubles = ended, troubles
        self._state, self._wanted = WorkerState.STARTING, WorkerState.RUNNING
        self._consumer: Any = None
        self._news = threading.Event()
        self._told: float | None = None
        self._told_of: tuple[WorkerState, str | None] | None = None
        self._database = Database(settings().database)
        self._visit = threading.Lock()
        os.register_at_fork(before=self._before_fork, after_in_parent=self._visit.release, after_in_child=self._visit.release)

    def say(self, state: WorkerState) -> None:
        """Tells what the worker does now, at once."""
        if state is not self._state:
            self._state = state
            self._news.set()

    def begin(self, consumer: Any) -> None:
        """Tells that the worker takes work. From now on it does what is wanted of it.

        Args:
            consumer: Celery's, which takes the messages.
        """
        self.say(WorkerState.RUNNING)
        self._consumer = consumer  # only now is it asked to pause, whose thread says the state that follows

    def run(self) -> None:
        """Tells and listens until the worker ends."""
        while not self._ended.is_set():
            try:
                with self._visit:
                    self._wanted = self._look()
            except UNAVAILABLE as error:
                log.warning("the database cannot be reached; this worker goes on as it is (%s): %s", self._state, type(error).__name__)
            except CirisError as error:
                log.error("this worker ends, and gives back what it holds: %s", error)
                self.refused = celery_state.should_terminate = True
                return
            except Exception:
                log.exception("this worker could not tell of itself; trying again")
            if self._state is WorkerState.DRAINING and not celery_state.reserved_requests:
                log.info("this worker holds nothing any more, and ends")
                celery_state.should_stop = os.EX_OK
                return
            changes = self._consumer is not None and self._wanted is not self._state
            if changes:
                self._consumer.call_soon(self._change, self._consumer)
            self._news.wait(CHANGE_SECONDS if changes else LOOK_SECONDS)
            self._news.clear()

    def leave(self) -> None:
        """Takes the worker out of the database. If that fails, it is forgotten after a while."""
        try:
            with self._visit, self._database.write() as session:
                workers.leave(session, self._made.process)
        except (CirisError, *UNAVAILABLE) as error:
            log.warning("the database cannot be used; this worker is forgotten later: %s", type(error).__name__)

    def _look(self) -> WorkerState:
        """Returns what is wanted, and says what the worker does and what fails where that is due, or news.

        Raises:
            CirisError: database_version, when the database has been migrated to another version.
        """
        now = self._state, self._troubles.said()
        if self._told is not None and now == self._told_of and time.monotonic() - self._told < TELL_SECONDS:
            with self._database.read() as session:
                version.check(session)
                wanted = workers.wanted(session, self._made.process)
            if wanted is not None:
                return wanted
        with self._database.write() as session:
            wanted = workers.tell(session, self._made, *now)
        self._told, self._told_of = time.monotonic(), now
        return wanted

    def _change(self, consumer: Any) -> None:
        """Does what is wanted, in the thread that takes the messages. While that thread reconnects to Redis, it does nothing."""
        if self._wanted is self._state or consumer.task_consumer is None:
            return
        if self._wanted is WorkerState.RUNNING:
            consumer.add_task_queue(self._made.kind.value)
        elif self._state is WorkerState.RUNNING:
            consumer.cancel_task_queue(self._made.kind.value)
        log.info("this worker was %s and is %s now", self._state, self._wanted)
        self._state = self._wanted

    def _before_fork(self) -> None:
        self._visit.acquire()
        self._database.close()
