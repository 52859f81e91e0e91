"""Errors of the service: requests that are refused, what is not there, keys, workers, slices."""

from __future__ import annotations

import fcntl
import time
from dataclasses import replace
from typing import Any

from api.access import COOKIE, KEYS_SECONDS
from certifier.pair.forecast import forecast
from db import keys, projects, proofs, scenes, staging, workers
from db.keys import Scope
from db.settings import Host, Settings, settings
from db.states import WorkerState
from db.workers import Made, WorkerKind
from jobs import admission
from tests.api.test_jobs import CERTIFY, GROW
from tests.certifier.scenes import planar_arm
from tests.errors.trial import Table, Trial
from tests.scenes import slider
from workers.addresses import resolve
from workers.stack import run_stack

SECRET = "whsec_AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwdHh8="


def post(t: Trial, job: dict[str, Any], times: int = 1, **headers: str) -> None:
    """Asks for a job on the slider so often."""
    t.need("scene")
    for _ in range(times - 1):
        t.need("client").post("/v1/jobs", json=GROW, headers=headers)
    t.ask("POST", "/v1/jobs", json=job, headers=headers)


def queued(t: Trial) -> str:
    """Returns the id of a job that nobody works on."""
    t.need("scene")
    return str(t.need("client").post("/v1/jobs", json=GROW).json()["id"])


def elsewhere(t: Trial) -> None:
    """Asks for a trajectory to a region of another scene."""
    region = t.need("region")
    with t.need("database").write() as session:
        other = scenes.add(session, slider(posts=1)).id
    t.ask("POST", "/v1/planning/plan", json={"scene": other, "start": [0.1], "goal": region})


def twins(t: Trial) -> None:
    """Asks for one of two jobs by what their ids have in common."""
    first = queued(t)
    t.need("monkeypatch").setattr("db.jobs.uuid4", lambda: first[:-1] + ("0" if first[-1] != "0" else "1"))
    queued(t)
    t.ask("GET", f"/v1/jobs/{first[:4]}")


def signed_out(t: Trial) -> None:
    """Asks with a session that nobody began."""
    with t.need("database").write() as session:
        keys.add(session, "other", Scope.READ)
    t.ask("GET", "/v1/jobs", headers={"Cookie": f"{COOKIE}={43 * 'a'}"})


def at_provider(t: Trial, path: str) -> None:
    """Signs in at a provider that is away."""
    t.need("environment").setenv("CIRIS_OIDC_ISSUER", "http://127.0.0.1:9")
    t.need("environment").setenv("CIRIS_OIDC_CLIENT_ID", "ciris")
    settings.cache_clear()
    t.ask("GET", f"/login/oidc{path}")


def outside(t: Trial) -> None:
    """Asks for a path, straight in s, to where the slider cannot go."""
    t.need("scene")
    t.ask("POST", "/v1/planning/path", json={"scene": "slider", "q": [[0.0], [5.0]], "space": "s"})


def too_many(t: Trial) -> None:
    t.need("environment").setenv("CIRIS_MAX_JOBS_PER_KEY", "1")
    settings.cache_clear()
    post(t, GROW, times=2)


def too_often(t: Trial) -> None:
    t.need("environment").setenv("CIRIS_REQUESTS_PER_SECOND", "1")
    settings.cache_clear()
    client = t.need("client")
    for _ in range(3):
        client.get("/v1/jobs")
    t.ask("GET", "/v1/jobs")


def with_key(t: Trial, method: str, path: str, key: str | None = None, scope: Scope = Scope.READ) -> None:
    """Sends a request to a service that has a key, with it, with another one (``key``), or without (an empty one)."""
    t.need("client")
    with t.need("database").write() as session:
        made = keys.add(session, "planner", scope)
    time.sleep(KEYS_SECONDS)
    given = made if key is None else key
    t.ask(method, path, headers={"Authorization": f"Bearer {given}"} if given else {})


def write(t: Trial, change: Any) -> None:
    with t.need("database").write() as session:
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


def staged(t: Trial, name: str = "slider", posts: int = 1) -> None:
    """Stages a slider with this number of posts. The present one has two posts, and a region."""
    t.need("region")
    write(t, lambda session: staging.stage(session, name, slider(posts=posts)))


def constrained(t: Trial) -> None:
    """Asks for a scene with a condition by the name of the scene without it."""
    t.need("scene")
    write(t, lambda session: scenes.add(session, slider()))
    low = {"name": "low", "inside": {"what": ["model/cart"], "half_spaces": [[0, 0, 1, 9]]}}
    t.ask("POST", "/v1/scenes/slider/constrain", json={"name": "slider", "conditions": [low]})


def two_homes(t: Trial) -> None:
    """Asks about the home of a scene by its id, which has another one under each of its names."""
    (joint,) = (joint.name for joint in slider().moving)
    for name, at in (("one", 0.1), ("two", 0.2)):
        write(t, lambda session, name=name, at=at: scenes.add(session, replace(slider(name), configurations={"home": {joint: at}})))
    t.need("scene")
    t.ask("POST", "/v1/planning/contains", json={"q": ["home"], "scene": slider().hash[:16]})


def promoted(t: Trial) -> None:
    staged(t)
    t.ask("POST", "/v1/scenes/slider/promote")


def sliced(t: Trial, **parts: Any) -> None:
    t.need("client")
    with t.need("database").write() as session:
        scenes.add(session, planar_arm(limit=1.2))
    t.ask("POST", "/v1/planning/slice", json={"scene": "planar", "q": [0.0, 0.0], "x": "arm/joint1", "y": "arm/joint2"} | parts)


def a_draining_one(t: Trial) -> str:
    with t.need("database").write() as session:
        workers.tell(session, Made("there:1:2", WorkerKind.SOLVE, "1", 2, 2, 2**32), WorkerState.DRAINING)
        session.flush()
        return workers.page(session).rows[0].id


def with_a_key_of_others(t: Trial, method: str, path: str) -> None:
    with t.need("database").write() as session:
        projects.add(session, "others")
        key = keys.add(session, "boss", Scope.ADMIN, "others")
    time.sleep(KEYS_SECONDS)
    t.ask(method, path, headers={"Authorization": f"Bearer {key}"})


SERVICE: Table = {
    ("same_joint", "y"): [lambda t: sliced(t, y="arm/joint1")],
    ("unknown_joint", "x"): [lambda t: sliced(t, x="arm/joint9")],
    ("slice_outside_limits", "x_range"): [lambda t: sliced(t, x_range=[2.0, 3.0])],
    ("region_elsewhere", "regions[0]"): [lambda t: sliced(t, regions=["none"])],
    ("worker_not_found", "worker"): [lambda t: t.ask("GET", "/v1/workers/nobody")],
    ("worker_draining", "worker"): [lambda t: t.ask("POST", f"/v1/workers/{a_draining_one(t)}/resume")],
    ("workers_shared", "Authorization"): [lambda t: with_a_key_of_others(t, "POST", f"/v1/workers/{a_draining_one(t)}/pause")],
    ("other_projects", "Authorization"): [lambda t: with_a_key_of_others(t, "GET", "/v1/projects")],
    ("ambiguous_id", "job"): [twins],
    ("idempotency_conflict", "Idempotency-Key"): [lambda t: post(t, CERTIFY, times=2, **{"Idempotency-Key": "k"})],
    ("quota_exceeded", ""): [too_many],
    ("job_not_retryable", "job"): [lambda t: t.ask("POST", f"/v1/jobs/{queued(t)}/retry")],
    ("job_not_found", "job"): [lambda t: t.ask("GET", "/v1/jobs/nope")],
    ("key_name", "name"): [lambda t: write(t, lambda session: keys.add(session, "a b", Scope.READ)), lambda t: write(t, named_twice)],
    ("key_not_found", "key"): [lambda t: write(t, lambda session: keys.named(session, "nobody"))],
    ("key_not_found", "name"): [lambda t: write(t, lambda session: keys.revoke(session, "nobody"))],
    ("no_database", "CIRIS_DATABASE_URL"): [
        lambda t: keys.check_bind(Settings(host="0.0.0.0", database_url=f"sqlite:///{t.directory}/none.sqlite3"))
    ],
    ("no_keys", "CIRIS_HOST"): [lambda t: keys.check_bind(Settings(host="0.0.0.0", database_url=t.need("sqlite_url")))],
    ("cursor", "after"): [lambda t: t.ask("GET", "/v1/jobs?after=nope")],
    ("proof_not_found", "proof"): [lambda t: write(t, lambda session: proofs.get(session, "nothing"))],
    ("motion_not_found", "motion"): [lambda t: t.ask("GET", "/v1/planning/motions/5b8f8d6e/proof")],
    ("region_not_found", "region"): [
        lambda t: t.ask("GET", "/v1/regions/nope"),
        lambda t: t.ask("DELETE", f"/v1/regions/{t.need('region')[:8]}"),
    ],
    ("region_elsewhere", "goal"): [elsewhere],
    ("scene_not_found", "scene"): [
        lambda t: post(t, GROW | {"scene": "slidr"}),
        lambda t: post(t, GROW | {"scene": "zzz"}),
        lambda t: post(t, GROW | {"scene": "slider@staged"}),
    ],
    ("scene_not_found", "stage"): [lambda t: staged(t, name="slidr")],
    ("scene_name", "stage"): [lambda t: staged(t, name="slider@staged")],
    ("scene_name", "name"): [
        lambda t: write(t, lambda session: scenes.add(session, slider("slider@staged"))),
        lambda t: write(t, lambda session: scenes.add(session, slider("../slider"))),
        lambda t: constrained(t),
    ],
    ("configuration", "q[0]"): [two_homes],
    ("scene_unchanged", "stage"): [lambda t: staged(t, posts=2)],
    ("scene_without_regions", "without_regions"): [promoted],
    ("webhook_not_found", "job"): [lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/webhook")],
    ("scope_missing", "Authorization"): [lambda t: with_key(t, "DELETE", "/v1/regions/nope")],
    ("polytope_shape", "polytope.d"): [lambda t: certify(t, d=[0.2])],
    ("center_outside", "polytope.center"): [lambda t: certify(t, center=[0.5])],
    ("webhook_url", "webhook.url"): [lambda t: hooked(t, "https://user:password@example.org/")],
    ("webhook_address", "webhook.url"): [
        lambda t: hooked(t, "http://127.0.0.1/"),
        lambda t: hooked(t, "http://example.org:8080/"),
        lambda t: resolve("nobody.invalid", 443, ()),
        lambda t: resolve("nobody.invalid", 443, (Host("nobody.invalid", None),)),
    ],
    ("seed_wrong_length", "seed.q"): [lambda t: post(t, GROW | {"seed": {"q": [0.1, 0.2]}})],
    ("waypoint_outside_limits", "q[1]"): [outside],
    ("too_many_requests", ""): [too_often],
    ("key_needed", "Authorization"): [
        lambda t: with_key(t, "GET", "/v1/jobs", key=""),
        lambda t: with_key(t, "GET", "/v1/jobs", key="wrong"),
        signed_out,
    ],
    ("provider_unavailable", "CIRIS_OIDC_ISSUER"): [lambda t: at_provider(t, "")],
    ("sign_in_refused", "url"): [lambda t: at_provider(t, "/callback?code=x")],
    ("unknown_host", "Host"): [lambda t: t.ask("GET", "/healthz", headers={"Host": "evil.example"})],
    ("cross_site", "Origin"): [lambda t: t.ask("POST", "/v1/jobs/x/cancel", headers={"Origin": "https://evil.example"})],
    ("invalid_request", "url"): [lambda t: t.ask("GET", "/v1/scenes?after=%00")],
    ("too_large", "body"): [
        lambda t: t.ask("POST", "/v1/jobs", content=b"", headers={"Content-Length": str(1 << 40)}),
        lambda t: t.ask("POST", "/v1/jobs", content="," * 1_000_000, headers={"Content-Type": "application/json"}),
    ],
    ("too_large", "url"): [lambda t: t.ask("GET", f"/v1/jobs?search={'x' * 40_000}")],
    ("content_encoding", "Content-Encoding"): [lambda t: t.ask("POST", "/v1/jobs", content=b"", headers={"Content-Encoding": "gzip"})],
    ("malformed_json", "body"): [lambda t: t.ask("POST", "/v1/jobs", content="{", headers={"Content-Type": "application/json"})],
    ("invalid_request", "Content-Type"): [lambda t: t.ask("POST", "/v1/jobs", content="{}", headers={"Content-Type": "text/plain"})],
    ("invalid_request", "scnee"): [lambda t: t.ask("GET", "/v1/jobs?scnee=slider")],
    ("invalid_request", "until"): [lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/timeline?since=2&until=1")],
    ("invalid_request", "limit"): [lambda t: t.ask("GET", "/v1/jobs?limit=1&limit=2")],
    ("invalid_request", "zzz"): [lambda t: t.ask("GET", "/v1/jobs?zzz=1"), lambda t: t.ask("GET", "/v1/project?zzz=1")],
    ("invalid_request", "options.speed"): [lambda t: post(t, GROW | {"options": {"speed": 3}})],
    ("invalid_request", "body"): [
        lambda t: t.ask("POST", "/v1/jobs", json=3),
        lambda t: t.ask("POST", "/v1/jobs", content='{"a": 1, "a": 2}', headers={"Content-Type": "application/json"}),
    ],
    ("not_found", "url"): [lambda t: t.ask("GET", "/v1/nothing"), lambda t: t.ask("GET", "/login/oidc")],
    ("method_not_allowed", "method"): [lambda t: t.ask("PUT", "/v1/jobs")],
    ("pair_not_found", "pair"): [lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/pairs/9/cells")],
    ("cells_not_found", "pair"): [lambda t: t.ask("GET", f"/v1/jobs/{queued(t)}/pairs/0/cells")],
    ("cells_not_found", "q"): [lambda t: t.ask("GET", f"/v1/regions/{t.need('region')}/pairs/0/plane?q=9")],
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
