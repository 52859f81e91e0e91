"""A probe looks once for all that ask at the same time, and believes what took long for a while."""

from __future__ import annotations

import asyncio
import threading
import time

import pytest

from api.probes import Probe


def test_all_that_ask_during_a_look_share_it() -> None:
    begun, may_end, looks = threading.Event(), threading.Event(), []

    def look() -> int:
        looks.append(len(looks))
        begun.set()
        assert may_end.wait(30)
        return looks[-1]

    async def ask() -> list[int]:
        probe = Probe(look, seconds=0.0)
        answers = [asyncio.ensure_future(probe.answer()) for _ in range(50)]
        await asyncio.to_thread(begun.wait)
        may_end.set()
        return [*await asyncio.gather(*answers), await probe.answer()]

    assert asyncio.run(ask()) == [0] * 50 + [1]


def test_a_long_look_is_believed_for_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("api.probes.WAIT_SECONDS", 30.0)
    looks = []

    def look() -> int:
        looks.append(len(looks))
        time.sleep(0.3)
        return looks[-1]

    async def ask(seconds: float) -> list[int]:
        probe = Probe(look, seconds)
        return [await probe.answer(), await probe.answer()]

    assert asyncio.run(ask(60.0)) == [0, 0]
    assert asyncio.run(ask(0.0)) == [1, 2]


def test_a_look_that_fails_is_not_believed() -> None:
    looks = []

    def look() -> int:
        looks.append(len(looks))
        if len(looks) == 1:
            raise OSError("away")
        return looks[-1]

    async def ask() -> int:
        probe = Probe(look, seconds=60.0)
        with pytest.raises(OSError, match="away"):
            await probe.answer()
        return await probe.answer()

    assert asyncio.run(ask()) == 1
