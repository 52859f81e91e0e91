"""Large questions wait for each other, and small ones do not wait for them."""

from __future__ import annotations

import asyncio
import threading
import time

import httpx2
import pytest

from api import questions
from api.routers import planning
from planner.membership import locate

LARGE = {"scene": "slider", "q": [[0.0]] * 101}
SMALL = {"scene": "slider", "q": [[0.0]] * 100}


@pytest.fixture
def go_on(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Large questions are not answered before this is set."""
    event = threading.Event()

    def slowly(library: object, points: list[object]) -> object:
        if len(points) > 100:
            event.wait()
        return locate(library, points)  # type: ignore[arg-type]

    monkeypatch.setattr(planning, "locate", slowly)
    return event


@pytest.mark.parametrize("limit", ["WAITING", "OF_PROJECT_WAITING"])
def test_small_questions_do_not_wait_for_large_ones(
    url: str, region: str, go_on: threading.Event, monkeypatch: pytest.MonkeyPatch, limit: str
) -> None:
    monkeypatch.setattr(questions, limit, 3)

    async def ask() -> tuple[list[float], list[int], list[int]]:
        async with httpx2.AsyncClient(base_url=url, timeout=30.0) as client:
            large = [asyncio.create_task(client.post("/v1/planning/contains", json=LARGE)) for _ in range(8)]
            await asyncio.sleep(0.5)
            seconds, small = [], []
            for _ in range(10):
                began = time.monotonic()
                small.append((await client.post("/v1/planning/contains", json=SMALL)).status_code)
                seconds.append(time.monotonic() - began)
            go_on.set()
            return seconds, small, [(await task).status_code for task in large]

    try:
        seconds, small, large = asyncio.run(ask())
    finally:
        go_on.set()
    assert small == [200] * 10
    assert max(seconds) < 5.0, "the large ones have not been answered yet"
    assert sorted(large) == [200] * 4 + [503] * 4


def test_an_answer_is_the_same_whichever_way_it_takes(url: str, region: str) -> None:
    with httpx2.Client(base_url=url) as client:
        points = [[i / 200 - 0.5] for i in range(150)]
        one = client.post("/v1/planning/contains", json={"scene": "slider", "q": points}).json()["points"]
        parts = [
            client.post("/v1/planning/contains", json={"scene": "slider", "q": points[i : i + 50]}).json()["points"] for i in (0, 50, 100)
        ]
    assert one == [point for part in parts for point in part]
    assert {point["inside"] for point in one} == {True, False}  # type: ignore[index]
