"""Many clients at once, on the whole stack while its workers compute: no error of the service's, 99 of 100 answers within 200 ms, and no
process that grows."""

from __future__ import annotations

import asyncio
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from pathlib import Path
from statistics import median
from typing import NamedTuple

import httpx2
import numpy as np
import pytest
import yaml
from sqlalchemy import func, select

from certifier.model import WORLD, Geometry, Pair, Scene
from certifier.scene import load_scene
from ciris.synchronous.client import Client
from db import keys, migrate, scenes
from db.keys import Scope
from db.models import PairRow
from db.session import Database
from tests.services import Postgres
from tests.workers.service import eventually

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
CLIENTS = 200
SECONDS = 60.0
PAUSE_SECONDS = 1.0
"""Between two requests of one client, on average."""
LONGEST_PAUSE_SECONDS = 60.0
"""The service closes connections that are idle for longer."""
POSTS = 0.02
"""Of the requests, this part creates jobs."""
P99_SECONDS = 0.2


@dataclass
class Tally:
    """What the clients saw within some time: seconds by kind of request, and statuses."""

    length: float
    seconds: dict[str, list[float]] = field(default_factory=dict)
    statuses: Counter[int] = field(default_factory=Counter)

    def quantile(self, part: float, kind: str | None = None) -> float:
        every = sorted(t for name, times in self.seconds.items() if kind in (None, name) for t in times)
        return every[int(part * (len(every) - 1))]

    def describe(self) -> str:
        total = sum(map(len, self.seconds.values()))
        lines = [f"{total} requests in {self.length:.0f} s; statuses {dict(self.statuses)}"]
        for kind in (None, *sorted(self.seconds)):
            count = total if kind is None else len(self.seconds[kind])
            quantiles = ", ".join(f"p{100 * part:g} {1000 * self.quantile(part, kind):.0f} ms" for part in (0.5, 0.9, 0.99, 1.0))
            lines.append(f"{kind or 'all':10} {count:6}  {quantiles}")
        return "\n".join(lines)


class Loaded(NamedTuple):
    """A whole stack: its URL, a key for every client, its database and its data directory."""

    url: str
    keys: list[str]
    database: str
    data: Path


@pytest.fixture(params=["sqlite", "postgresql"])
def service(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Loaded]:
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
        yield Loaded(json.loads((data / "stack.json").read_text())["url"], made, url, data)
        stack.send_signal(signal.SIGINT)


def busy_workers(url: str, key: str) -> tuple[str, str]:
    """The id of a small scene to post jobs about, and of a job, once the workers have hours of a large scene before them."""
    with Client(url, key) as client:
        large, small = (client.add_scene(EXAMPLES / name / "scene.yaml") for name in ("iiwa_shelf", "planar_2dof"))
        q = yaml.safe_load((EXAMPLES / "iiwa_shelf" / "seed.yaml").read_text())["q"]
        for random_seed in range(4):
            options = {"paper": {"max_rounds": 100}, "random_seed": random_seed}
            job, _ = client.create_job({"kind": "grow", "scene": large["id"], "seed": {"q": q}, "options": options})
    return small["id"], job["id"]


class Connection:
    """A client's connection, with as little work as possible on this side: what is measured is the service."""

    def __init__(self, url: str, key: str) -> None:
        self._host, _, port = url.removeprefix("http://").partition(":")
        self._port, self._headers = (
            int(port),
            f"Host: {self._host}:{port}\r\nAuthorization: Bearer {key}\r\nContent-Type: application/json\r\n",
        )

    async def open(self) -> None:
        self._reader, self._writer = await asyncio.open_connection(self._host, self._port)

    async def ask(self, method: str, path: str, body: bytes = b"") -> tuple[int, bytes]:
        """Status and body of the answer."""
        self._writer.write(f"{method} {path} HTTP/1.1\r\n{self._headers}Content-Length: {len(body)}\r\n\r\n".encode() + body)
        head = (await self._reader.readuntil(b"\r\n\r\n")).lower()
        length = int(head.partition(b"content-length:")[2].split(maxsplit=1)[0])
        return int(head.split(maxsplit=2)[1]), await self._reader.readexactly(length)


async def visit(
    url: str, scene: str, job: str, key: str, until: float, tally: Tally, posts: float = POSTS, pause: float = PAUSE_SECONDS
) -> None:
    """One client: looks at its last job and at what else there is, and posts another job now and then."""
    box = {"C": [[1, 0], [-1, 0], [0, 1], [0, -1]], "d": [0.01] * 4}
    certify = json.dumps({"kind": "certify", "scene": scene, "polytope": box}).encode()
    choice, connection = random.Random(key), Connection(url, key)
    await connection.open()
    await asyncio.sleep(choice.uniform(0, pause))
    while time.monotonic() < until:
        paths = {"job": f"/v1/jobs/{job}", "events": f"/v1/jobs/{job}/events", "pairs": f"/v1/jobs/{job}/pairs?limit=100"}
        paths |= {"jobs": "/v1/jobs?limit=20", "regions": f"/v1/regions?scene={scene}&limit=20"}
        kind = "post" if choice.random() < posts else choice.choices(list(paths), [6, 1, 1, 1, 1])[0]
        start = time.perf_counter()
        if kind == "post":
            status, answer = await connection.ask("POST", "/v1/jobs", certify)
        else:
            status, answer = await connection.ask("GET", paths[kind])
        tally.seconds.setdefault(kind, []).append(time.perf_counter() - start)
        tally.statuses[status] += 1
        if status == HTTPStatus.CREATED:
            job = json.loads(answer)["id"]
        await asyncio.sleep(min(choice.expovariate(1 / pause), LONGEST_PAUSE_SECONDS))


async def everybody(
    url: str, scene: str, job: str, made: list[str], seconds: float = SECONDS, posts: float = POSTS, pause: float = PAUSE_SECONDS
) -> Tally:
    tally, until = Tally(seconds), time.monotonic() + seconds
    await asyncio.gather(*(visit(url, scene, job, key, until, tally, posts, pause) for key in made))
    return tally


@pytest.mark.slow
def test_two_hundred_clients_while_the_workers_compute(service: Loaded) -> None:
    url, made, _, _ = service
    scene, job = busy_workers(url, made[0])
    tally = asyncio.run(everybody(url, scene, job, made))
    print(tally.describe())
    metrics = httpx2.get(f"{url}/metrics", headers={"Authorization": f"Bearer {made[0]}"}).text
    print("\n".join(line for line in metrics.splitlines() if line.startswith(("ciris_jobs", "ciris_pairs", "ciris_queue"))))
    assert set(tally.statuses) <= {200, 201}
    assert tally.quantile(0.99) < P99_SECONDS


LONG_SECONDS, SETTLED_SECONDS = 900.0, 300.0
"""The clients ask for LONG_SECONDS. After SETTLED_SECONDS every cache is full, and from then on memory is looked at."""
LOOK_SECONDS = 10.0
FEWER_POSTS = 0.004
"""So most clients look at the large job to the end."""
LONGER_PAUSE_SECONDS = 15.0
"""Answers about a job of 5040 pairs take long, and solvers go after the API. Clients with these pauses leave them half of the machine."""
FEWEST_PAIRS = 5040
"""Those of one job. Where fewer are certified meanwhile, the solvers had hardly anything to do."""
GROWTH = 1.1
OF_MESSAGES_MIB = 5.0
"""A part that is as small as the queue may grow by this: it holds the messages of jobs that wait."""
POSTS_AROUND = 720


def among_posts() -> tuple[Scene, dict[str, object]]:
    """An arm of seven joints among small balls out of its reach, which makes 5040 pairs, and a box in s where all of them are free."""
    scene = load_scene(EXAMPLES / "iiwa_shelf" / "scene.yaml")
    directions = np.random.default_rng(0).normal(size=(POSTS_AROUND, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    posts = tuple(
        Geometry(f"world/post{i}", WORLD, 1.6 * at[None], 0.05, {"kind": "sphere", "radius": 0.05}) for i, at in enumerate(directions)
    )
    links = [geometry for geometry in scene.geometries if geometry.name.startswith("iiwa/link_")][1:]
    pairs = tuple(Pair(link.name, post.name) for link in links for post in posts)
    assert len(pairs) == 5040
    s = scene.to_s(np.array(yaml.safe_load((EXAMPLES / "iiwa_shelf" / "seed.yaml").read_text())["q"]))
    eye = np.eye(scene.n)
    box = {"C": np.concatenate([eye, -eye]).tolist(), "d": np.concatenate([s + 0.2, 0.2 - s]).tolist()}
    return replace(scene, name="posts", geometries=(*scene.geometries, *posts), pairs=pairs), box


def memory(sessions: dict[str, int]) -> dict[str, float]:
    """MiB of the processes of each of these sessions: their own, and their parts of what they share with others."""
    name_of, found = {pid: name for name, pid in sessions.items()}, dict.fromkeys(sessions, 0.0)
    for process in Path("/proc").iterdir():
        with suppress(OSError):  # it has ended
            if process.name.isdecimal() and (name := name_of.get(os.getsid(int(process.name)))):
                (line,) = (line for line in (process / "smaps_rollup").read_text().splitlines() if line.startswith("Pss:"))
                found[name] += int(line.split()[1]) / 1024
    return found


@contextmanager
def looking_at_memory(data: Path) -> Iterator[list[tuple[float, dict[str, float]]]]:
    """What the parts of the stack need, every ten seconds: seconds since the beginning, and :func:`memory`."""
    looks: list[tuple[float, dict[str, float]]] = []
    over, began = threading.Event(), time.monotonic()

    def look() -> None:
        while not over.wait(LOOK_SECONDS):
            looks.append((time.monotonic() - began, memory(json.loads((data / "stack.json").read_text())["pids"])))

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield looks
    finally:
        over.set()
        thread.join()


@contextmanager
def one_job_after_the_other(url: str, key: str, request: dict[str, object]) -> Iterator[list[str]]:
    """The same job again and again, from here to the end of the block; the ids of those that were begun."""
    over, begun = threading.Event(), list[str]()

    def submit() -> None:
        with Client(url, key) as client:
            while not over.is_set():
                job, _ = client.create_job(request)
                begun.append(job["id"])
                while not over.wait(1.0) and not client.job(job["id"])["ended"]:
                    pass

    thread = threading.Thread(target=submit)
    thread.start()
    try:
        yield begun
    finally:
        over.set()
        thread.join()


@pytest.mark.slow
@pytest.mark.parametrize("service", ["postgresql"], indirect=True)
def test_no_process_grows_in_fifteen_minutes_of_two_hundred_clients(service: Loaded) -> None:
    url, made, database_url, data = service
    scene, box = among_posts()
    database = Database(database_url)
    with database.write() as session:
        large = scenes.add(session, scene).id
    with Client(url, made[0]) as client:
        small = client.add_scene(EXAMPLES / "planar_2dof" / "scene.yaml")["id"]
    request: dict[str, object] = {"kind": "certify", "scene": large, "polytope": box}
    with one_job_after_the_other(url, made[0], request) as begun, looking_at_memory(data) as looks:
        eventually(lambda: begun, "the first job of 5040 pairs")
        tally = asyncio.run(everybody(url, small, begun[0], made, LONG_SECONDS, FEWER_POSTS, LONGER_PAUSE_SECONDS))
    with database.read() as session:
        done = session.scalar(select(func.count()).where(PairRow.job_id.in_(begun), PairRow.seconds.is_not(None))) or 0
    database.close()
    print(f"{tally.describe()}\n{len(begun)} jobs of {len(scene.pairs)} pairs; {done} pairs were certified")
    third = (LONG_SECONDS - SETTLED_SECONDS) / 3
    early = [needed for at, needed in looks if SETTLED_SECONDS <= at < SETTLED_SECONDS + third]
    late = [needed for at, needed in looks if at >= LONG_SECONDS - third]
    before, after = ({name: median(look[name] for look in part) for name in looks[0][1]} for part in (early, late))
    for name, first in looks[0][1].items():
        print(
            f"{name:8} {first:6.0f} MiB at first, {before[name]:6.0f} MiB after {SETTLED_SECONDS:.0f} s, {after[name]:6.0f} MiB at the end"
        )
    assert set(tally.statuses) <= {200, 201}
    assert done >= FEWEST_PAIRS
    assert all(after[name] < max(GROWTH * before[name], before[name] + OF_MESSAGES_MIB) for name in before)


WRITERS = 8
HELD_SECONDS, FREE_SECONDS = 5.0, 0.5
"""Somebody holds SQLite's lock for a time, then lets the writers have it for another time, again and again."""


@contextmanager
def lock_held_most_of_the_time(url: str) -> Iterator[None]:
    over = threading.Event()

    def hold() -> None:
        database = Database(url)
        while not over.is_set():
            with database.writer.connect() as connection, connection.begin():
                over.wait(HELD_SECONDS)
            over.wait(FREE_SECONDS)
        database.close()

    thread = threading.Thread(target=hold)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


async def write(url: str, scene: str, key: str, until: float, tally: Tally) -> None:
    """A client that does nothing but post jobs, one after the other."""
    certify = {"kind": "certify", "scene": scene, "polytope": {"C": [[1, 0], [-1, 0], [0, 1], [0, -1]], "d": [0.01] * 4}}
    connection = Connection(url, key)
    await connection.open()
    while time.monotonic() < until:
        start = time.perf_counter()
        status, _ = await connection.ask("POST", "/v1/jobs", json.dumps(certify).encode())
        tally.seconds.setdefault("post", []).append(time.perf_counter() - start)
        tally.statuses[status] += 1


async def readers_and_writers(url: str, scene: str, job: str, made: list[str]) -> tuple[Tally, Tally]:
    reading, writing, until = Tally(SECONDS), Tally(SECONDS), time.monotonic() + SECONDS
    readers = (visit(url, scene, job, key, until, reading, posts=0.0) for key in made)
    await asyncio.gather(*readers, *(write(url, scene, key, until, writing) for key in made[:WRITERS]))
    return reading, writing


@pytest.mark.slow
@pytest.mark.parametrize("service", ["sqlite"], indirect=True)
def test_two_hundred_readers_do_not_wait_for_eight_writers_who_wait(service: Loaded) -> None:
    url, made, database_url, _ = service
    with Client(url, made[0]) as client:
        scene = client.add_scene(EXAMPLES / "planar_2dof" / "scene.yaml")["id"]
        job, _ = client.create_job({"kind": "grow", "scene": scene, "seed": {"q": [0.4, 0.3]}, "options": {"stages": 1}})
    with lock_held_most_of_the_time(database_url):
        reading, writing = asyncio.run(readers_and_writers(url, scene, job["id"], made))
    waited = sum(writing.seconds["post"]) / SECONDS
    print(f"readers: {reading.describe()}\nwriters: {writing.describe()}\n{waited:.1f} of {WRITERS} writers waited on average")
    assert set(reading.statuses) == {200}
    assert set(writing.statuses) == {201}
    assert waited > 0.8 * WRITERS, "the writers did not wait"
    assert writing.quantile(0.9) > HELD_SECONDS / 2, "they waited for something else than the lock"
    assert reading.quantile(0.99) < P99_SECONDS
