"""Threads that projects share: whoever has many requests delays nobody else, and each is answered in the end."""

from __future__ import annotations

import asyncio
import gc
import weakref
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from threading import Event

import pytest

from api.turns import Turns


def test_a_thread_is_left_to_others_however_many_requests_a_project_has() -> None:
    turns, go, begun = Turns("test", threads=3, of_project=2), Event(), list[int]()

    def slow(number: int) -> Callable[[], int]:
        def answer() -> int:
            begun.append(number)
            assert go.wait(30)
            return number

        return answer

    async def ask() -> list[int]:
        many = [asyncio.create_task(turns.run("many", slow(number))) for number in range(20)]
        while len(begun) < 2:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.2)
        assert sorted(begun) == [0, 1]
        for _ in range(3):
            assert await asyncio.wait_for(turns.run("one", lambda: "at once"), 10) == "at once"
        assert sorted(begun) == [0, 1]
        go.set()
        return await asyncio.wait_for(asyncio.gather(*many), 30)

    assert asyncio.run(ask()) == list(range(20))
    assert sorted(begun) == list(range(20))


def test_projects_take_turns_at_one_thread() -> None:
    turns, go, order = Turns("test", threads=1, of_project=1), Event(), list[str]()

    async def ask() -> None:
        first = asyncio.create_task(turns.run("first", lambda: go.wait(30)))
        await asyncio.sleep(0.1)
        rest = [asyncio.create_task(turns.run(name, lambda name=name: order.append(name))) for name in "aaaabbc"]  # type: ignore[misc]
        await asyncio.sleep(0.1)
        go.set()
        await asyncio.wait_for(asyncio.gather(first, *rest), 30)

    asyncio.run(ask())
    assert order == list("abcabaa")


def test_threads_are_shared_while_several_projects_ask(monkeypatch: pytest.MonkeyPatch) -> None:
    turns = Turns("test", threads=1, of_project=1)

    def shared_after(*projects: str | None) -> bool:
        for project in projects:
            asyncio.run(turns.run(project, lambda: None))
        return turns.shared

    assert not shared_after("one", "one", None)
    assert shared_after("another")
    monkeypatch.setattr("api.turns.LATELY_SECONDS", 0.0)
    assert not shared_after("one")


def test_an_error_holds_nothing_once_it_is_answered() -> None:
    """The service seldom looks for garbage, and what a request has read may be large."""
    turns, read = Turns("test", threads=1, of_project=1), list[weakref.ref[Event]]()

    def wrong() -> None:
        large = Event()
        read.append(weakref.ref(large))
        raise ValueError

    async def ask() -> None:
        with suppress(ValueError):
            await turns.run("a", wrong)
        await turns.run("a", lambda: None)  # the thread is done with the first one

    gc.disable()
    try:
        asyncio.run(ask())
        assert read[0]() is None
    finally:
        gc.enable()


def test_who_is_gone_takes_no_time_and_an_error_comes_back() -> None:
    turns, go, begun = Turns("test", threads=1, of_project=1), Event(), list[str]()

    def wrong() -> None:
        raise ValueError("wrong")

    async def ask() -> None:
        first = asyncio.create_task(turns.run("a", lambda: go.wait(30)))
        await asyncio.sleep(0.1)
        gone = asyncio.create_task(turns.run("a", lambda: begun.append("gone")))
        last = asyncio.create_task(turns.run("a", wrong))
        await asyncio.sleep(0.1)
        gone.cancel()
        with suppress(asyncio.CancelledError):
            await gone
        go.set()
        await first
        with pytest.raises(ValueError, match="wrong"):
            await last
        assert await asyncio.wait_for(turns.run("a", lambda: 1), 10) == 1

    asyncio.run(ask())
    assert begun == []


def test_projects_that_ask_share_the_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("api.turns.LATELY_SECONDS", 1.0)
    turns, go = Turns("test", threads=4, of_project=3), Event()

    async def ask() -> None:
        begun = list[str]()

        def slow(name: str) -> None:
            begun.append(name)
            assert go.wait(30)

        async def asked(name: str, threads: int) -> list[asyncio.Task[None]]:
            tasks = [asyncio.create_task(turns.run(name, partial(slow, name))) for _ in range(5)]
            while len(begun) < threads:
                await asyncio.sleep(0.01)
            await asyncio.sleep(0.2)
            return tasks

        await turns.run("other", lambda: None)
        tasks = await asked("many", 1)
        assert begun == ["many"]
        await asyncio.sleep(1.0)
        tasks += await asked("many", 3)
        assert begun == ["many"] * 3, "the other one has not asked lately"
        go.set()
        await asyncio.wait_for(asyncio.gather(*tasks), 30)

    asyncio.run(ask())
