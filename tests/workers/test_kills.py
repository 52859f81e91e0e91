"""50 kills at random: whatever dies, every job ends with the region that it has undisturbed, and its record is in order.

``CIRIS_CAMPAIGN_SEED`` repeats a campaign's choices (not the machine's timing).
"""

from __future__ import annotations

import os
import random
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import cycle
from pathlib import Path
from typing import Any, TypeVar

import pytest
import yaml

from certifier.errors import CirisError
from ciris.synchronous.client import Client
from tests.services import Queue, free_port, queue_server
from tests.workers.record import check_record, region_of
from tests.workers.service import Service, eventually, running_service

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "examples"
KILLS = 50
LIMIT_SECONDS = 3600.0
JOBS_AT_A_TIME = 3
BETWEEN_KILLS = (0.1, 0.7)
"""In lengths of an undisturbed job, so that slow machines get on as fast ones do."""
UNTIL_RESTART = (0.0, 1.0)
"""Seconds."""
TARGETED = {"paper": {"pushes": 1, "max_rounds": 1}}
UNIFORM = {"paper": {"contraction": "uniform", "bisection_steps": 4, "max_rounds": 1}}
BY_CELLS = {"cells": 600}
JOBS: dict[str, tuple[str, dict[str, Any]]] = {
    "planar, targeted": ("planar_2dof", TARGETED),
    "planar, uniform": ("planar_2dof", UNIFORM),
    "planar, by cells": ("planar_2dof", BY_CELLS),
    "arm, targeted": ("arm_3dof", TARGETED),
    "arm, uniform": ("arm_3dof", UNIFORM),
}
"""Example, options. With the papers' algorithm they begin with a box that collides, so that certifications fail on the way."""
HALF_WIDTH = 0.4
Answer = TypeVar("Answer")


def ask(question: Callable[..., Answer], *arguments: object) -> Answer:
    """The service's answer; asks again while there is nobody to give one."""
    answers: list[Answer] = []

    def answered() -> bool:
        try:
            answers.append(question(*arguments))
        except CirisError as error:
            if error.code != "unreachable":
                raise
        return bool(answers)

    eventually(answered, "the API answers")
    return answers[0]


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def running(database_url: str, port: int, tmp_path: Path) -> Iterator[tuple[Service, Queue]]:
    """A service of our own, API and queue included."""
    with queue_server() as queue, running_service(database_url, queue.url, tmp_path, CIRIS_PORT=str(port)) as service:
        service.start("api")
        yield service, queue


class Killer:
    """Kills something every few seconds and starts it again a moment later."""

    def __init__(self, service: Service, queue: Queue, choices: random.Random, length: float) -> None:
        self._service, self._queue, self._choices, self._length = service, queue, choices, length
        self._next = time.monotonic()
        self.killed: Counter[str] = Counter()

    def act(self) -> None:
        """Kills if it is time to."""
        if time.monotonic() < self._next or self.killed.total() >= KILLS:
            return
        target = self._choices.choice(["api", "control", "solve", "child", "queue", "queue emptied"])
        pause, until_next = self._choices.uniform(*UNTIL_RESTART), self._length * self._choices.uniform(*BETWEEN_KILLS)
        print(f"kill {self.killed.total() + 1}: {target}, for {pause:.2f} s", flush=True)
        if target == "child":
            with suppress(ProcessLookupError, IndexError, FileNotFoundError):
                os.kill(self._choices.choice(self._service.children("solve")), signal.SIGKILL)
                self.killed[target] += 1
        elif target in ("api", "control", "solve"):
            self._service.kill(target)
            time.sleep(pause)
            self._service.start(target)
            self.killed[target] += 1
        else:
            self._queue.kill(losing_everything=target == "queue emptied")
            time.sleep(pause)
            self._queue.start()
            self.killed[target] += 1
        self._next = time.monotonic() + until_next


def test_every_job_ends_as_if_nothing_had_died(running: tuple[Service, Queue], port: int) -> None:
    seed = int(os.environ.get("CIRIS_CAMPAIGN_SEED") or random.SystemRandom().randrange(10**6))
    print(f"CIRIS_CAMPAIGN_SEED={seed}")
    service, queue = running
    with Client(f"http://127.0.0.1:{port}") as client:
        requests = _requests(client)
        began = time.monotonic()
        undisturbed = {name: region_of(_run(client, request)) for name, request in requests.items()}
        length = (time.monotonic() - began) / len(requests)
        began, killer = time.monotonic(), Killer(service, queue, random.Random(seed), length)
        names, running_jobs, ended = cycle(requests), dict[str, str](), 0
        while killer.killed.total() < KILLS or running_jobs:
            assert time.monotonic() - began < LIMIT_SECONDS, f"{running_jobs} do not end"
            killer.act()
            service.start_again()
            while killer.killed.total() < KILLS and len(running_jobs) < JOBS_AT_A_TIME:
                name = next(names)
                job, _ = ask(client.create_job, requests[name], f"{seed}: {ended + len(running_jobs)}")
                running_jobs[job["id"]] = name
            for job_id, name in list(running_jobs.items()):
                job = ask(client.job, job_id)
                if job["ended"]:
                    assert job["state"] == "succeeded", job
                    check_record(job_id)
                    assert region_of(job_id) == undisturbed[name]
                    del running_jobs[job_id]
                    ended += 1
            time.sleep(0.1)
    print(f"{dict(killer.killed)}; {ended} jobs in {time.monotonic() - began:.0f} s, an undisturbed one takes {length:.1f} s")


def _requests(client: Client) -> dict[str, dict[str, Any]]:
    requests = {}
    for name, (example, options) in JOBS.items():
        scene = ask(client.add_scene, EXAMPLES / example / "scene.yaml")
        q = yaml.safe_load((EXAMPLES / example / "seed.yaml").read_text())["q"]
        requests[name] = {
            "kind": "grow",
            "scene": scene["id"],
            "seed": {"q": q, **({"method": "box", "half_width": HALF_WIDTH} if "paper" in options else {})},
            "options": options,
        }
    return requests


def _run(client: Client, request: dict[str, Any]) -> str:
    job_id = str(ask(client.create_job, request)[0]["id"])
    eventually(lambda: ask(client.job, job_id)["ended"], "the job ends undisturbed", 600)
    check_record(job_id)
    return job_id
