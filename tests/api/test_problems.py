"""Every error is problem+json, and other web sites are kept out."""

import gzip
import re
from http import HTTPStatus
from typing import Any

import pytest
from fastapi.testclient import TestClient
from starlette.exceptions import HTTPException

from api import problems
from api.app import create_app
from db import jobs
from db.session import Database
from tests.api.conftest import BASE_URL, PROBLEM
from tests.docs.errors import PAGE


@pytest.mark.parametrize(
    ("method", "path", "status", "code"),
    [
        ("GET", "/v1/nothing", 404, "not_found"),
        ("PUT", "/v1/jobs", 405, "method_not_allowed"),
        ("GET", "/v1/regions?limit=0", 422, "invalid_request"),
    ],
)
def test_errors_of_the_framework_are_problems_too(client: TestClient, method: str, path: str, status: int, code: str) -> None:
    answer = client.request(method, path)
    problem = answer.json()
    assert (answer.status_code, problem["status"], problem["code"]) == (status, status, code)
    assert answer.headers["content-type"] == PROBLEM
    assert problem["type"] == f"urn:ciris:problem:{code}"


def test_a_body_that_is_not_json_is_a_bad_request(client: TestClient) -> None:
    answer = client.post("/v1/jobs", content="{", headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (400, "malformed_json")


@pytest.mark.parametrize("headers", [{"Content-Type": "text/plain"}, {"Content-Type": "application/x-www-form-urlencoded"}, {}])
def test_a_body_that_is_not_said_to_be_json_is_refused_for_that(client: TestClient, headers: dict[str, str]) -> None:
    problem = client.post("/v1/jobs", content=b'{"kind": "grow"}', headers=headers).json()
    said = problem["status"], problem["code"], problem["field"], problem["detail"], problem["hint"]
    hint = "send `Content-Type: application/json`"
    assert said == (422, "invalid_request", "Content-Type", "the body is not said to be JSON", hint)


def test_every_code_that_the_service_answers_is_described(client: TestClient) -> None:
    """Those that the OpenAPI document names, those that have a status, and those of any status of the framework."""
    paths = client.get("/openapi.json").json()["paths"].values()
    answers = [answer for path in paths for operation in path.values() for answer in operation["responses"].values()]
    said = [answer["description"] for answer in answers if PROBLEM in answer.get("content", {})]
    named = {code for text in said for code in re.findall(r"`(\w+)`", text)}
    framework = {problems._http(HTTPException(status)).code for status in HTTPStatus if status >= HTTPStatus.BAD_REQUEST}
    assert framework == {"bad_request", "internal", "method_not_allowed", "not_found", "too_large"}
    assert {"scene_not_found", "invalid_request"} <= named
    described = set(re.findall(r"^\| `(\w+)` \|", PAGE.read_text(), re.MULTILINE))
    assert named | framework | set(problems._STATUS_OF_CODE) <= described


def test_a_parameter_that_a_route_does_not_have_is_refused(client: TestClient) -> None:
    problem = client.get("/v1/jobs?scnee=slider").json()
    assert (problem["status"], problem["code"], problem["field"]) == (422, "invalid_request", "scnee")
    assert problem["detail"] == "there is no parameter 'scnee' here"
    assert "scene" in problem["hint"]


def test_no_route_of_the_interface_takes_an_unknown_parameter(client: TestClient) -> None:
    asked = 0
    for path, operations in client.get("/openapi.json").json()["paths"].items():
        for method in operations:
            answer = client.request(method, re.sub(r"\{\w+\}", "1", path), params={"misspelt": "1"}, json={} if method == "post" else None)
            if not path.startswith("/v1/"):
                assert answer.status_code in (200, 503), path
                continue
            problem = answer.json()
            assert (answer.status_code, problem["field"]) == (422, "misspelt"), (method, path)
            asked += 1
    assert asked > 50


def test_a_parameter_that_has_one_value_is_not_given_twice(client: TestClient) -> None:
    asked = 0
    for path, operations in client.get("/openapi.json").json()["paths"].items():
        for parameter in operations.get("get", {}).get("parameters", []):
            if parameter["in"] != "query" or not path.startswith("/v1/"):
                continue
            name, several = parameter["name"], any(s.get("type") == "array" for s in _schemas(parameter["schema"]))
            problem = client.get(re.sub(r"\{\w+\}", "1", path), params={name: ["1", "2"]}).json()
            assert (problem.get("detail") == "is given more than once" and problem["field"] == name) != several, (path, name)
            asked += 1
    assert asked > 40


def _schemas(schema: dict[str, Any]) -> list[dict[str, Any]]:
    return [schema, *schema.get("anyOf", [])]


def test_labels_may_be_several(client: TestClient) -> None:
    assert client.get("/v1/jobs", params={"label": ["a=1", "b=2"]}).json()["jobs"] == []


@pytest.mark.parametrize("encoding", ["gzip", "br", "GZIP", "gzip, br"])
def test_a_body_that_is_compressed_is_refused_for_that(client: TestClient, encoding: str) -> None:
    answer = client.post(
        "/v1/jobs", content=gzip.compress(b"{}"), headers={"Content-Encoding": encoding, "Content-Type": "application/json"}
    )
    problem = answer.json()
    assert (answer.status_code, problem["code"], problem["field"]) == (415, "content_encoding", "Content-Encoding")
    assert problem["hint"] == "send it as it is, without Content-Encoding"
    assert client.post("/v1/jobs", json={}, headers={"Content-Encoding": "identity"}).status_code == 422


def test_no_route_takes_the_last_of_two_values_with_one_key(client: TestClient) -> None:
    asked = 0
    for path, operations in client.get("/openapi.json").json()["paths"].items():
        for method, operation in operations.items():
            if "application/json" not in operation.get("requestBody", {}).get("content", {}):
                continue
            body = '{"a": [{"b": {"\\u0063": 1, "d": 2, "c": 3}}]}'
            headers = {"Content-Type": "application/json"}
            answer = client.request(method, re.sub(r"\{\w+\}", "1", path), content=body, headers=headers)
            problem = answer.json()
            assert (answer.status_code, problem["detail"]) == (422, 'an object has the key "c" twice'), (method, path)
            assert (problem["code"], problem["field"], problem["hint"]) == ("invalid_request", "body", "leave one of them out")
            asked += 1
    assert asked > 10


def test_no_answer_repeats_a_long_name_whole(client: TestClient) -> None:
    long = "x" * 5000
    for answer in (
        client.get(f"/v1/scenes/{long}"),
        client.get(f"/v1/jobs/{long}"),
        client.get("/v1/jobs", params={long: "1"}),
        client.post("/v1/jobs", json={"kind": "grow", long: 1}),
    ):
        assert answer.status_code in (404, 422)
        assert "x" * 1000 not in answer.text


def test_every_wrong_field_is_listed(client: TestClient) -> None:
    problem = client.post("/v1/jobs", json={"kind": "grow", "seed": {"q": []}, "options": {"a": 1}}).json()
    assert {error["field"] for error in problem["errors"]} == {"scene", "seed.q", "options.a"}


@pytest.mark.parametrize(
    ("method", "path", "body", "field", "said"),
    [
        ("GET", "/v1/jobs?label=red", None, "label[0]", "it must be a label, NAME=VALUE"),
        ("POST", "/v1/jobs", {"scene": "slider"}, "kind", "it must be one of grow, certify, recertify, certify-path, cover, map"),
        ("POST", "/v1/jobs", {"kind": "dance"}, "kind", "it must be one of grow, certify, recertify, certify-path, cover, map"),
        ("POST", "/v1/jobs/batch", {"jobs": [{}]}, "jobs[0].kind", "it must be one of grow, certify, recertify, certify-path, cover, map"),
    ],
)
def test_what_is_wrong_is_said_in_words(client: TestClient, method: str, path: str, body: Any, field: str, said: str) -> None:
    answer = client.request(method, path, json=body)
    assert (answer.status_code, answer.json()["field"], answer.json()["detail"]) == (422, field, said)


def test_an_unexpected_error_tells_nothing_of_the_inside(database: Database, client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_args: object, **_options: object) -> None:
        raise RuntimeError("a secret")

    with TestClient(create_app(database), base_url=BASE_URL, raise_server_exceptions=False) as quiet:
        monkeypatch.setattr(jobs, "page", fail)
        answer = quiet.get("/v1/jobs")
    assert (answer.status_code, answer.json()["code"]) == (500, "internal")
    assert "secret" not in answer.text


def test_people_see_a_page_instead(client: TestClient) -> None:
    answer = client.get("/jobs/nope", headers={"Accept": "text/html"})
    assert answer.status_code == 404
    assert answer.headers["content-type"].startswith("text/html")
    assert "there is no job" in answer.text


def test_another_site_cannot_change_anything(client: TestClient) -> None:
    foreign = client.post("/v1/jobs/x/cancel", headers={"Origin": "https://evil.example"})
    assert (foreign.status_code, foreign.json()["code"]) == (403, "cross_site")
    own = client.post("/v1/jobs/x/cancel", headers={"Origin": BASE_URL})
    assert own.status_code == 404


@pytest.mark.parametrize(("host", "status"), [("evil.example", 421), ("localhost:8643", 200), ("127.0.0.1", 200), ("[::1]:8643", 200)])
def test_the_loopback_service_answers_only_to_loopback_names(client: TestClient, host: str, status: int) -> None:
    assert client.get("/healthz", headers={"Host": host}).status_code == status
