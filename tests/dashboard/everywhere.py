"""Every page of the dashboard, with something on it, for tests that go over all of them."""

from __future__ import annotations

import os
from typing import Any

from fastapi.testclient import TestClient

from certifier.jobs.region import Region
from certifier.model import Scene
from db import leases, workers
from db.session import Database
from db.states import WorkerState
from db.workers import Made, WorkerKind
from tests.api.conftest import store_region
from tests.dashboard.test_pages import motion_job

NAMES = (
    "jobs",
    "new",
    "job",
    "motion",
    "scenes",
    "scene",
    "region",
    "compare",
    "project",
    "inventory",
    "workers",
    "help",
    "login",
    "problem",
)
DRAWN = {"new": ".slider", "job": ".pairs .row", "motion": ".player", "scene": ".planning", "region": ".slider"}
"""What is there once the browser has drawn its part of a page."""
_VERDICT: dict[str, Any] = {
    "space": "q",
    "degree": 1,
    "waypoints": 2,
    "outcome": "certified",
    "guarantee": "exact",
    "certified_to": {"piece": 0, "time": 1.0, "q": [0.1]},
    "proved_distance": 0.01,
    "margin": 0.01,
    "proof": None,
    "clearance": None,
    "tube": None,
    "stop": None,
    "intervals": 1,
    "seconds": 1.0,
    "verify_seconds": 0.1,
}


def addresses(client: TestClient, database: Database, scene: Scene, region: str, certified: Region) -> dict[str, str]:
    """Stores what the pages show beside the region of a job, and returns name -> address, without the service's."""
    with database.write() as session:
        workers.tell(session, Made(leases.name_of(os.getppid()), WorkerKind.SOLVE, "1.2", 4, 8, 2**34), WorkerState.RUNNING)
    job = client.get("/v1/jobs").json()["jobs"][0]["id"]
    other, motion = (
        store_region(database, certified),
        motion_job(database, scene, _VERDICT | {"scene": {"name": "slider", "hash": scene.hash}}),
    )
    ids = [f"/jobs/{job}", f"/jobs/{motion}", "/scenes", "/scenes/slider", f"/regions/{region}", f"/compare?a={region}&b={other}"]
    return dict(
        zip(
            NAMES,
            ["/", "/new?scene=slider", *ids, "/project", "/inventory", "/workers", "/docs/scenes", "/login", "/jobs/none"],
            strict=True,
        )
    )


def drawn(page: Any, name: str) -> None:
    """Waits until all of a page is drawn."""
    page.locator(DRAWN.get(name, "h1")).first.wait_for(timeout=60_000)
