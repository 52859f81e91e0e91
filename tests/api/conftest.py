"""The application on a migrated SQLite database and a real queue, and a really certified region to serve."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np
import pytest
import uvicorn
from fastapi.testclient import TestClient

from api.app import create_app
from certifier.jobs.region import Region, certified_region
from certifier.jobs.share import SampledProposal
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Outcome, Stage
from certifier.pair.certification import Certification
from certifier.pair.result import PairResult
from db import jobs, leases, pairs, regions, scenes, workers
from db import session as storage
from db import work as claims
from db.session import Database
from db.settings import settings
from db.states import WorkerState
from db.types import utcnow
from db.workers import Made, WorkerKind
from tests.certifier.scenes import accepted, cube, planar_arm
from tests.db.builders import a_running_job, add_iteration
from tests.scenes import slider
from tests.services import Queue
from tests.workers.service import SECRET_KEY
from tests.workers.service import environment as surroundings
from workers.app import celery_app
from workers.solver import work
from workers.turns import coordinate

BASE_URL = "http://127.0.0.1:8643"
PROBLEM = "application/problem+json"


@pytest.fixture
def database(sqlite_url: str) -> Iterator[Database]:
    database = Database(sqlite_url)
    yield database
    database.close()


@pytest.fixture
def environment(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """Settings that a test may set; whatever was built from them is built anew, before and after."""

    def forget() -> None:
        settings.cache_clear()
        celery_app.cache_clear()

    forget()
    yield monkeypatch
    forget()


@pytest.fixture
def client(database: Database, queue: Queue, environment: pytest.MonkeyPatch) -> Iterator[TestClient]:
    queue.flush()
    environment.setenv("CIRIS_REDIS_URL", queue.url)
    environment.setenv("CIRIS_SECRET_KEY", SECRET_KEY)
    environment.setattr("api.probes.WAIT_SECONDS", 10.0)  # the first look at the queue takes longer where the machine is busy
    with TestClient(create_app(database), base_url=BASE_URL) as client:
        yield client


@contextmanager
def served(database: Database) -> Iterator[str]:
    """The URL of a real server on the database, with the settings that are set now."""
    server = uvicorn.Server(uvicorn.Config(create_app(database), port=0, log_level="warning", timeout_graceful_shutdown=1))
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        time.sleep(0.02)
    yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    server.should_exit = True
    thread.join()


@pytest.fixture
def url(database: Database, client: TestClient) -> Iterator[str]:
    """A real server on the database of the client."""
    with served(database) as url:
        yield url


@contextmanager
def working() -> Iterator[None]:
    """A thread does what jobs ask for, as the workers do, on the database of the settings."""
    done = threading.Event()

    def serve() -> None:
        while not done.wait(0.02):
            with storage.database().read() as session:
                due = jobs.awaiting_coordination(session, utcnow())
            for job_id in due:
                coordinate(job_id)
            while piece := work():
                coordinate(piece.job_id)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


@pytest.fixture
def worker(client: TestClient, sqlite_url: str, queue: Queue) -> Iterator[None]:
    """Somebody works on the client's database."""
    with surroundings(CIRIS_DATABASE_URL=sqlite_url, CIRIS_REDIS_URL=queue.url), working():
        yield


@pytest.fixture
def scene(database: Database) -> Scene:
    """A slider with two pairs, stored."""
    scene = slider(posts=2)
    with database.write() as session:
        scenes.add(session, scene)
    return scene


@pytest.fixture(scope="session")
def certified() -> Region:
    """A region of the slider, -0.3 <= s <= 0.2, as if grown from the joint limits: both pairs certified and the proof verified."""
    scene = slider(posts=2)
    polytope = scene.polytope([[1.0], [-1.0]], [0.2, 0.3])
    certification = Certification(scene, polytope, np.zeros(1))
    results = [certification.certify(index) for index in range(len(scene.pairs))]
    proofs = {index: result.proof or b"" for index, result in enumerate(results)}
    proposal = SampledProposal.of(scene, scene.polytope([], []))
    return certified_region(scene, accepted(polytope, np.zeros(1)), proofs, {"seconds": 1.0}, proposal)


@pytest.fixture
def region(database: Database, scene: Scene, certified: Region) -> str:
    """The id of a stored region, made by a job that has succeeded."""
    return store_region(database, certified)


@pytest.fixture
def running(database: Database, scene: Scene) -> str:
    """The id of a job that runs."""
    with database.write() as session:
        job, _ = jobs.create(session, kind="grow", scene_id=scene.hash[:16], options={"seed": {"q": [0.0]}})
        jobs.start(session, job)
        return job.id


@pytest.fixture
def busy(database: Database) -> str:
    """The id of a job of which a worker certifies a pair; this process's parent stands for the worker."""
    with database.write() as session:
        workers.tell(session, Made(leases.name_of(os.getppid()), WorkerKind.SOLVE, "1.2", 4, 8, 2**34), WorkerState.RUNNING)
        job = a_running_job(session)
        assert claims.claim(session, job.id, lease_seconds=60, batch_seconds=0.5) is not None
        return job.id


@pytest.fixture
def planar(database: Database) -> Scene:
    """A planar arm of two links beside a box, stored."""
    scene = planar_arm(limit=1.2)
    with database.write() as session:
        scenes.add(session, scene)
    return scene


@cache
def cut_corner() -> Region:
    """A certified region of that arm, with a corner cut off."""
    planar = planar_arm(limit=1.2)
    box = cube(planar, [-0.2, -0.1], 0.1)
    polytope = planar.polytope([*box.C[:4], [1.0, 1.0]], [*box.d[:4], -0.2])
    return certified_polytope(planar, polytope, np.array([-0.22, -0.12]))


def certified_polytope(scene: Scene, polytope: Polytope, center: Array) -> Region:
    """The region of a polytope whose pairs all have a proof."""
    certification = Certification(scene, polytope, center)
    proofs = {index: certification.certify(index).proof or b"" for index in range(len(scene.pairs))}
    return certified_region(scene, accepted(polytope, center), proofs, {"seconds": 1.0}, None)


@pytest.fixture
def planar_region(database: Database, planar: Scene) -> str:
    """The id of a stored region of that arm, with a corner cut off."""
    return store_region(database, cut_corner())


def store_region(database: Database, certified: Region) -> str:
    """Runs a job by hand: one iteration, its pairs certified, the region accepted, the job ended."""
    manifest = certified.manifest
    with database.write() as session:
        row = scenes.get(session, manifest["scene"]["hash"][:16])
        job, _ = jobs.create(session, kind="grow", scene_id=row.id, options={"kind": "grow", "seed": {"q": [0.0]}, "random_seed": 0})
        jobs.start(session, job)
        names = [(index, pair["a"], pair["b"]) for index, pair in enumerate(manifest["pairs"])]
        add_iteration(
            session,
            job,
            index=0,
            label="contract",
            C=manifest["halfspace_normals"],
            d=manifest["halfspace_offsets"],
            center=manifest["interior_point"],
            pairs=[pairs.NewPair(index, a, b, 0.1) for index, a, b in names],
            reuse={},
            hard=[],
            failures=1,
        )
        claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=60)
        assert claim is not None
        found = PairResult(Outcome.CERTIFIED, Stage.SOS, seconds=0.1, margin=0.3, proof=b"proof of a pair")
        pairs.save(session, claim, {(index, 0): found for index, _, _ in names})
        region = regions.add(session, job, 0, manifest, certified.summary, certified.proof)
        jobs.finish(session, job, jobs.JobState.SUCCEEDED, reason="as large as asked for", outcome="certified")
        return region.id
