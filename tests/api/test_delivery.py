"""How answers travel: HEAD, Allow, entity tags and compression, on every operation of the OpenAPI document."""

from __future__ import annotations

import re
import time
from typing import Any

import httpx2
import pytest
from fastapi.testclient import TestClient

from api import delivery
from api.app import create_app
from db.session import Database
from tests.api.conftest import PROBLEM

METHODS = ("GET", "PUT", "POST", "PATCH", "DELETE")
NEVER_THE_SAME = {"/metrics"}
"""Their answer counts the requests before it."""


@pytest.fixture(autouse=True)
def often(environment: pytest.MonkeyPatch) -> None:
    """These tests ask more often than a client may."""
    environment.setenv("CIRIS_REQUESTS_PER_SECOND", "10000")


@pytest.fixture
def things(client: TestClient, region: str, busy: str) -> dict[str, str]:
    """Values for what stands in braces in the addresses of the document."""
    (job,) = [job for job in client.get("/v1/jobs").json()["jobs"] if job["region"] == region]
    (worker,) = client.get("/v1/workers").json()["workers"]
    known = {"region_id": region, "job_id": job["id"], "scene_id": job["scene"], "worker_id": worker["id"], "pair": "0"}
    return known | {"motion_id": "none", "name": "none", "scene_name": "slider", "project": "default"}


def addresses(client: TestClient, things: dict[str, str]) -> dict[str, set[str]]:
    """Every address of the document, filled in, with all methods that some operation there has."""
    paths: dict[str, dict[str, Any]] = client.get("/openapi.json").json()["paths"]
    patterns = {re.compile(re.sub(r"\{\w+\}", "[^/]+", path)): {method.upper() for method in methods} for path, methods in paths.items()}
    filled = [re.sub(r"\{(\w+)\}", lambda name: things[name[1]], path) for path in paths]
    return {path: set().union(*(has for pattern, has in patterns.items() if pattern.fullmatch(path))) for path in filled}


def test_head_is_get_without_the_body(client: TestClient, things: dict[str, str]) -> None:
    asked = 0
    for path, methods in addresses(client, things).items():
        if "GET" not in methods or path.endswith("/stream"):
            continue
        for query in ("", "?scene=slider", "?iteration=0"):
            whole, head = client.get(path + query), client.head(path + query)
            if whole.status_code < 400:
                break
        assert (head.status_code, head.content) == (whole.status_code, b""), path
        headers = [{name: value for name, value in answer.headers.items() if name != "date"} for answer in (whole, head)]
        assert headers[0] == headers[1] or path in NEVER_THE_SAME, path
        asked += whole.status_code == 200
    assert asked > 30


def test_head_of_a_stream_ends(url: str, running: str) -> None:
    for path in (f"/v1/jobs/{running}/events/stream", "/v1/events/stream"):
        answer = httpx2.head(url + path, timeout=10)
        assert (answer.status_code, answer.content) == (200, b"")
        assert answer.headers["content-type"].startswith("text/event-stream")


def test_the_pages_have_head_too(client: TestClient, things: dict[str, str]) -> None:
    for path in ("/", "/workers", f"/jobs/{things['job_id']}", "/static/ciris.css"):
        assert client.head(path).status_code == 200, path


def test_allow_names_all_methods_of_the_address(client: TestClient, things: dict[str, str]) -> None:
    for path, methods in addresses(client, things).items():
        allowed = methods | ({"HEAD"} if "GET" in methods else set())
        for method in (*METHODS, "HEAD"):
            if method in allowed:
                continue
            answer = client.request(method, path)
            assert answer.status_code == 405, (method, path)
            assert set(answer.headers["allow"].split(", ")) == allowed, (method, path)
            assert method == "HEAD" or answer.headers["content-type"] == PROBLEM


def test_allow_names_the_methods_of_files(client: TestClient) -> None:
    for method in ("DELETE", "POST"):
        answer = client.request(method, "/static/ciris.css")
        assert (answer.status_code, answer.headers["allow"]) == (405, "GET, HEAD")


UNCHANGING = {
    "download_free_set",
    "download_kept_proof",
    "download_map_proof",
    "download_motion_proof",
    "download_pair_proof",
    "download_region_proof",
    "export_region",
    "get_region",
    "get_region_cells",
    "get_region_pairs",
    "get_scene",
    "get_scene_lint",
    "get_scene_meshes",
    "get_scene_model",
    "get_scene_pairs",
}


def test_what_does_not_change_is_sent_once(client: TestClient, database: Database, things: dict[str, str]) -> None:
    routes = delivery.every(create_app(database).routes)
    marked = {route.name: route.path for route in routes if delivery.is_unchanging(getattr(route, "endpoint", None))}
    assert set(marked) == UNCHANGING
    asked = set()
    for name, template in marked.items():
        path = re.sub(r"\{(\w+)\}", lambda place: things[place[1]], template)
        first = client.get(path, params={"iteration": 0} if name == "download_pair_proof" else {})
        if first.status_code != 200:
            assert "etag" not in first.headers, name
            continue
        asked.add(name)
        assert first.headers["cache-control"] == "private, no-cache"
        tag = first.headers["etag"]
        for given in (tag, tag.removeprefix("W/"), f'"other", {tag}', "*"):
            again = client.get(first.request.url, headers={"If-None-Match": given})
            assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag), (name, given)
            assert "content-type" not in again.headers
            assert again.headers["vary"] == "Accept-Encoding"
        other = client.get(first.request.url, headers={"If-None-Match": '"other"'})
        assert (other.status_code, other.content) == (200, first.content)
        assert client.head(first.request.url, headers={"If-None-Match": tag}).status_code == 304
    assert {"download_region_proof", "get_region", "export_region", "get_scene", "get_scene_model", "get_scene_pairs"} <= asked


def test_files_that_did_not_change_vary_too(client: TestClient) -> None:
    tag = client.get("/static/ciris.css").headers["etag"]
    again = client.get("/static/ciris.css", headers={"If-None-Match": tag})
    assert (again.status_code, again.headers["vary"]) == (304, "Accept-Encoding")


@pytest.mark.parametrize(
    ("accepted", "compressed"),
    [
        ("gzip", True),
        ("gzip;q=0", False),
        ("gzip;q=0.0, deflate", False),
        ("br, GZIP; q=0.5", True),
        ("*", True),
        ("*;q=0", False),
        ("gzip;q=0, *", False),
        ("identity", False),
        ("notgzip", False),
        ("gzip;q=much", False),
        ("", False),
    ],
)
def test_only_those_who_take_gzip_get_it(client: TestClient, accepted: str, compressed: bool) -> None:
    answer = client.get("/openapi.json", headers={"Accept-Encoding": accepted})
    assert ("content-encoding" in answer.headers, answer.headers["vary"]) == (compressed, "Accept-Encoding")
    assert answer.json()["openapi"]


def test_what_is_named_anew_has_another_tag(client: TestClient, things: dict[str, str]) -> None:
    path = f"/v1/regions/{things['region_id']}/export"
    tags = [client.get(path, params={"name": name}).headers["etag"] for name in ("one", "two")]
    assert tags[0] != tags[1]


def test_a_revoked_tag_says_nothing_of_what_was_deleted(client: TestClient, things: dict[str, str]) -> None:
    path = f"/v1/regions/{things['region_id']}"
    tag = client.get(path).headers["etag"]
    assert client.delete(path).status_code == 204
    assert client.get(path, headers={"If-None-Match": tag}).status_code == 404


def test_large_answers_are_compressed_and_files_and_streams_are_not(client: TestClient, url: str, things: dict[str, str]) -> None:
    squeezed = {"Accept-Encoding": "gzip"}
    plain, small = (client.get("/openapi.json", headers=headers) for headers in ({"Accept-Encoding": "identity"}, squeezed))
    assert small.headers["content-encoding"] == "gzip"
    assert "Accept-Encoding" in small.headers["vary"]
    assert (small.json(), "content-encoding" in plain.headers) == (plain.json(), False)
    assert int(small.headers["content-length"]) < int(plain.headers["content-length"]) / 4
    assert "content-encoding" not in client.get("/healthz", headers=squeezed).headers, "it is short"
    assert "content-encoding" not in client.get(f"/v1/regions/{things['region_id']}/proof", headers=squeezed).headers
    began = time.monotonic()
    with httpx2.stream("GET", f"{url}/v1/jobs/{things['job_id']}/events/stream", headers=squeezed, timeout=10) as stream:
        assert "content-encoding" not in stream.headers
        assert next(stream.iter_text()).strip()
    assert time.monotonic() - began < 5
