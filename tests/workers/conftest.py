"""Scenes and services for the tests of the workers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from certifier.model import Scene
from certifier.pair.forecast import forecast
from certifier.scene import load_scene
from tests.scenes import slider
from tests.services import Queue, queue_server
from tests.workers.options import box_around
from tests.workers.service import Service, environment, running_service, submit
from workers.turns import coordinate

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="session")
def planar() -> Scene:
    """Two joints, six pairs of some 50 ms."""
    return load_scene(EXAMPLES / "planar_2dof" / "scene.yaml")


@pytest.fixture(scope="session")
def arm() -> tuple[Scene, np.ndarray]:
    """Seven joints with only the four pairs that take longest (some 0.5 s each), and a free configuration in s."""
    scene = load_scene(EXAMPLES / "iiwa_shelf" / "scene.yaml")
    longest = np.argsort([-cost.seconds for cost in forecast(scene)])[:4]
    q = yaml.safe_load((EXAMPLES / "iiwa_shelf" / "seed.yaml").read_text())["q"]
    return replace(scene, pairs=tuple(scene.pairs[i] for i in sorted(longest))), scene.to_s(np.array(q))


@pytest.fixture(scope="session")
def queue() -> Iterator[Queue]:
    """The workers' own queue: they would take the messages of other tests."""
    with queue_server() as server:
        yield server


@pytest.fixture(scope="module")
def own_queue() -> Iterator[Queue]:
    """A queue without the shared workers, for tests that count its messages or start workers of their own."""
    with queue_server() as server:
        yield server


@pytest.fixture(scope="session", params=["sqlite", "postgresql"])
def service(request: pytest.FixtureRequest, queue: Queue, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """Real workers on either database, shared by the tests that leave them as they were."""
    logs = tmp_path_factory.mktemp(f"service-{request.param}")
    if request.param == "sqlite":
        source: Path = request.getfixturevalue("migrated_sqlite")
        (logs / "test.sqlite3").write_bytes(source.read_bytes())
        url = f"sqlite:///{logs / 'test.sqlite3'}"
    else:
        url = request.getfixturevalue("postgres").new_database(request.getfixturevalue("migrated_postgres"))
    queue.flush()
    with running_service(url, queue.url, logs) as running:
        yield running


@pytest.fixture
def here(database_url: str, own_queue: Queue) -> Iterator[None]:
    """This process is the service."""
    own_queue.flush()
    with environment(CIRIS_DATABASE_URL=database_url, CIRIS_REDIS_URL=own_queue.url):
        yield


@pytest.fixture
def job_id(here: None) -> str:
    """A running job with three open pairs."""
    made = submit(slider(posts=3), box_around([0.0], 0.1))
    coordinate(made)
    return made
