"""Bodies of requests that are large, or made to cost much: they cost others nothing, and nothing of them stays."""

from __future__ import annotations

import asyncio
import gc
import json
import tracemalloc
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import Any

import pytest
from fastapi.routing import APIRoute
from fastapi.testclient import TestClient
from httpx2 import ASGITransport, AsyncClient
from starlette.exceptions import HTTPException
from starlette.types import Message

from api import guard, strict
from api.app import _routes, create_app
from api.problems import MOST_ERRORS
from api.strict import MOST, SMALL
from certifier.errors import CirisError
from db.session import Database
from tests.api.conftest import BASE_URL
from tests.api.test_jobs import GROW

JSON = {"Content-Type": "application/json"}
MOST_TOLD = 10_000
"""What pydantic finds wrong becomes that many dicts at most, in some hundredths of a second."""


def post(client: TestClient, body: str, path: str = "/v1/planning/contains") -> tuple[int, str]:
    answer = client.post(path, content=body, headers=JSON)
    return answer.status_code, answer.json()["code"]


def numbers(rows: int) -> str:
    return json.dumps({"scene": "nothing", "q": [[0.125] * 20] * rows})


def test_the_largest_question_is_read_and_a_larger_body_is_not(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    assert post(client, numbers(10_000)) == (404, "scene_not_found")
    monkeypatch.setattr(strict, "from_json", None)
    assert post(client, numbers(11_000)) == (413, "too_large")
    for sign, most in MOST.items():
        assert post(client, (most + 1) * sign.decode()) == (413, "too_large")


def test_others_are_answered_while_a_large_body_is_read(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    read, begun, go = strict.from_json, Event(), Event()

    def slow(body: bytes, **options: Any) -> Any:
        if len(body) > SMALL:
            begun.set()
            assert go.wait(30)
        return read(body, **options)

    monkeypatch.setattr(strict, "from_json", slow)
    with ThreadPoolExecutor(1) as others:
        asked = others.submit(post, client, numbers(1000))
        assert begun.wait(30)
        assert post(client, numbers(1)) == (404, "scene_not_found")
        assert not asked.done()
        go.set()
        assert asked.result(30) == (404, "scene_not_found")


LONG = "x" * 2**20


@pytest.mark.parametrize(
    ("body", "code"),
    [
        (f'{{"scene": "{LONG}"', "malformed_json"),
        ('{"scene":' + "[" * 1000 + f'"{LONG}"' + "]" * 1000 + "}", "malformed_json"),
        (f'{{"scene": "{LONG}", "q": [], "q": []}}', "invalid_request"),
        (f'{{"scene": "{LONG}", "q": [[0]]}}', "invalid_request"),
        (f'{{"scene": ["{LONG}"], "q": [[{"0," * 200_001}0]]}}', "too_large"),
        (json.dumps({"scene": "x", "s": [[0]], "q": [[0.125] * 20] * 5000}), "invalid_request"),
        (json.dumps({"scene": "x", **dict.fromkeys(map(str, range(10_000)), 0.125)}), "invalid_request"),
    ],
)
def test_nothing_stays_of_a_body_that_was_refused(database: Database, body: str, code: str) -> None:
    """The service seldom looks for garbage, so it must make none that holds a body."""
    many = 20

    async def refused() -> None:
        async with AsyncClient(transport=ASGITransport(app=create_app(database)), base_url=BASE_URL) as client:
            for count in range(1 + many):
                if count == 1:  # what the first request has loaded stays
                    gc.collect()
                    tracemalloc.start()
                answer = await client.post("/v1/planning/contains", content=body, headers=JSON)
                assert answer.json()["code"] == code
            assert tracemalloc.get_traced_memory()[0] < many * len(body) / 2

    gc.disable()
    try:
        asyncio.run(refused())
    finally:
        tracemalloc.stop()
        gc.enable()


def test_a_project_holds_a_limited_number_of_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "HELD_BYTES", 100)
    held = Counter[str | None]()

    async def receive() -> Message:
        return {"type": "http.request", "body": b"x" * 60}

    async def ask() -> None:
        with guard._held(receive, held, "many") as first:
            await first()
            with guard._held(receive, held, "one") as other:
                await other()
            with guard._held(receive, held, "many") as second, pytest.raises(HTTPException) as refused:
                await second()
            assert isinstance(refused.value.__cause__, CirisError)
            assert refused.value.__cause__.code == "busy"
        with guard._held(receive, held, "many") as third:
            await third()

    asyncio.run(ask())
    assert not held


def test_uploads_lie_on_the_disk_and_other_bodies_are_held(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "HELD_BYTES", 1000)
    assert post(client, numbers(10)) == (503, "busy")
    assert post(client, numbers(1)) == (404, "scene_not_found")
    assert client.post("/v1/scenes", files={"bundle": ("scene.zip", b"x" * 2000)}).status_code == 422


def test_an_upload_has_one_file(client: TestClient) -> None:
    """A megabyte of each of many files would be held in memory."""
    answer = client.post("/v1/scenes", files=[("bundle", b"x"), ("another", b"x")])
    assert (answer.status_code, answer.json()["detail"]) == (400, "Too many files. Maximum number of files is 1.")


def test_addresses_are_short(client: TestClient) -> None:
    answer = client.get("/v1/jobs", params={"search": "x" * guard.URL_BYTES})
    assert (answer.status_code, answer.json()["code"], answer.json()["field"]) == (413, "too_large", "url")


def test_an_answer_names_a_limited_number_of_errors(client: TestClient) -> None:
    problem = client.post("/v1/jobs/batch", json={"jobs": [{**GROW, "a": 0, "b": 0}] * 100}).json()
    assert (problem["field"], len(problem["errors"])) == ("jobs[0].a", MOST_ERRORS)


def test_of_a_thousand_unknown_fields_an_answer_names_none(client: TestClient) -> None:
    problem = client.post("/v1/jobs", json=GROW | {"seed": {**GROW["seed"], **dict.fromkeys(map(str, range(1000)), 0)}}).json()
    assert (problem["field"], problem["detail"], len(problem["errors"])) == ("seed", "there are more than 30 fields", 1)


def routes() -> Iterator[APIRoute]:
    for included in _routes():
        for route in getattr(getattr(included, "original_router", None), "routes", ()):
            if isinstance(route, APIRoute) and route.body_field is not None:
                yield route


def most_wrong(schema: dict[str, Any]) -> int:
    """How much pydantic can find wrong in one value of this schema, keys that it does not know left out."""
    match schema["type"]:
        case "list":
            return most_wrong(schema["items_schema"]) * (1 if schema.get("fail_fast") else int(schema["max_length"]))
        case "dict" if schema.get("values_schema", schema)["type"] != "any":
            return int(schema["max_length"]) * (most_wrong(schema["keys_schema"]) + most_wrong(schema["values_schema"]))
        case "model-fields":
            return sum(most_wrong(field["schema"]) for field in schema["fields"].values())
        case "union":
            return sum(most_wrong(choice[0] if isinstance(choice, tuple) else choice) for choice in schema["choices"])
        case "tagged-union":
            return max(most_wrong(choice) for choice in schema["choices"].values())
        case _:
            return most_wrong(schema["schema"]) if "schema" in schema else 1


def test_of_no_request_too_much_can_be_wrong() -> None:
    found = {route.path: most_wrong(route.body_field._type_adapter.core_schema) for route in routes() if route.body_field}
    assert len(found) > 10
    assert {path: count for path, count in found.items() if count > MOST_TOLD} == {}
