"""Requests that are valid in a way nobody meant: every answer is a problem of the client's, never of the service's."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given
from hypothesis import settings as examples
from hypothesis import strategies as st
from pydantic import ValidationError
from sqlalchemy.exc import OperationalError

from api import guard
from api.access import KEYS_SECONDS
from api.app import create_app
from certifier.model import Scene
from db import jobs
from db.session import Database
from jobs.fields import Request
from tests.api.conftest import BASE_URL, PROBLEM
from tests.api.test_jobs import CERTIFY, GROW

JSON = {"Content-Type": "application/json"}


@pytest.mark.parametrize(
    "body",
    [
        "[" * 100_000,
        '{"a":' * 100_000,
        '{"kind": "grow", "scene": "slider", "seed": {"q": ' + "[" * 100_000 + "]" * 100_000 + "}}",
        json.dumps(GROW).replace("0.1", "1" * 5000),
        json.dumps(GROW).replace("0.1", "1" * 400),
        json.dumps(GROW).replace("0.1", "-Infinity"),
        json.dumps(GROW | {"deadline_seconds": 10**400}),
        json.dumps(GROW | {"options": {"random_seed": 2**63}}),
        json.dumps(GROW | {"options": {"random_seed": 1.5}}),
        json.dumps(GROW | {"scene": "a\0b"}),
        json.dumps(GROW | {"scene": "\ud800"}),
        json.dumps(GROW | {"scene": ["slider"]}),
        json.dumps(CERTIFY | {"polytope": {"C": [[1e308], [-1e308]], "d": ["1e309", 0]}}),
        "\ufeff{}",
        "null",
        "",
        "\x00",
    ],
    ids=range(17),
)
def test_odd_json_is_the_clients_fault(client: TestClient, scene: Scene, body: str) -> None:
    answer = client.post("/v1/jobs", content=body.encode(), headers=JSON)
    assert answer.status_code in (400, 413, 422), answer.text
    assert answer.headers["content-type"] == PROBLEM
    assert client.get("/v1/jobs").json()["jobs"] == []


@pytest.mark.parametrize("wrong", ["7", True, "", False], ids=repr)
@pytest.mark.parametrize(
    ("field", "body"),
    [
        ("options.random_seed", lambda value: GROW | {"options": {"random_seed": value}}),
        ("options.cells", lambda value: GROW | {"options": {"cells": value}}),
        ("options.paper.tolerance", lambda value: GROW | {"options": {"paper": {"tolerance": value}}}),
        ("priority", lambda value: GROW | {"priority": value}),
        ("seed.max_iterations", lambda value: GROW | {"seed": {**GROW["seed"], "max_iterations": value}}),
        ("seed.q[0]", lambda value: GROW | {"seed": {"q": [value]}}),
        ("random_seed", lambda value: CERTIFY | {"random_seed": value}),
    ],
)
def test_texts_and_truth_are_no_numbers(
    client: TestClient, scene: Scene, field: str, body: Callable[[object], dict[str, Any]], wrong: object
) -> None:
    answer = client.post("/v1/jobs", json=body(wrong))
    assert (answer.status_code, answer.json()["field"]) == (422, field)
    assert "valid" in answer.json()["detail"]


def requests(model: type[Request]) -> Iterator[type[Request]]:
    for one in model.__subclasses__():
        yield one
        yield from requests(one)


def test_every_whole_number_of_a_request_is_one() -> None:
    """No text stands for one, and no truth value does."""
    whole = [
        (model, name) for model in requests(Request) for name, field in model.model_fields.items() if field.annotation in (int, int | None)
    ]
    assert {"cells", "regions", "tries", "priority", "random_seed"} <= {name for _, name in whole}
    for model, name in whole:
        for wrong in ("7", True):
            with pytest.raises(ValidationError) as refused:
                model.model_validate({name: wrong})
            assert any(error["loc"] == (name,) and error["type"] == "int_type" for error in refused.value.errors())


def test_a_whole_number_may_be_written_with_a_point(client: TestClient, scene: Scene) -> None:
    answer = client.post("/v1/jobs", json=GROW | {"options": {"random_seed": 7.0}})
    assert (answer.status_code, answer.json()["options"]["random_seed"]) == (201, 7)


def test_bytes_that_are_no_text_are_the_clients_fault(client: TestClient, scene: Scene) -> None:
    assert client.post("/v1/jobs", content=b'{"kind": "\xff"}', headers=JSON).status_code in (400, 422)


Leaf = st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.sampled_from(["grow", "certify", "slider"])
Names = st.sampled_from(["kind", "scene", "seed", "polytope", "options", "q", "C", "d", "method", "webhook", "url"]) | st.text()
Documents = st.recursive(Leaf, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(Names, inner, max_size=5), max_leaves=20)


@examples(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.dictionaries(Names, Documents, min_size=1, max_size=3))
def test_any_document_is_a_job_or_a_problem(client: TestClient, scene: Scene, changes: dict[str, object]) -> None:
    body = json.dumps(GROW | changes)
    assert client.post("/v1/jobs", content=body, headers=JSON).status_code in (200, 201, 400, 404, 422)


@pytest.mark.parametrize(
    "path",
    [
        "/v1/jobs/%00",
        "/v1/jobs?after=%00",
        "/v1/jobs?after=AAAA",
        "/v1/jobs?after=MjAyNi0wMS0wMSB4",
        "/v1/jobs?limit=" + "9" * 30,
        "/v1/jobs/x/pairs?iteration=" + "9" * 30,
        "/v1/jobs/x/events?after=" + "9" * 30,
        "/v1/scenes/%ff%fe",
        "/v1/scenes?after=%C3%A9",
        "/v1/scenes/" + "x" * 5000,
        "/v1/regions?scene=%00",
        "/v1/regions?scene=",
        "/v1/jobs?scene=",
        "/v1/jobs?parent=",
    ],
)
def test_odd_addresses_are_the_clients_fault(client: TestClient, path: str) -> None:
    answer = client.get(path)
    assert answer.status_code in (404, 422), answer.text
    assert answer.headers["content-type"] == PROBLEM


def test_odd_event_ids_are_the_clients_fault(client: TestClient, scene: Scene) -> None:
    job = client.post("/v1/jobs", json=GROW).json()["id"]
    for value in ("-1", "x", "9" * 30):
        assert client.get(f"/v1/jobs/{job}/events/stream", headers={"Last-Event-ID": value}).status_code == 422


@pytest.mark.parametrize("path", ["/v1/jobs", "/v1/planning/contains", "/v1/scenes", "/v1/jobs/x/cancel", "/v1/regions/x", "/login", "/x"])
def test_no_route_takes_a_body_without_end(client: TestClient, monkeypatch: pytest.MonkeyPatch, path: str) -> None:
    monkeypatch.setattr(guard, "BODY_BYTES", 1000)
    monkeypatch.setattr(guard, "UPLOAD_BYTES", 1000)
    answer = client.post(path, content=b"x" * 2000)
    assert (answer.status_code, answer.json()["code"], answer.headers["content-type"]) == (413, "too_large", PROBLEM)


def test_only_uploads_may_be_large(client: TestClient) -> None:
    assert client.post("/v1/jobs", content=b"x", headers={"Content-Length": str(17 * 2**20)}).status_code == 413
    assert client.post("/v1/scenes", content=b"x", headers={"Content-Length": str(17 * 2**20)}).status_code != 413


def test_a_database_that_is_away_is_no_error_of_the_program(
    database: Database, client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_args: object, **_options: object) -> None:
        raise OperationalError("SELECT secret", {}, Exception("connection refused"))

    with TestClient(create_app(database), base_url=BASE_URL) as client:
        monkeypatch.setattr(jobs, "page", fail)
        answer = client.get("/v1/jobs")
        assert (answer.status_code, answer.json()["code"], answer.headers["retry-after"]) == (503, "database_unavailable", "5")
        assert "secret" not in answer.text
        monkeypatch.setattr("db.keys.find", fail)
        time.sleep(KEYS_SECONDS)
        assert client.get("/v1/scenes").status_code == 503, "the guard itself needs the database"
