"""Many clients at once, on the whole stack while its workers compute: no error of the service's, and 99 of 100 answers within 200 ms."""

from __future__ import annotations

import asyncio
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import httpx2
import pytest
import yaml

from client import Client
from db import keys, migrate
from db.keys import Scope
from db.session import Database
from tests.services import Postgres

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
CLIENTS = 200
SECONDS = 60.0
PAUSE_SECONDS = 1.0
"""Between two requests of one client, on average."""
POSTS = 0.02
"""Of the requests, this part creates jobs."""
P99_SECONDS = 0.2


@dataclass
class Tally:
    """What the clients saw: seconds by kind of request, and statuses."""

    seconds: dict[str, list[float]] = field(default_factory=dict)
    statuses: Counter[int] = field(default_factory=Counter)

    def quantile(self, part: float, kind: str | None = None) -> float:
        every = sorted(t for name, times in self.seconds.items() if kind in (None, name) for t in times)
        return every[int(part * (len(every) - 1))]

    def describe(self) -> str:
        total = sum(map(len, self.seconds.values()))
        lines = [f"{total} requests in {SECONDS:.0f} s; statuses {dict(self.statuses)}"]
        for kind in (None, *sorted(self.seconds)):
            count = total if kind is None else len(self.seconds[kind])
            quantiles = ", ".join(f"p{100 * part:g} {1000 * self.quantile(part, kind):.0f} ms" for part in (0.5, 0.9, 0.99, 1.0))
            lines.append(f"{kind or 'all':10} {count:6}  {quantiles}")
        return "\n".join(lines)


@pytest.fixture(params=["sqlite", "postgresql"])
def service(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[str, list[str]]]:
    """The URL of a whole stack, and a key for every client."""
    data = tmp_path / "data"
    url = f"sqlite:///{data / 'ciris.sqlite3'}"
    if request.param == "postgresql":
        postgres: Postgres = request.getfixturevalue("postgres")
        url = postgres.new_database()
    migrate.upgrade(url)
    database = Database(url)
    with database.write() as session:
        made = [keys.add(session, f"client-{i}", Scope.SUBMIT) for i in range(CLIENTS)]
    database.close()
    clean = {name: value for name, value in os.environ.items() if not name.startswith("CIRIS_")}
    environment = {**clean, "PYTHONPATH": str(ROOT), "CIRIS_DATABASE_URL": url, "CIRIS_SOLVE_PROCESSES": "2"}
    command = [sys.executable, "-m", "workers.stack", "--data", str(data), "--port", "0"]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as stack:
        assert stack.stdout is not None
        assert "ciris is up" in stack.stdout.readline()
        yield json.loads((data / "stack.json").read_text())["url"], made
        stack.send_signal(signal.SIGINT)


def busy_workers(url: str, key: str) -> tuple[str, str]:
    """The id of a small scene to post jobs about, and of a job, once the workers have hours of a large scene before them."""
    with Client(url, key) as client:
        large, small = (client.add_scene(EXAMPLES / name / "scene.yaml") for name in ("iiwa_shelf", "planar_2dof"))
        q = yaml.safe_load((EXAMPLES / "iiwa_shelf" / "seed.yaml").read_text())["q"]
        for random_seed in range(4):
            options = {"max_rounds": 100, "random_seed": random_seed}
            job, _ = client.create_job({"kind": "grow", "scene": large["id"], "seed": {"q": q}, "options": options})
    return small["id"], job["id"]


async def visit(http: httpx2.AsyncClient, scene: str, job: str, key: str, until: float, tally: Tally) -> None:
    """One client: looks at its last job and at what else there is, and posts another job now and then."""
    headers = {"Authorization": f"Bearer {key}"}
    certify = {"kind": "certify", "scene": scene, "polytope": {"C": [[1, 0], [-1, 0], [0, 1], [0, -1]], "d": [0.01] * 4}}
    choice = random.Random(key)
    await asyncio.sleep(choice.uniform(0, PAUSE_SECONDS))
    while time.monotonic() < until:
        if choice.random() < POSTS:
            kind, call = "post", http.post("/v1/jobs", json=certify, headers=headers)
        else:
            paths = {"job": f"/v1/jobs/{job}", "events": f"/v1/jobs/{job}/events", "pairs": f"/v1/jobs/{job}/pairs"}
            paths |= {"jobs": "/v1/jobs?limit=20", "regions": f"/v1/regions?scene={scene}&limit=20"}
            kind = choice.choices(list(paths), [6, 1, 1, 1, 1])[0]
            call = http.get(paths[kind], headers=headers)
        start = time.perf_counter()
        answer = await call
        tally.seconds.setdefault(kind, []).append(time.perf_counter() - start)
        tally.statuses[answer.status_code] += 1
        if kind == "post" and answer.is_success:
            job = answer.json()["id"]
        await asyncio.sleep(choice.expovariate(1 / PAUSE_SECONDS))


async def everybody(url: str, scene: str, job: str, made: list[str]) -> Tally:
    tally, until = Tally(), time.monotonic() + SECONDS
    limits = httpx2.Limits(max_connections=CLIENTS, max_keepalive_connections=CLIENTS)
    async with httpx2.AsyncClient(base_url=url, limits=limits, timeout=60, trust_env=False) as http:
        await asyncio.gather(*(visit(http, scene, job, key, until, tally) for key in made))
    return tally


@pytest.mark.slow
def test_two_hundred_clients_while_the_workers_compute(service: tuple[str, list[str]]) -> None:
    url, made = service
    scene, job = busy_workers(url, made[0])
    tally = asyncio.run(everybody(url, scene, job, made))
    print(tally.describe())
    metrics = httpx2.get(f"{url}/metrics", headers={"Authorization": f"Bearer {made[0]}"}).text
    print("\n".join(line for line in metrics.splitlines() if line.startswith(("ciris_jobs", "ciris_pairs", "ciris_queue"))))
    assert set(tally.statuses) <= {200, 201}
    assert tally.quantile(0.99) < P99_SECONDS
