"""Errors of the service: requests that are refused, what is not there, keys, workers."""

from __future__ import annotations

import fcntl
import time
from typing import Any

import pytest

from api.access import KEYS_SECONDS
from certifier.model import ALPHABET
from certifier.pair.forecast import forecast
from db import keys, proofs, scenes
from db.keys import Scope
from db.session import Database
from db.settings import Settings, settings
from jobs import admission
from tests.api.test_jobs import CERTIFY, GROW
from tests.errors.rows import Row, Trial, rows
from tests.scenes import slider
from workers.addresses import resolve
from workers.stack import run_stack

DESCRIBED = "/openapi.json describes every request"
IN_LOG = "try again; the service's log has the details"
ON_LOSS = "give the workers more memory or time, or ask for less"
PRIVATE = "CIRIS_WEBHOOK_PRIVATE=1 allows it"
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


STORED = [
    *rows("db/ids.py", ("ambiguous_id", "job", "several ids begin with {given}", "give more of it", twins)),
    *rows(
        "db/jobs.py",
        (
            "idempotency_conflict",
            "Idempotency-Key",
            "this idempotency key was used for a different request",
            "use a new key for a new request",
            lambda t: post(t, CERTIFY, times=2, **{"Idempotency-Key": "k"}),
        ),
        (
            "quota_exceeded",
            "",
            "{limit} jobs that have not ended are the most at a time",
            "wait for some to end, cancel some, or have CIRIS_MAX_JOBS_PER_KEY raised",
            too_many,
        ),
        (
            "job_not_retryable",
            "job",
            "the job is {state}; only a failed or cancelled one can be retried",
            "create a new one",
            lambda t: t.ask("POST", f"/v1/jobs/{queued(t)}/retry"),
        ),
        (
            "job_not_found",
            "job",
            "there is no job {job_id}",
            "`ciris job ls`, or `jobs()` in Python, lists them",
            lambda t: t.ask("GET", "/v1/jobs/nope"),
        ),
    ),
    *rows(
        "db/keys.py",
        (
            "key_name",
            "name",
            "{name} is no name for a key",
            "choose up to 64 letters, digits and . _ - @",
            lambda t: write(t, lambda session: keys.add(session, "a b", Scope.READ)),
        ),
        ("key_name", "name", "there is a key {name} already", "revoke it, or choose another name", lambda t: write(t, named_twice)),
        (
            "key_not_found",
            "name",
            "there is no key {name}",
            "`ciris key ls` lists them",
            lambda t: write(t, lambda session: keys.revoke(session, "nobody")),
        ),
        (
            "no_database",
            "CIRIS_DATABASE_URL",
            "the database cannot be used",
            "is it there, and migrated (`python -m db.migrate`)?",
            lambda t: keys.check_bind(Settings(host="0.0.0.0", database_url=f"sqlite:///{t.directory}/none.sqlite3")),
        ),
        (
            "no_keys",
            "CIRIS_HOST",
            "others can reach {host}, and no API key has been made that could keep them out",
            "`ciris key add NAME --scope admin` makes one",
            lambda t: keys.check_bind(Settings(host="0.0.0.0", database_url=t.request.getfixturevalue("sqlite_url"))),
        ),
    ),
    *rows(
        "db/pages.py",
        (
            "cursor",
            "after",
            "this is not the `next` of a page",
            "leave it out to begin with the first page",
            lambda t: t.ask("GET", "/v1/jobs?after=nope"),
        ),
    ),
    *rows(
        "db/proofs.py",
        (
            "proof_not_found",
            "proof",
            "there is no proof {digest}",
            "the database has lost it: restore a backup, or grow the region again",
            lambda t: write(t, lambda session: proofs.get(session, "nothing")),
        ),
    ),
    *rows(
        "db/regions.py",
        (
            "region_not_found",
            "region",
            "there is no region {region_id}",
            "`ciris region ls`, or `regions()` in Python, lists them",
            lambda t: t.ask("GET", "/v1/regions/nope"),
        ),
        (
            "region_not_found",
            "region",
            "there is no region {region_id}",
            "give all of its id to delete it",
            lambda t: t.ask("DELETE", f"/v1/regions/{t.request.getfixturevalue('region')[:8]}"),
        ),
    ),
    *rows(
        "api/routers/plans.py",
        (
            "region_elsewhere",
            "{field}",
            "region {region_id} is of another scene",
            "`ciris region ls --scene SCENE` lists them",
            elsewhere,
        ),
    ),
    *rows(
        "db/scenes.py",
        ("scene_not_found", "scene", "there is no scene {name}", "did you mean {...}?", lambda t: post(t, GROW | {"scene": "slidr"})),
        (
            "scene_not_found",
            "scene",
            "there is no scene {name}",
            "`ciris scene ls`, or `scenes()` in Python, lists them",
            lambda t: post(t, GROW | {"scene": "zzz"}),
        ),
    ),
    *rows(
        "db/webhooks.py",
        (
            "webhook_not_found",
            "job",
            "job {job_id} has no webhook",
            "give one when you create a job",
            lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/webhook"),
        ),
    ),
]


def hooked(t: Trial, url: str) -> None:
    post(t, GROW | {"webhook": {"url": url, "secret": SECRET}})


def certify(t: Trial, **polytope: Any) -> None:
    post(t, CERTIFY | {"polytope": {"C": [[1], [-1]], "d": [0.2, 0.2], **polytope}})


REQUESTS = [
    *rows(
        "api/access.py",
        (
            "scope_missing",
            "Authorization",
            "this needs a key of the scope {_scope}; the key {name} has {scope}",
            "`ciris key add NAME --scope {_scope}` makes one",
            lambda t: with_key(t, "DELETE", "/v1/regions/nope"),
        ),
    ),
    *rows(
        "api/checks.py",
        (
            "polytope_shape",
            "polytope.d",
            "C has {...} rows and d has {...} numbers",
            "give one number a row",
            lambda t: certify(t, d=[0.2]),
        ),
        (
            "center_outside",
            "polytope.center",
            "the centre is not inside the polytope and the joint limits",
            "leave it out to have one found",
            lambda t: certify(t, center=[0.5]),
        ),
        (
            "webhook_url",
            "webhook.url",
            "{url} cannot be called",
            "write https://host/path, without credentials",
            lambda t: hooked(t, "https://user:password@example.org/"),
        ),
        ("webhook_address", "webhook.url", "{hostname} is not a public address", PRIVATE, lambda t: hooked(t, "http://127.0.0.1/")),
        (
            "seed_wrong_length",
            "seed.q",
            "{...} numbers were given; {name} has {n} joints",
            "in the order {names}",
            lambda t: post(t, GROW | {"seed": {"q": [0.1, 0.2]}}),
        ),
        (
            "waypoint_outside_limits",
            "q[1]",
            "a joint of this waypoint is outside of its limits, or of the window that the scene covers, and has no s",
            "`ciris scene show` lists the limits",
            outside,
        ),
    ),
    *rows(
        "api/connections.py",
        ("too_slow", "body", "the request did not arrive in time", "send it faster, or in smaller parts", "tests/api/test_connections.py"),
        ("busy", "", "the service has as many connections as it can hold", "try again in a while", "tests/api/test_connections.py"),
    ),
    *rows(
        "api/problems.py",
        (
            "no_room",
            "",
            "the database's disk is full, or cannot be written",
            "free some room on it; what was stored is safe, and /readyz says more",
            "tests/workers/test_disk.py",
        ),
    ),
    *rows(
        "api/children.py",
        ("busy", "", "too many requests of this kind wait already", "try again in a while", "many uploads or checks at the same time"),
    ),
    *rows(
        "api/writing.py",
        ("busy", "", "too many requests that change something wait already", "try again in a while", "tests/api/test_writers.py"),
    ),
    *rows(
        "api/questions.py",
        (
            "busy",
            "",
            "too many large questions wait already",
            "try again in a while, or ask about {few} points at a time",
            "tests/api/test_questions.py",
        ),
    ),
    *rows(
        "api/guard.py",
        ("too_many_requests", "", "more requests than one caller may make", "wait as long as Retry-After says", too_often),
        (
            "key_needed",
            "Authorization",
            "this service needs an API key",
            "send `Authorization: Bearer KEY`; `ciris key add` makes one",
            lambda t: with_key(t, "GET", "/v1/jobs", key=""),
        ),
        (
            "key_needed",
            "Authorization",
            "this is not a valid API key",
            "send `Authorization: Bearer KEY`; `ciris key add` makes one",
            lambda t: with_key(t, "GET", "/v1/jobs", key="wrong"),
        ),
        (
            "unknown_host",
            "Host",
            "this service is not {host}",
            "call it by 127.0.0.1 or localhost",
            lambda t: t.ask("GET", "/healthz", headers={"Host": "evil.example"}),
        ),
        (
            "cross_site",
            "Origin",
            "requests from {origin} are not accepted",
            "send them from the service's own pages, or from a program",
            lambda t: t.ask("POST", "/v1/jobs/x/cancel", headers={"Origin": "https://evil.example"}),
        ),
        ("invalid_request", "url", "the address holds a zero byte", "leave it out", lambda t: t.ask("GET", "/v1/scenes?after=%00")),
        (
            "too_large",
            "body",
            "{...}",
            "send less",
            lambda t: t.ask("POST", "/v1/jobs", content=b"", headers={"Content-Length": str(1 << 40)}),
        ),
    ),
    *rows(
        "api/problems.py",
        (
            "malformed_json",
            "body",
            "the body is not JSON",
            DESCRIBED,
            lambda t: t.ask("POST", "/v1/jobs", content="{", headers={"Content-Type": "application/json"}),
        ),
        ("invalid_request", "options.speed", "{...}", DESCRIBED, lambda t: post(t, GROW | {"options": {"speed": 3}})),
        ("invalid_request", "body", "{...}", DESCRIBED, lambda t: t.ask("POST", "/v1/jobs", json=3)),
        ("not_found", "url", "{...}", DESCRIBED, lambda t: t.ask("GET", "/v1/nothing")),
        ("method_not_allowed", "method", "{...}", DESCRIBED, lambda t: t.ask("PUT", "/v1/jobs")),
        ("too_large", "body", "{...}", DESCRIBED, "a body without a length that goes on for too long"),
        (
            "database_unavailable",
            "",
            "the database cannot be reached",
            "try again; what was committed is safe",
            "a database that has gone away",
        ),
        ("internal", "", "something went wrong in the service", "the service's log has the details", "a fault of the program"),
    ),
    *rows(
        "api/cells.py",
        (
            "pair_not_found",
            "pair",
            "there is no pair {index}: {name} has {...} pairs, numbered from 0",
            "/v1/scenes/{id}/pairs lists them",
            lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/pairs/9/cells"),
        ),
        (
            "cells_not_found",
            "pair",
            "pair {index} has no cells: {why}",
            "/v1/jobs/{id}/pairs has its outcome",
            lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/pairs/0/cells"),
        ),
    ),
    *rows(
        "api/routers/jobs.py",
        (
            "proof_not_found",
            "pair",
            "there is no proof of pair {pair} in iteration {iteration}",
            "only pairs that are certified or refuted have one",
            lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/pairs/0/proof?iteration=0"),
        ),
    ),
]

WORKERS = [
    *rows(
        "api/routers/regions.py",
        (
            "bad_name",
            "name",
            "{...} cannot be a region's name",
            f"give {ALPHABET}",
            lambda t: t.ask("GET", "/v1/regions/none/export", params={"name": "two\nlines"}),
        ),
    ),
    *rows(
        "workers/addresses.py",
        (
            "webhook_address",
            "webhook.url",
            "no address of {host} was found",
            "is it spelt so, and does the service's machine know it?",
            lambda t: resolve("nobody.invalid", 443, private=False),
        ),
        ("webhook_address", "webhook.url", "{host} is not a public address", PRIVATE, lambda t: resolve("127.0.0.1", 443, private=False)),
    ),
    *rows(
        "jobs/admission.py",
        (
            "does_not_fit",
            "scene",
            "certifying {a} and {b} ({chain} joints between them, {vertices} vertices) needs about {needs}; {limit}",
            "give the bodies fewer vertices, ignore the pair with a reason, or raise the limit",
            lambda t: admission.check(forecast(slider()), Settings(pair_memory_bytes=1), None),
        ),
    ),
    *rows(
        "workers/pairs.py",
        ("worker_lost", "", "{...} this pair", ON_LOSS, "a process that was killed each time it certified the pair"),
        ("internal_error", "", "certifying the pair went wrong in the service", IN_LOG, "a fault of the program"),
    ),
    *rows(
        "workers/stack.py",
        (
            "data_directory",
            "--data",
            "{data} cannot be used: {strerror}",
            "name a directory that you may write to, on a disk with room",
            lambda t: run_stack(Settings(data_dir=t.write(file="") / "data")),
        ),
        (
            "no_room",
            "--data",
            "the database in {data_dir} cannot be written: the disk is full or read-only",
            "free some room there",
            "tests/workers/test_disk.py",
        ),
        ("stack_failed", "", "the API at {url} does not answer", "see {...}", "a stack whose API does not come up"),
        (
            "port_taken",
            "--port",
            "port {asked} of {host} cannot be bound",
            "choose another, or none; CIRIS_HOST is where it is looked for",
            lambda t: run_stack(Settings(data_dir=t.directory), port=70000),
        ),
        (
            "port_taken",
            "--port",
            "no port of {host} can be bound",
            "choose another, or none; CIRIS_HOST is where it is looked for",
            lambda t: run_stack(Settings(data_dir=t.directory, host="192.0.2.1")),
        ),
        (
            "stack_running",
            "--data",
            "a stack with the data directory {data} is running already",
            "use that one, or name another directory",
            beside_another_stack,
        ),
    ),
    *rows(
        "workers/steps.py",
        ("internal_error", "", "the step {kind} went wrong in the service", IN_LOG, "a fault of the program"),
        ("worker_lost", "", "{...} the step {kind}", ON_LOSS, "a process that was killed each time it did the step"),
    ),
    *rows(
        "workers/turns.py",
        ("internal_error", "", "deciding what is next went wrong in the service", IN_LOG, "a fault of the program"),
        (
            "coordination_failed",
            "",
            "the coordinator died or hung each time it decided about this job",
            IN_LOG,
            "a process that was killed each time it decided",
        ),
    ),
]

SERVICE: list[Row] = [*STORED, *REQUESTS, *WORKERS]
