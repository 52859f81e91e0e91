"""Errors of the service: requests that are refused, what is not there, keys, workers."""

from __future__ import annotations

import fcntl
import time
from typing import Any

import pytest

from api.access import KEYS_SECONDS
from certifier.pair.forecast import forecast
from db import keys, proofs, scenes
from db.keys import Scope
from db.session import Database
from db.settings import Settings, settings
from tests.api.test_jobs import CERTIFY, GROW
from tests.errors.trial import Table, Trial
from tests.scenes import slider
from workers import admission
from workers.addresses import resolve
from workers.stack import run_stack

SECRET = "whsec_AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwdHh8="


def database(t: Trial) -> Database:
    found: Database = t.request.getfixturevalue("database")
    return found


def post(t: Trial, job: dict[str, Any], times: int = 1, **headers: str) -> None:
    """Asks for a job on the slider so often."""
    t.request.getfixturevalue("scene")
    for _ in range(times - 1):
        t.request.getfixturevalue("client").post("/v1/jobs", json=GROW, headers=headers)
    t.ask("POST", "/v1/jobs", json=job, headers=headers)


def queued(t: Trial) -> str:
    """Returns the id of a job that nobody works on."""
    t.request.getfixturevalue("scene")
    job: str = t.request.getfixturevalue("client").post("/v1/jobs", json=GROW).json()["id"]
    return job


def elsewhere(t: Trial) -> None:
    """Asks for a trajectory to a region of another scene."""
    region = t.request.getfixturevalue("region")
    with database(t).write() as session:
        other = scenes.add(session, slider(posts=1)).id
    t.ask("POST", "/v1/planning/plan", json={"scene": other, "start": [0.1], "goal": region})


def twins(t: Trial) -> None:
    """Asks for one of two jobs by what their ids have in common."""
    first = queued(t)
    patch: pytest.MonkeyPatch = t.request.getfixturevalue("monkeypatch")
    patch.setattr("db.jobs.uuid4", lambda: first[:-1] + ("0" if first[-1] != "0" else "1"))
    queued(t)
    t.ask("GET", f"/v1/jobs/{first[:4]}")


def outside(t: Trial) -> None:
    """Asks for a path, straight in s, to where the slider cannot go."""
    t.request.getfixturevalue("scene")
    t.ask("POST", "/v1/planning/path", json={"scene": "slider", "q": [[0.0], [5.0]], "space": "s"})


def too_many(t: Trial) -> None:
    t.request.getfixturevalue("environment").setenv("CIRIS_MAX_JOBS_PER_KEY", "1")
    settings.cache_clear()
    post(t, GROW, times=2)


def too_often(t: Trial) -> None:
    t.request.getfixturevalue("environment").setenv("CIRIS_REQUESTS_PER_SECOND", "1")
    settings.cache_clear()
    client = t.request.getfixturevalue("client")
    for _ in range(3):
        client.get("/v1/jobs")
    t.ask("GET", "/v1/jobs")


def with_key(t: Trial, method: str, path: str, key: str | None = None, scope: Scope = Scope.READ) -> None:
    """Sends a request to a service that has a key, with it, with another one (``key``), or without (an empty one)."""
    t.request.getfixturevalue("client")
    with database(t).write() as session:
        made = keys.add(session, "planner", scope)
    time.sleep(KEYS_SECONDS)
    given = made if key is None else key
    t.ask(method, path, headers={"Authorization": f"Bearer {given}"} if given else {})


def write(t: Trial, change: Any) -> None:
    with database(t).write() as session:
        change(session)


def named_twice(session: Any) -> None:
    keys.add(session, "planner", Scope.READ)
    keys.add(session, "planner", Scope.READ)


def beside_another_stack(t: Trial) -> None:
    with (t.directory / "stack.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        run_stack(Settings(data_dir=t.directory))


def hooked(t: Trial, url: str) -> None:
    post(t, GROW | {"webhook": {"url": url, "secret": SECRET}})


def certify(t: Trial, **polytope: Any) -> None:
    post(t, CERTIFY | {"polytope": {"C": [[1], [-1]], "d": [0.2, 0.2], **polytope}})


SERVICE: Table = {
    ("ambiguous_id", "job"): [twins],
    ("idempotency_conflict", "Idempotency-Key"): [lambda t: post(t, CERTIFY, times=2, **{"Idempotency-Key": "k"})],
    ("quota_exceeded", ""): [too_many],
    ("job_not_retryable", "job"): [lambda t: t.ask("POST", f"/v1/jobs/{queued(t)}/retry")],
    ("job_not_found", "job"): [lambda t: t.ask("GET", "/v1/jobs/nope")],
    ("key_name", "name"): [lambda t: write(t, lambda session: keys.add(session, "a b", Scope.READ)), lambda t: write(t, named_twice)],
    ("key_not_found", "name"): [lambda t: write(t, lambda session: keys.revoke(session, "nobody"))],
    ("no_database", "CIRIS_DATABASE_URL"): [
        lambda t: keys.check_bind(Settings(host="0.0.0.0", database_url=f"sqlite:///{t.directory}/none.sqlite3"))
    ],
    ("no_keys", "CIRIS_HOST"): [lambda t: keys.check_bind(Settings(host="0.0.0.0", database_url=t.request.getfixturevalue("sqlite_url")))],
    ("cursor", "after"): [lambda t: t.ask("GET", "/v1/jobs?after=nope")],
    ("proof_not_found", "proof"): [lambda t: write(t, lambda session: proofs.get(session, "nothing"))],
    ("region_not_found", "region"): [
        lambda t: t.ask("GET", "/v1/regions/nope"),
        lambda t: t.ask("DELETE", f"/v1/regions/{t.request.getfixturevalue('region')[:8]}"),
    ],
    ("region_elsewhere", "goal"): [elsewhere],
    ("scene_not_found", "scene"): [lambda t: post(t, GROW | {"scene": "slidr"}), lambda t: post(t, GROW | {"scene": "zzz"})],
    ("webhook_not_found", "job"): [lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/webhook")],
    ("scope_missing", "Authorization"): [lambda t: with_key(t, "DELETE", "/v1/regions/nope")],
    ("polytope_shape", "polytope.d"): [lambda t: certify(t, d=[0.2])],
    ("center_outside", "polytope.center"): [lambda t: certify(t, center=[0.5])],
    ("webhook_url", "webhook.url"): [lambda t: hooked(t, "https://user:password@example.org/")],
    ("webhook_address", "webhook.url"): [
        lambda t: hooked(t, "http://127.0.0.1/"),
        lambda t: resolve("nobody.invalid", 443, private=False),
        lambda t: resolve("127.0.0.1", 443, private=False),
    ],
    ("seed_wrong_length", "seed.q"): [lambda t: post(t, GROW | {"seed": {"q": [0.1, 0.2]}})],
    ("waypoint_outside_limits", "q[1]"): [outside],
    ("too_many_requests", ""): [too_often],
    ("key_needed", "Authorization"): [
        lambda t: with_key(t, "GET", "/v1/jobs", key=""),
        lambda t: with_key(t, "GET", "/v1/jobs", key="wrong"),
    ],
    ("unknown_host", "Host"): [lambda t: t.ask("GET", "/healthz", headers={"Host": "evil.example"})],
    ("cross_site", "Origin"): [lambda t: t.ask("POST", "/v1/jobs/x/cancel", headers={"Origin": "https://evil.example"})],
    ("invalid_request", "url"): [lambda t: t.ask("GET", "/v1/scenes?after=%00")],
    ("too_large", "body"): [lambda t: t.ask("POST", "/v1/jobs", content=b"", headers={"Content-Length": str(1 << 40)})],
    ("malformed_json", "body"): [lambda t: t.ask("POST", "/v1/jobs", content="{", headers={"Content-Type": "application/json"})],
    ("invalid_request", "options.speed"): [lambda t: post(t, GROW | {"options": {"speed": 3}})],
    ("invalid_request", "body"): [lambda t: t.ask("POST", "/v1/jobs", json=3)],
    ("not_found", "url"): [lambda t: t.ask("GET", "/v1/nothing")],
    ("method_not_allowed", "method"): [lambda t: t.ask("PUT", "/v1/jobs")],
    ("pair_not_found", "pair"): [lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/pairs/9/cells")],
    ("cells_not_found", "pair"): [lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/pairs/0/cells")],
    ("proof_not_found", "pair"): [lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/pairs/0/proof?iteration=0")],
    ("bad_name", "name"): [lambda t: t.ask("GET", "/v1/regions/none/export", params={"name": "two\nlines"})],
    ("does_not_fit", "scene"): [lambda t: admission.check(forecast(slider()), Settings(pair_memory_bytes=1), None)],
    ("data_directory", "--data"): [lambda t: run_stack(Settings(data_dir=t.write(file="") / "data"))],
    ("port_taken", "--port"): [
        lambda t: run_stack(Settings(data_dir=t.directory), port=70000),
        lambda t: run_stack(Settings(data_dir=t.directory, host="192.0.2.1")),
    ],
    ("stack_running", "--data"): [beside_another_stack],
}
