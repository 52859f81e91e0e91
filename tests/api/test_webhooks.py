"""Webhooks over HTTP: what may be asked for, and that the secret is never shown."""

from __future__ import annotations

import base64
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from db import webhooks
from db.session import Database
from db.settings import settings
from db.types import utcnow
from tests.api.test_jobs import GROW

SECRET = "whsec_" + base64.b64encode(bytes(range(32))).decode()
HOOK = {"url": "https://planner.example.org/done", "secret": SECRET}


def test_a_webhook_is_kept_and_its_secret_is_not_shown(client: TestClient, scene: Scene) -> None:
    created = client.post("/v1/jobs", json=GROW | {"webhook": HOOK}, headers={"Idempotency-Key": "k"})
    job = created.json()["id"]
    shown = client.get(f"/v1/jobs/{job}/webhook")
    assert (shown.json()["url"], shown.json()["state"], shown.json()["attempts"]) == (HOOK["url"], "waiting", 0)
    for answer in (created, shown, client.get(f"/v1/jobs/{job}"), client.get(f"/v1/jobs/{job}/events"), client.get(f"/jobs/{job}")):
        assert SECRET.removeprefix("whsec_") not in answer.text
    other = client.post("/v1/jobs", json=GROW, headers={"Idempotency-Key": "k"})
    assert (other.status_code, other.json()["code"]) == (409, "idempotency_conflict")


def test_a_job_without_one_says_so(client: TestClient, scene: Scene) -> None:
    job = client.post("/v1/jobs", json=GROW).json()["id"]
    answer = client.get(f"/v1/jobs/{job}/webhook")
    assert (answer.status_code, answer.json()["code"]) == (404, "webhook_not_found")


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"url": "ftp://example.org/"}, "webhook.url"),
        ({"url": "https://"}, "webhook.url"),
        ({"url": "https://user:password@example.org/"}, "webhook.url"),
        ({"url": "https://example.org:99999/"}, "webhook.url"),
        ({"url": "https://example.org/ x"}, "webhook.url"),
        ({"url": "https://example.org/\r\nX: y"}, "webhook.url"),
        ({"url": "https://ex\u00e4mple.org/"}, "webhook.url"),
        ({"url": "http://[::1/"}, "webhook.url"),
        ({"url": "http://127.0.0.1/"}, "webhook.url"),
        ({"url": "http://169.254.169.254/latest/meta-data"}, "webhook.url"),
        ({"url": "http://[::ffff:10.0.0.1]/"}, "webhook.url"),
        ({"secret": "password"}, "webhook.secret"),
        ({"secret": "whsec_" + base64.b64encode(b"short").decode()}, "webhook.secret"),
        ({"secret": "whsec_" + "A" * 33}, "webhook.secret"),
        ({"color": "red"}, "webhook.color"),
    ],
)
def test_what_cannot_be_called_is_refused(client: TestClient, scene: Scene, change: dict[str, Any], field: str) -> None:
    answer = client.post("/v1/jobs", json=GROW | {"webhook": HOOK | change})
    assert (answer.status_code, answer.json()["field"]) == (422, field)
    assert str(change.get("secret", "no secret")) not in answer.text
    assert client.get("/v1/jobs").json()["jobs"] == []


def test_attempts_are_shown_and_repeated(client: TestClient, database: Database, scene: Scene) -> None:
    job = client.post("/v1/jobs", json=GROW | {"webhook": HOOK}).json()["id"]
    path = f"/v1/jobs/{job}/webhook"
    assert client.get(path).json()["deliveries"] == []
    early = client.post(f"{path}/resend")
    assert (early.status_code, early.json()["code"]) == (409, "webhook_waits")
    client.post(f"/v1/jobs/{job}/cancel")
    with database.write() as session:
        row = webhooks.of_job(session, job)
        row.attempts = 7
        webhooks.settle(session, row.id, webhooks.Answered(utcnow(), 0.25, 500, "no\0thing", "the receiver answered 500"))
    shown = client.get(path).json()
    assert (shown["state"], shown["deliveries"][0]["status"], shown["deliveries"][0]["answer"]) == ("failed", 500, "nothing")
    again = client.post(f"{path}/resend")
    assert (again.status_code, again.json()["state"], again.json()["attempts"]) == (202, "waiting", 0)
    assert len(again.json()["deliveries"]) == 1


def test_the_webhooks_of_jobs_are_listed(client: TestClient, database: Database, scene: Scene) -> None:
    made = [client.post("/v1/jobs", json=GROW | {"webhook": HOOK}).json()["id"] for _ in range(3)]
    client.post("/v1/jobs", json=GROW)
    with database.write() as session:
        row = webhooks.of_job(session, made[1])
        row.attempts = 7
        webhooks.settle(session, row.id, webhooks.Answered(utcnow(), 0.25, 500, "", "the receiver answered 500"))
    first = client.get("/v1/webhooks", params={"limit": 2})
    rest = client.get("/v1/webhooks", params={"limit": 2, "after": first.json()["next"]}).json()
    assert [one["job"] for one in first.json()["webhooks"] + rest["webhooks"]] == made[::-1]
    assert rest["next"] is None
    assert SECRET.removeprefix("whsec_") not in first.text
    failed = client.get("/v1/webhooks", params={"state": "failed"}).json()["webhooks"]
    assert [(one["job"], one["error"]) for one in failed] == [(made[1], "the receiver answered 500")]
    assert client.get("/v1/webhooks", params={"state": "lost"}).status_code == 422
    assert client.get("/v1/webhooks", params={"after": "x"}).json()["code"] == "cursor"


def test_a_service_without_a_key_for_secrets_takes_no_webhooks_and_stores_nothing(
    client: TestClient, environment: pytest.MonkeyPatch, scene: Scene
) -> None:
    environment.setenv("CIRIS_SECRET_KEY", "")
    settings.cache_clear()
    answer = client.post("/v1/jobs", json=GROW | {"webhook": HOOK})
    assert (answer.status_code, answer.json()["code"], answer.json()["field"]) == (422, "no_secret_key", "webhook.secret")
    assert client.get("/v1/jobs").json()["jobs"] == []
    assert client.post("/v1/jobs", json=GROW).status_code == 201
