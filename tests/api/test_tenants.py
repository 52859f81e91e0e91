"""What one project does costs the requests of the others nothing."""

from __future__ import annotations

import json
import os
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path

import httpx2
import pytest
import yaml
from sqlalchemy import insert, select

from api.streams import OF_PROJECT
from certifier.errors import CirisError
from ciris.synchronous.client import Client
from db import jobs, keys, leases, migrate, projects
from db.keys import Scope
from db.models import DEFAULT_PROJECT, ApiKeyRow, PairRow, StepRow
from db.session import Database
from db.types import utcnow
from tests.api.latency import latencies
from tests.api.test_hostile_uploads import URDF, zipped
from tests.api.test_places import LINK
from tests.db.builders import a_scene, add_pairs
from tests.services import Postgres

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
KEYS = 200_000
REQUESTS = 500
STREAMS, PAIRS = 300, 5000
JITTER_MS = 5.0
"""The machine of the tests is no quieter than that."""


@contextmanager
def a_service(data: Path, url: str, solvers: int = 1) -> Iterator[str]:
    """The URL of a whole stack on the database, with this many solving processes."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("CIRIS_")}
    processes = {"CIRIS_SOLVE_PROCESSES": str(solvers), "CIRIS_API_PROCESSES": "1"}
    environment = {**clean, "PYTHONPATH": str(ROOT), "CIRIS_DATABASE_URL": url, **processes}
    command = [sys.executable, "-m", "workers.stack", "--data", str(data), "--port", "0"]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as stack:
        try:
            assert stack.stdout is not None
            assert "ciris is up" in stack.stdout.readline()
            yield json.loads((data / "stack.json").read_text())["url"]
        finally:
            stack.send_signal(signal.SIGINT)


@pytest.mark.slow
@pytest.mark.parametrize("database", ["sqlite", "postgresql"])
def test_keys_of_another_project_cost_nothing(database: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    url = f"sqlite:///{tmp_path / 'ciris.sqlite3'}"
    if database == "postgresql":
        postgres: Postgres = request.getfixturevalue("postgres")
        url = postgres.new_database()
    migrate.upgrade(url)
    db = Database(url)
    with db.write() as session:
        projects.add(session, "flood")
        key, flooding = keys.add(session, "quiet", Scope.READ), keys.add(session, "flooding", Scope.ADMIN, "flood")
    with a_service(tmp_path / "data", url) as service:
        latencies(service, key, REQUESTS)  # the first requests load what the others find loaded
        before = latencies(service, key, REQUESTS)
        many = [
            {"id": secrets.token_hex(6), "project": "flood", "name": f"k{i}", "digest": "", "scope": "read", "created_at": utcnow()}
            for i in range(KEYS)
        ]
        with db.write() as session:
            session.execute(insert(ApiKeyRow), many)
        after = latencies(service, key, REQUESTS)
        with Client(service, flooding) as client, pytest.raises(CirisError, match="the most that it may have"):
            client.add_key("more", "read")
    db.close()
    print(f"{database}, milliseconds without and with {KEYS} keys: {before} {after}")
    assert after["p50"] < 2 * before["p50"]
    assert after["p99"] < 2 * before["p99"] + JITTER_MS


@contextmanager
def all_the_time(
    url: str, keys_of_others: list[str], clients: int, ask: Callable[[httpx2.Client], httpx2.Response]
) -> Iterator[Counter[int]]:
    """This many clients ask again and again; how often which status was answered."""
    over, answered = threading.Event(), Counter[int]()

    def repeat(key: str) -> None:
        with httpx2.Client(base_url=url, headers={"Authorization": f"Bearer {key}"}, timeout=300) as client:
            while not over.is_set():
                answered[ask(client).status_code] += 1

    threads = [threading.Thread(target=repeat, args=(keys_of_others[i % len(keys_of_others)],)) for i in range(clients)]
    for thread in threads:
        thread.start()
    time.sleep(5)
    try:
        yield answered
    finally:
        over.set()
        for thread in threads:
            thread.join()


@contextmanager
def uploads_that_last(url: str, keys_of_others: list[str]) -> Iterator[Counter[int]]:
    """Four clients send small zips with a mesh of 60 MB. Two are being read, and two wait."""
    mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + "f 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n" * (60 * 2**20 // 32)
    data = zipped(**{"arm.urdf": URDF.format(LINK), "m.obj": mesh})
    assert len(data) < 400_000
    upload = {"bundle": ("scene.zip", data, "application/zip")}
    with all_the_time(url, keys_of_others[:1], 4, lambda client: client.post("/v1/scenes", files=upload)) as answered:
        yield answered


@contextmanager
def reads_that_last(url: str, keys_of_others: list[str]) -> Iterator[Counter[int]]:
    """Thirty-two clients read all pairs of a large job."""
    with httpx2.Client(base_url=url, headers={"Authorization": f"Bearer {keys_of_others[0]}"}) as client:
        (job,) = client.get("/v1/jobs").json()["jobs"]
    with all_the_time(url, keys_of_others, 32, lambda client: client.get(f"/v1/jobs/{job['id']}/pairs")) as answered:
        yield answered
    assert set(answered) <= {200, 429}


@contextmanager
def streams_held_open(url: str, keys_of_others: list[str]) -> Iterator[Counter[int]]:
    """Hundreds of connections listen to the events of a project."""
    with ExitStack() as held:
        answered = Counter[int]()
        for i in range(STREAMS):
            client = held.enter_context(httpx2.Client(base_url=url, headers={"Authorization": f"Bearer {keys_of_others[i % 9]}"}))
            answered[held.enter_context(client.stream("GET", "/v1/events/stream")).status_code] += 1
        yield answered
    assert answered == {200: OF_PROJECT, 503: STREAMS - OF_PROJECT}


@contextmanager
def jobs_of_nine_keys(url: str, keys_of_others: list[str]) -> Iterator[None]:
    """Nine jobs of another project have all solvers."""
    for key in keys_of_others:
        with Client(url, key) as client:
            grow(client, deadline_seconds=600)
    time.sleep(5)
    yield


@pytest.mark.slow
@pytest.mark.parametrize("attack", [uploads_that_last, jobs_of_nine_keys, reads_that_last, streams_held_open])
def test_the_work_of_another_project_costs_requests_little(
    attack: Callable[[str, list[str]], AbstractContextManager[object]], tmp_path: Path
) -> None:
    url = f"sqlite:///{tmp_path / 'ciris.sqlite3'}"
    migrate.upgrade(url)
    db = Database(url)
    with db.write() as session:
        projects.add(session, "others")
        theirs = [keys.add(session, f"key{i}", Scope.SUBMIT, "others") for i in range(9)]
        own = keys.add(session, "own", Scope.SUBMIT)
    with db.of("others").write() as session:
        job, _ = jobs.create(session, kind="grow", scene_id=a_scene(session, posts=PAIRS).id, options={"random_seed": 0})
        jobs.start(session, job)
        add_pairs(session, job, PAIRS)
        jobs.cancel(session, job.id)
    db.close()
    with a_service(tmp_path / "data", url, solvers=2) as service, Client(service, own) as client:
        client.add_scene(EXAMPLES / "planar_2dof" / "scene.yaml")
        latencies(service, own, REQUESTS)
        before = latencies(service, own, REQUESTS)
        with attack(service, theirs) as answered:
            after, began = latencies(service, own, REQUESTS), time.monotonic()
            client.add_scene(EXAMPLES / "planar_2dof" / "scene.yaml")
            upload_seconds = time.monotonic() - began
    print(
        f"{attack.__name__}: milliseconds before and beside it: {before} {after}; an upload of its own {upload_seconds:.1f} s; {answered}"
    )
    assert after["p99"] < 2 * before["p99"] + JITTER_MS
    assert upload_seconds < 10


def grow(client: Client, deadline_seconds: float) -> str:
    """Asks for a region of the arm over the bin, whose seeding takes long."""
    scene = client.add_scene(EXAMPLES / "ur3e_bin" / "scene.yaml")["id"]
    q = yaml.safe_load((EXAMPLES / "ur3e_bin" / "seed.yaml").read_text())["q"]
    job, _ = client.create_job({"kind": "grow", "scene": scene, "seed": {"q": q}, "deadline_seconds": deadline_seconds})
    return str(job["id"])


def solvers_of(db: Database, seconds: float) -> dict[str, float]:
    """How many solvers worked for each project in these seconds, on average."""
    looks, seen = 0, Counter[str]()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        with db.read() as session:
            for (project, _), count in leases.count_of_keys(session).items():
                seen[project] += count
        looks += 1
        time.sleep(0.1)
    return {project: count / looks for project, count in seen.items()}


def some_pair_is_done(db: Database) -> bool:
    with db.read() as session:
        return session.scalar(select(PairRow.id).where(PairRow.seconds.is_not(None)).limit(1)) is not None


def held(db: Database, job_id: str) -> bool:
    """Says whether a solver works for the job."""
    with db.read() as session:
        return bool(leases.of_job(session, StepRow, job_id) or leases.of_job(session, PairRow, job_id))


def until(condition: Callable[[], bool], end: float) -> None:
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.slow
def test_nine_keys_leave_another_project_its_part(tmp_path: Path) -> None:
    """Nine jobs of one project, each of a key of its own, run on two solvers. Nine of one key of another project get as much."""
    url = f"sqlite:///{tmp_path / 'ciris.sqlite3'}"
    migrate.upgrade(url)
    db = Database(url)
    with db.write() as session:
        projects.add(session, "many")
        many = [keys.add(session, f"key{i}", Scope.SUBMIT, "many") for i in range(9)]
        one = keys.add(session, "one", Scope.SUBMIT)
    with a_service(tmp_path / "data", url, solvers=2) as service:
        for key in many:
            with Client(service, key) as client:
                grow(client, deadline_seconds=600)
        until(lambda: some_pair_is_done(db), time.monotonic() + 120)  # the solvers have loaded what they need
        with Client(service, one) as client:
            asked = time.monotonic()
            job = grow(client, deadline_seconds=600)
            until(lambda: held(db, job), asked + 120)
            waited = time.monotonic() - asked
            for _ in range(8):
                grow(client, deadline_seconds=600)
            shares = solvers_of(db, 150.0)
    db.close()
    print(f"first piece after {waited:.1f} s; then solvers by project: {shares}")
    assert waited < 30.0
    assert shares[DEFAULT_PROJECT] / sum(shares.values()) == pytest.approx(0.5, rel=0.1)
