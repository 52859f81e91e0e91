"""Requests get one of a few threads by turns of their projects. A project with many requests delays its own, not those of others."""

from __future__ import annotations

import asyncio
import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Lock
from typing import Any, TypeVar

Answer = TypeVar("Answer")
LATELY_SECONDS = 10.0


class Turns:
    """Some threads. One that is free answers the project for which the fewest work, and of several the one that has waited for longest.

    Args:
        of_project: at most this many threads work for one project at a time. Projects that asked lately share them, each has one at least.
    """

    def __init__(self, name: str, threads: int, of_project: int) -> None:
        self._pool, self._of_project = ThreadPoolExecutor(threads, name), of_project
        self._lock = Lock()
        self._waiting: dict[str | None, deque[tuple[Future[Any], Callable[[], Any]]]] = {}
        self._running = Counter[str | None]()
        self._asked_at: dict[str, float] = {}
        """Maps a project to when it asked last, those first that have not asked for longest."""
        self._passed = 0
        """Number of requests that wait because their projects had as many threads as they may."""

    async def run(self, project: str | None, function: Callable[[], Answer]) -> Answer:
        """Calls the function in a thread when it is the project's turn. What is of no project (None) may have all threads."""
        return await asyncio.wrap_future(self._asked(project, function))

    @property
    def shared(self) -> bool:
        """Whether several projects asked lately."""
        return len(self._asked_at) > 1

    def _asked(self, project: str | None, function: Callable[[], Answer]) -> Future[Answer]:
        done: Future[Answer] = Future()
        with self._lock:
            self._waiting.setdefault(project, deque()).append((done, function))
            if project is not None:
                self._asked_at.pop(project, None)
                self._asked_at[project] = time.monotonic()
        self._pool.submit(self._next)
        return done

    def _next(self) -> None:
        """Answers one request. It is called once for each."""
        with self._lock:
            most = self._threads_of_project()
            may = [project for project in self._waiting if project is None or self._running[project] < most]
            if not may:
                self._passed += 1
                return
            project = min(may, key=self._running.__getitem__)
            calls = self._waiting.pop(project)
            done, function = calls.popleft()
            if calls:
                self._waiting[project] = calls  # behind the others
            self._running[project] += 1
        try:
            if done.set_running_or_notify_cancel():
                try:
                    done.set_result(function())
                except BaseException as error:
                    done.set_exception(error)
        finally:
            del calls, done, function  # or else an error and this frame, where it came by, hold each other
            with self._lock:
                self._running[project] -= 1
                again, self._passed = self._passed > 0, max(self._passed - 1, 0)
            if again:
                self._pool.submit(self._next)

    def _threads_of_project(self) -> int:
        """Returns how many threads a project may have now: several that compute hold each other up, and with it everybody."""
        while self._asked_at and next(iter(self._asked_at.values())) < time.monotonic() - LATELY_SECONDS:
            del self._asked_at[next(iter(self._asked_at))]
        return max(1, self._of_project // max(1, len(self._asked_at)))
