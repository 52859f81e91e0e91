"""Keys over HTTP: who gets in, what a scope allows, signing in to the dashboard, and how often one may ask."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx2
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import event, text
from sqlalchemy.exc import OperationalError
from starlette.routing import Mount

from api import access
from api.access import KEYS_SECONDS, Caller, Keyring, _Needs
from api.app import create_app
from api.delivery import every
from api.guard import PUBLIC, _network
from api.limits import MAX_BUCKETS, Buckets
from certifier.errors import CirisError
from certifier.model import Scene
from ciris.synchronous.client import Client
from db import events, jobs, keys, projects, version
from db.keys import Scope
from db.session import Database
from tests.api.conftest import BASE_URL, PROBLEM
from tests.api.test_jobs import GROW
from tests.services import Queue
from tests.workers.service import eventually


def a_key(database: Database, scope: Scope, name: str | None = None) -> str:
    with database.write() as session:
        return keys.add(session, name or scope, scope)


def bearer(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


def the_keys_are_read_again() -> None:
    time.sleep(KEYS_SECONDS)


def test_nobody_needs_a_key_until_there_is_one(client: TestClient, database: Database) -> None:
    assert client.get("/v1/jobs").status_code == 200
    key = a_key(database, Scope.READ)
    the_keys_are_read_again()
    refused = client.get("/v1/jobs")
    assert (refused.status_code, refused.json()["code"], refused.headers["content-type"]) == (401, "key_needed", PROBLEM)
    assert refused.headers["www-authenticate"] == "Bearer"
    assert client.get("/v1/jobs", headers=bearer(key)).status_code == 200
    with database.write() as session:
        keys.revoke(session, "read")
    the_keys_are_read_again()
    for headers in ({}, bearer(key)):
        assert client.get("/v1/jobs", headers=headers).status_code == 401


@pytest.mark.parametrize("header", ["Bearer", "Bearer ", "Bearer x", "Basic eDp5", "Bearer ciris_000000000000_" + 43 * "a", "Bearer \xe9"])
def test_what_is_no_key_is_refused(client: TestClient, database: Database, header: str) -> None:
    a_key(database, Scope.READ)
    answer = client.get("/v1/jobs", headers={"Authorization": header.encode("latin-1")})
    assert (answer.status_code, answer.json()["code"]) == (401, "key_needed")


def test_a_service_that_others_can_reach_needs_keys_from_the_start(database: Database, environment: pytest.MonkeyPatch) -> None:
    environment.setenv("CIRIS_HOST", "0.0.0.0")
    with TestClient(create_app(database), base_url="http://robots.example") as client:
        assert client.get("/v1/jobs").status_code == 401
        assert client.get("/healthz").status_code == 200


SCOPES = [
    ("GET", "/v1/jobs", Scope.READ),
    ("GET", "/metrics", Scope.READ),
    ("GET", "/", Scope.READ),
    ("POST", "/v1/planning/contains", Scope.READ),
    ("POST", "/v1/planning/certify-path", Scope.SUBMIT),
    ("GET", "/v1/planning/motions/x/proof", Scope.READ),
    ("POST", "/v1/scenes", Scope.SUBMIT),
    ("POST", "/v1/jobs", Scope.SUBMIT),
    ("POST", "/v1/jobs/x/cancel", Scope.SUBMIT),
    ("POST", "/v1/jobs/x/retry", Scope.SUBMIT),
    ("DELETE", "/v1/regions/x", Scope.ADMIN),
]


@pytest.mark.parametrize(("method", "path", "needed"), SCOPES)
def test_a_scope_allows_what_it_says(client: TestClient, database: Database, method: str, path: str, needed: Scope) -> None:
    for scope in Scope:
        answer = client.request(method, path, headers=bearer(a_key(database, scope)))
        assert (answer.status_code == 403) == (not scope.includes(needed)), scope
        if answer.status_code == 403:
            assert answer.json()["code"] == "scope_missing"
            assert needed.value in answer.json()["detail"]


def test_every_route_asks_for_a_scope_or_is_public(database: Database) -> None:
    routes = list(every(create_app(database).routes))
    assert {route.path for route in routes if isinstance(route, Mount)} == {"/static"}
    asked = [route for route in routes if hasattr(route, "dependant") and route.path not in PUBLIC]
    assert len(asked) > 70
    for route in asked:
        own = route.dependant.dependencies
        calls = [one.call for dependency in own for one in (dependency, *dependency.dependencies)]
        assert any(isinstance(call, _Needs) for call in calls), route.path


def test_a_body_is_not_read_before_the_key(client: TestClient, database: Database) -> None:
    a_key(database, Scope.READ)

    def body() -> Iterator[bytes]:
        raise AssertionError("the body was asked for")
        yield b""

    answer = client.post("/v1/jobs", content=body(), headers={"Content-Length": "10", "Content-Type": "application/json"})
    assert answer.status_code == 401


def test_a_job_is_its_keys(client: TestClient, database: Database, scene: Scene) -> None:
    ours, theirs = a_key(database, Scope.SUBMIT, "ours"), a_key(database, Scope.SUBMIT, "theirs")
    first = client.post("/v1/jobs", json=GROW, headers=bearer(ours) | {"Idempotency-Key": "1"})
    same = client.post("/v1/jobs", json=GROW, headers=bearer(ours) | {"Idempotency-Key": "1"})
    other = client.post("/v1/jobs", json=GROW, headers=bearer(theirs) | {"Idempotency-Key": "1"})
    assert (first.status_code, same.status_code, other.status_code) == (201, 200, 201)
    assert other.json()["id"] != first.json()["id"] == same.json()["id"]
    with database.read() as session:
        assert jobs.get(session, first.json()["id"]).key_id == ours.split("_")[1]


def test_an_idempotency_key_cannot_take_the_place_of_a_retry(client: TestClient, scene: Scene) -> None:
    job = client.post("/v1/jobs", json=GROW).json()
    client.post(f"/v1/jobs/{job['id']}/cancel")
    planted = client.post("/v1/jobs", json=GROW, headers={"Idempotency-Key": f"retry:{job['id']}"}).json()
    assert client.post(f"/v1/jobs/{job['id']}/retry").json()["id"] != planted["id"]


def test_a_stream_is_taken_up_with_a_key(url: str, database: Database, scene: Scene) -> None:
    key = a_key(database, Scope.READ)
    with database.write() as session:
        job, _ = jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"random_seed": 0})
        events.emit(session, job, "pairs", {})
        jobs.finish(session, job, jobs.JobState.CANCELLED, reason="")
    stream = f"{url}/v1/jobs/{job.id}/events/stream"
    assert httpx2.get(stream, headers={"Last-Event-ID": "1"}).status_code == 401
    text = httpx2.get(stream, headers={"Last-Event-ID": "1", **bearer(key)}).text
    assert [line for line in text.splitlines() if line.startswith("id: ")] == ["id: 2", "id: 3"]
    with Client(url, key) as client:
        assert [event["seq"] for event in client.events(job.id)] == [1, 2, 3]


def test_signing_in_and_out(client: TestClient, database: Database) -> None:
    key = a_key(database, Scope.READ)
    html = {"Accept": "text/html"}
    away = client.get("/jobs/x", headers=html, follow_redirects=False)
    assert (away.status_code, away.headers["location"]) == (303, "/login?next=/jobs/x")
    page = client.get(away.headers["location"], headers=html)
    assert 'name="next" value="/jobs/x"' in page.text

    wrong = client.post("/login", data={"key": "guess"}, headers=html)
    assert wrong.status_code == 401
    assert "guess" not in wrong.text

    right = client.post("/login", data={"key": key, "next": "/jobs"}, follow_redirects=False)
    assert (right.status_code, right.headers["location"]) == (303, "/jobs")
    cookie = right.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert client.get("/", headers=html).status_code == 200
    assert client.get("/v1/jobs").status_code == 200
    assert ">read · default · read</span>" in client.get("/").text

    client.post("/logout")
    assert client.get("/v1/jobs").status_code == 401


@pytest.mark.parametrize(
    "path", ["//evil.example", "https://evil.example", "/\\evil.example", "/a//b", "/a?b=//evil.example", "javascript:alert(1)", ""]
)
def test_signing_in_leads_nowhere_else(client: TestClient, database: Database, path: str) -> None:
    answer = client.post("/login", data={"key": a_key(database, Scope.READ), "next": path}, follow_redirects=False)
    assert answer.headers["location"] == "/"


def test_the_cookie_stays_on_encrypted_connections_where_there_are_any(database: Database, environment: pytest.MonkeyPatch) -> None:
    environment.setenv("CIRIS_HOST", "0.0.0.0")
    with TestClient(create_app(database), base_url="https://robots.example") as client:
        answer = client.post("/login", data={"key": a_key(database, Scope.READ)}, follow_redirects=False)
    assert "secure" in answer.headers["set-cookie"].lower()


@pytest.fixture
def hasty(database: Database, environment: pytest.MonkeyPatch) -> Iterator[TestClient]:
    """A service that answers two requests a second, four at once."""
    environment.setenv("CIRIS_REQUESTS_PER_SECOND", "2")
    with TestClient(create_app(database), base_url=BASE_URL) as client:
        yield client


def test_who_asks_too_often_is_to_wait(hasty: TestClient, database: Database) -> None:
    assert [hasty.get("/v1/jobs").status_code for _ in range(4)] == [200] * 4
    refused = next(answer for _ in range(100) if (answer := hasty.get("/v1/jobs")).status_code != 200)
    assert (refused.status_code, refused.json()["code"], refused.headers["retry-after"]) == (429, "too_many_requests", "1")


def test_health_checks_are_answered_whoever_else_asks_from_their_address(
    database: Database, queue: Queue, environment: pytest.MonkeyPatch
) -> None:
    environment.setenv("CIRIS_REDIS_URL", queue.url)
    environment.setenv("CIRIS_REQUESTS_PER_SECOND", "0.02")
    a_key(database, Scope.READ)
    with TestClient(create_app(database), base_url=BASE_URL) as client:
        while client.get("/v1/jobs", headers=bearer("x")).status_code == 401:
            pass
        for path in ("/healthz", "/readyz"):
            assert {client.get(path).status_code for _ in range(20)} == {200}
        assert client.get("/login").status_code == 429, "what else needs no key is counted"


def test_every_key_has_its_own_rate(hasty: TestClient, database: Database) -> None:
    one, other = a_key(database, Scope.READ, "one"), a_key(database, Scope.READ, "other")
    while hasty.get("/v1/jobs", headers=bearer(one)).status_code == 200:
        pass
    assert hasty.get("/v1/jobs", headers=bearer(other)).status_code == 200


def test_all_keys_of_a_project_have_a_rate_together(database: Database, environment: pytest.MonkeyPatch) -> None:
    environment.setenv("CIRIS_REQUESTS_PER_SECOND", "5")
    with database.write() as session:
        projects.add(session, "other")
        many = [keys.add(session, f"key{i}", Scope.READ) for i in range(6)]
        other = keys.add(session, "other", Scope.READ, "other")
    with TestClient(create_app(database), base_url=BASE_URL) as client:
        asked = (client.get("/v1/project", headers=bearer(key)) for _ in range(9) for key in many)
        refused = next(answer for answer in asked if answer.status_code != 200)
        assert (refused.status_code, refused.json()["detail"]) == (429, "more requests than one project may make")
        assert client.get("/v1/project", headers=bearer(other)).status_code == 200


def test_guessing_keys_is_slow(hasty: TestClient, database: Database) -> None:
    a_key(database, Scope.READ)
    statuses = (hasty.get("/v1/jobs", headers=bearer(f"guess{i}")).status_code for i in range(100))
    assert next(status for status in statuses if status != 401) == 429


@contextmanager
def readings(database: Database, of: str = "api_keys") -> Iterator[list[str]]:
    """Grows by one with every reading of the keys, or of something else."""
    seen: list[str] = []

    def look(_connection: object, _cursor: object, statement: str, *_: object) -> None:
        if of in statement:
            seen.append(statement)

    event.listen(database.reader, "before_cursor_execute", look)
    yield seen
    event.remove(database.reader, "before_cursor_execute", look)


def an_invented_key() -> str:
    return f"ciris_{secrets.token_hex(6)}_{secrets.token_urlsafe(32)}"


def test_strangers_wait_before_anything_is_read_for_them(hasty: TestClient, database: Database) -> None:
    key = a_key(database, Scope.READ)
    assert hasty.get("/v1/jobs", headers=bearer(key)).status_code == 200
    while hasty.get("/v1/jobs", headers=bearer(an_invented_key())).status_code == 401:
        pass
    with readings(database) as seen:
        began = time.monotonic()
        statuses = [hasty.get("/v1/jobs", headers=bearer(an_invented_key())).status_code for _ in range(50)]
        allowed = statuses.count(401)
        assert statuses.count(429) == 50 - allowed
        assert len(seen) <= allowed + 1 + (time.monotonic() - began) / KEYS_SECONDS
    assert hasty.get("/v1/jobs", headers=bearer(key)).status_code == 200, "who has a key does not wait for those behind the same address"


def test_a_wrong_secret_counts_against_the_address_and_reads_nothing(hasty: TestClient, database: Database) -> None:
    key = a_key(database, Scope.READ)
    guess = key[:19] + secrets.token_urlsafe(32)
    assert hasty.get("/v1/jobs", headers=bearer(key)).status_code == 200
    with readings(database) as seen:
        began = time.monotonic()
        statuses = (hasty.get("/v1/jobs", headers=bearer(guess)).status_code for _ in range(100))
        assert next(status for status in statuses if status != 401) == 429
        assert len(seen) <= 2 + 2 * (time.monotonic() - began) / KEYS_SECONDS
    assert hasty.get("/v1/jobs", headers=bearer(key)).status_code == 200


def test_of_many_unknown_keys_at_once_one_has_the_keys_read(database: Database) -> None:
    a_key(database, Scope.READ)
    keyring = Keyring(database, open_without_keys=False)

    async def ask() -> list[Caller | None]:
        assert await keyring.caller(None) is None
        new = a_key(database, Scope.ADMIN)
        with readings(database) as seen:
            found = await asyncio.gather(*(keyring.newcomer(given) for given in [*(an_invented_key() for _ in range(100)), new]))
        assert len(seen) == 1
        return found

    *strangers, caller = asyncio.run(ask())
    assert set(strangers) == {None}
    assert caller is not None
    assert caller.scope == Scope.ADMIN
    assert set(keyring._known) == {caller.key_id}, "nothing is kept of what strangers sent"


def test_keys_in_use_are_read_again_together_and_others_are_not(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(access, "TOGETHER", 5)
    used, unused = [a_key(database, Scope.READ, f"used{i}") for i in range(5)], a_key(database, Scope.READ, "unused")
    keyring = Keyring(database, open_without_keys=False)

    async def ask() -> list[str]:
        for key in (unused, *used):
            assert await keyring.newcomer(key) is not None
        await asyncio.sleep(KEYS_SECONDS)
        with readings(database) as seen:
            assert None not in await asyncio.gather(*(keyring.caller(key) for key in used))
            for _ in range(20):
                await asyncio.sleep(KEYS_SECONDS / 10)
                assert await keyring.caller(used[0]) is not None
            read = len(seen)
            assert None not in await asyncio.gather(*(keyring.caller(key) for key in used))
            assert len(seen) <= read + 1, "what one request has had read is read for all that were used lately"
            assert await keyring.caller(unused) is not None
            assert read < len(seen) <= read + 3
        return seen

    assert all(one.count("?") + one.count("%(") <= 6 for one in asyncio.run(ask())), "those used lately, and the one that is asked for"


def uses(database: Database) -> dict[str, bool]:
    """Name of each key -> whether it is noted that it was used."""
    with database.read() as session:
        return {row.name: row.last_used_at is not None for row in keys.newest(session)}


def test_the_use_of_a_key_is_noted_once_in_ten_minutes(client: TestClient, database: Database) -> None:
    used, _, gone = (a_key(database, Scope.READ, name) for name in ("used", "unused", "gone"))
    with database.write() as session:
        keys.revoke(session, "gone")
    writes: list[str] = []
    event.listen(database.writer, "before_cursor_execute", lambda c, cursor, statement, *_: writes.append(statement))
    for _ in range(50):
        assert client.get("/v1/jobs", headers=bearer(used)).status_code == 200
    for refused in (gone, used[:19] + secrets.token_urlsafe(32)):
        assert client.get("/v1/jobs", headers=bearer(refused)).status_code == 401
    eventually(lambda: uses(database)["used"], "the use is noted")
    the_keys_are_read_again()
    assert client.get("/v1/jobs", headers=bearer(used)).status_code == 200
    time.sleep(0.2)
    assert uses(database) == {"used": True, "unused": False, "gone": False}
    assert sum("UPDATE api_keys" in statement for statement in writes) == 1


def test_no_request_waits_for_the_note_that_its_key_was_used(client: TestClient, database: Database) -> None:
    key = a_key(database, Scope.READ)
    the_keys_are_read_again()
    with database.write() as session:  # which nobody else can meanwhile
        session.execute(text("SELECT 1"))
        began = time.monotonic()
        for _ in range(5):
            assert client.get("/v1/jobs", headers=bearer(key)).status_code == 200
        assert time.monotonic() - began < 5.0
        assert uses(database) == {"read": False}
    eventually(lambda: uses(database)["read"], "the use is noted")


def test_a_use_that_cannot_be_noted_is_noted_later(
    client: TestClient, database: Database, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("api.access.NOTES_SECONDS", 0.0)
    key = a_key(database, Scope.READ)

    def fail(*_: object) -> None:
        raise OperationalError("UPDATE", {}, Exception("the disk is full"))

    with monkeypatch.context() as patch:
        patch.setattr(keys, "note_use", fail)
        assert client.get("/v1/jobs", headers=bearer(key)).status_code == 200
        eventually(lambda: "could not be noted" in caplog.text, "the log says so")
    assert client.get("/v1/jobs", headers=bearer(key)).status_code == 200
    eventually(lambda: uses(database)["read"], "the use is noted")


def test_a_key_that_has_expired_is_refused(client: TestClient, database: Database) -> None:
    with database.write() as session:
        key = keys.add(session, "visitor", Scope.READ, days=4.0 / 86400)
    answers = [client.get("/v1/jobs", headers=bearer(key)).status_code]
    time.sleep(4.2)
    assert [*answers, client.get("/v1/jobs", headers=bearer(key)).status_code] == [200, 401]


def test_keys_that_cannot_be_read_let_nobody_in_and_are_read_again(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    key = a_key(database, Scope.READ)
    keyring = Keyring(database, open_without_keys=True)

    def fail(*_: object) -> None:
        raise OperationalError("SELECT 1", {}, Exception("connection refused"))

    async def ask() -> Caller | None:
        with monkeypatch.context() as patch:
            patch.setattr(keys, "find", fail)
            failures = await asyncio.gather(keyring.newcomer(key), keyring.caller(None), return_exceptions=True)
        assert [type(failure) for failure in failures] == [OperationalError] * 2
        return await keyring.newcomer(key)

    caller = asyncio.run(ask())
    assert caller is not None
    assert caller.scope == Scope.READ


@pytest.mark.parametrize(
    ("address", "network"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("testclient", "testclient"),
    ],
)
def test_an_address_is_counted_with_those_that_its_holder_has_too(address: str, network: str) -> None:
    assert _network({"client": (address, 1)}) == network


@pytest.fixture
def hasty_url(environment: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> str:
    environment.setenv("CIRIS_REQUESTS_PER_SECOND", "4")
    return str(request.getfixturevalue("url"))


def test_the_python_client_waits_and_asks_again(hasty_url: str) -> None:
    with Client(hasty_url) as client:
        for _ in range(10):
            client.scenes()
    assert 'ciris_http_requests_total{method="GET",status="429"}' in httpx2.get(f"{hasty_url}/metrics").text


def test_a_bucket_fills_with_time_and_no_further() -> None:
    now = [0.0]
    buckets = Buckets(2.0, clock=lambda: now[0])
    assert [buckets.take("a") for _ in range(5)] == [0, 0, 0, 0, 0.5]
    now[0] += 0.5
    assert buckets.take("a") == 0
    assert buckets.take("a") > 0
    now[0] += 1000
    assert [buckets.take("a") > 0 for _ in range(5)] == [False] * 4 + [True]


def test_strangers_cannot_fill_the_memory() -> None:
    buckets = Buckets(1.0)
    for i in range(2 * MAX_BUCKETS):
        buckets.take(str(i))
    assert len(buckets._buckets) == MAX_BUCKETS


@pytest.mark.parametrize("value", ["", "two words", "na\u00efve"])
def test_a_key_that_cannot_be_sent_is_refused_without_being_shown(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    from ciris.find import api_key

    monkeypatch.setenv("CIRIS_API_KEY", value)
    if not value:
        assert api_key() is None
        return
    with pytest.raises(CirisError) as caught:
        api_key()
    assert value not in str(caught.value)


def test_a_database_of_another_version_is_not_served(client: TestClient, database: Database) -> None:
    def at(revision: str) -> None:
        with database.writer.begin() as connection:
            connection.execute(text("UPDATE alembic_version SET version_num = :revision"), {"revision": revision})

    assert client.get("/v1/jobs").status_code == 200
    at("9999")
    time.sleep(KEYS_SECONDS)
    for method, route in (("GET", "/v1/jobs"), ("GET", "/"), ("POST", "/v1/scenes")):
        answer = client.request(method, route)
        assert answer.status_code == 503
        assert "the database is at revision 9999, and this version of ciris" in answer.text
    assert client.get("/v1/jobs").json()["code"] == "database_version"
    ready = client.get("/readyz")
    assert (ready.status_code, client.get("/healthz").status_code) == (503, 200)
    assert ready.json()["checks"]["database"].startswith("the database is at revision 9999")
    at(version.revisions()[-1])
    assert client.get("/v1/jobs").status_code == 200
    assert client.get("/readyz").json()["checks"]["database"] == "ok"
