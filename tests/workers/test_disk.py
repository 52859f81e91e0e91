"""A full disk, one that becomes read-only, and a slow one: the stack lives on, says what is wrong, and loses nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import httpx
import pytest
import yaml

from certifier.scene import pack_bundle
from db.disk import LOOK_SECONDS
from db.leases import _started
from tests.workers import disks
from tests.workers.record import check_record, region_of
from tests.workers.service import ROOT, environment, eventually
from tests.workers.test_stack import COMMAND, Stack

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="only root mounts disks")]

EXAMPLE = Path(__file__).parents[2] / "examples" / "arm_3dof"
GROW = {
    "kind": "grow",
    "seed": {"method": "box", "q": yaml.safe_load((EXAMPLE / "seed.yaml").read_text())["q"], "half_width": 0.4},
    "options": {"paper": {"pushes": 1, "max_rounds": 1}},
}
JOBS, BYTES_A_SECOND = 8, 50_000


class Service:
    """A stack on a disk, and what a client sees of it."""

    def __init__(self, directory: Path) -> None:
        self.data = directory / "data"
        self.stack = Stack(self.data)
        self.client = httpx.Client(base_url=self.stack.description["url"], timeout=60, limits=httpx.Limits(max_keepalive_connections=0))
        answer = self.client.post("/v1/scenes", files={"bundle": pack_bundle(EXAMPLE / "scene.yaml")})
        assert answer.status_code == 201, answer.text
        self.scene = answer.json()["id"]

    def submit(self) -> str:
        answer = self.client.post("/v1/jobs", json={**GROW, "scene": self.scene})
        assert answer.status_code == 201, answer.text
        return str(answer.json()["id"])

    def job(self, job_id: str) -> dict[str, Any]:
        answer = self.client.get(f"/v1/jobs/{job_id}")
        assert answer.status_code == 200, answer.text
        return dict(answer.json())

    def ended(self, job_id: str) -> dict[str, Any]:
        """What is certified, once the job has ended well and its record is in order."""
        eventually(lambda: self.job(job_id)["ended"], "the job ends", 600)
        assert self.job(job_id)["state"] == "succeeded", self.job(job_id)
        with environment(CIRIS_DATA_DIR=str(self.data)):
            check_record(job_id)
            return region_of(job_id)

    def under_way(self) -> str:
        """A new job that has certified some of its pairs."""
        job_id = self.submit()
        eventually(lambda: sum(event["kind"] == "pairs" for event in self.events(job_id)) >= 3, "the job is under way")
        return job_id

    def events(self, job_id: str) -> list[dict[str, Any]]:
        return list(self.client.get(f"/v1/jobs/{job_id}/events").json()["events"])

    def disk(self) -> str:
        """What /readyz says of the disk."""
        return str(self.client.get("/readyz").json()["checks"]["disk"])

    def refuses(self) -> None:
        """Nothing new is taken, with a problem that says why; reading goes on."""
        for answer in (
            self.client.post("/v1/jobs", json={**GROW, "scene": self.scene}),
            self.client.post("/v1/scenes", files={"bundle": pack_bundle(EXAMPLE / "scene.yaml")}),
        ):
            assert (answer.status_code, answer.json()["code"]) == (503, "no_room"), answer.text
            assert answer.json()["hint"]
            assert "Retry-After" in answer.headers
        for path in ("/healthz", "/v1/jobs", "/v1/scenes", "/v1/regions", "/metrics"):
            answer = self.client.get(path)
            assert answer.status_code == 200, answer.text

    def __enter__(self) -> Service:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Stops the stack, which must end well when nothing else has gone wrong."""
        self.client.close()
        self.stack.process.terminate()
        try:
            assert self.stack.process.wait(60) == 0 or kind is not None
        finally:
            self.stack.close()
            if kind is not None:
                print("\n".join(f"{log.name}: {log.read_text()[-3000:]}" for log in sorted((self.data / "logs").iterdir())))


@pytest.fixture
def small(tmp_path: Path) -> Iterator[disks.Small]:
    with disks.small(tmp_path / "disk", 128) as disk:
        yield disk


def test_a_full_disk_stops_the_work_until_there_is_room(small: disks.Small) -> None:
    with Service(small.directory) as service:
        undisturbed = service.ended(service.submit())
        job_id = service.under_way()
        before = service.stack.description["pids"]
        small.fill()
        assert small.free_bytes == 0
        eventually(lambda: "free some room" in service.disk(), "/readyz says so", 10)
        time.sleep(2 * LOOK_SECONDS)  # each process of the API looks for itself
        os.kill(before["api-2"], signal.SIGKILL)
        os.kill(before["queue"], signal.SIGKILL)
        eventually(lambda: _started(before["api-2"]) is None, "a process of the API dies")
        time.sleep(1)  # its last threads hold its socket for a moment
        until = time.monotonic() + 20
        while time.monotonic() < until:
            service.refuses()
            service.job(job_id)
            assert service.stack.process.poll() is None
            time.sleep(0.5)
        assert not service.job(job_id)["ended"]
        small.clear()
        eventually(lambda: service.client.get("/readyz").status_code == 200, "there is room again", 60)
        assert service.ended(job_id) == undisturbed
        after = service.stack.description["pids"]
        assert {name: after[name] for name in ("control", "solve", "api")} == {name: before[name] for name in ("control", "solve", "api")}
        assert after["api-2"] != before["api-2"]


def test_a_stack_is_not_started_on_a_full_disk(small: disks.Small) -> None:
    small.fill()
    failed = subprocess.run([*COMMAND, "--data", str(small.directory / "data")], cwd=ROOT, capture_output=True, text=True, check=False)
    assert failed.returncode == 2
    assert failed.stderr.splitlines()[-1].startswith("error: --data: the database in"), failed.stderr


def test_a_disk_that_becomes_read_only_keeps_what_was_stored(tmp_path: Path) -> None:
    image = disks.Image(tmp_path / "image", tmp_path / "disk")
    with image.mounted(), Service(image.directory) as service:
        undisturbed = service.ended(service.submit())
        job_id = service.under_way()
        disks.run("sync", "--file-system", str(image.directory))  # what is not written yet is lost with a disk, as in a power cut
        image.break_it()
        eventually(lambda: "cannot be written" in service.disk(), "/readyz says so", 10)
        time.sleep(2 * LOOK_SECONDS)  # each process of the API looks for itself
        until = time.monotonic() + 10
        while time.monotonic() < until:
            service.refuses()
            service.job(job_id)
            assert service.stack.process.poll() is None
            time.sleep(0.5)
    # The kernel lets nobody write to a broken disk before it is unmounted and checked.
    with image.mounted(), Service(image.directory) as again:
        assert again.ended(job_id) == undisturbed


def test_a_slow_disk_delays_the_work_and_not_who_reads(tmp_path: Path) -> None:
    image = disks.Image(tmp_path / "image", tmp_path / "disk")
    with image.mounted(), Service(image.directory) as service:
        began = time.monotonic()
        undisturbed = service.ended(service.submit())
        usual, seconds = time.monotonic() - began, []
        with image.slow(BYTES_A_SECOND):
            began = time.monotonic()
            job_ids = [service.submit() for _ in range(JOBS)]
            while not all(service.job(job_id)["ended"] for job_id in job_ids):
                asked = time.monotonic()
                assert service.client.get("/v1/scenes").status_code == 200
                seconds.append(time.monotonic() - asked)
                time.sleep(0.05)
            slow = time.monotonic() - began
        assert all(service.ended(job_id) == undisturbed for job_id in job_ids)
    p50, slowest = median(seconds), max(seconds)
    print(f"a job {usual:.1f} s; {JOBS} on a slow disk {slow:.1f} s; reading p50 {p50:.3f} s, slowest {slowest:.3f} s")
    assert slowest < 5
