"""The embedded stack: one command starts all of it, mends it, and leaves nothing behind."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from certifier.errors import CirisError
from db.leases import _started
from db.settings import Settings
from tests.workers.service import ROOT, eventually
from workers.processes import die_with_parent
from workers.stack import Child, _reserved_port

COMMAND = [sys.executable, "-m", "workers.stack"]


class Stack:
    """A running stack and what its stack.json says."""

    def __init__(self, data: Path, **own: str) -> None:
        self.data = data
        environment = {name: value for name, value in os.environ.items() if not name.startswith("CIRIS_")} | {
            "CIRIS_API_PROCESSES": "2",
            **own,
        }
        self.process = subprocess.Popen([*COMMAND, "--data", str(data)], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == f"ciris is up at {self.description['url']}\n"

    @property
    def description(self) -> dict[str, Any]:
        return dict(json.loads((self.data / "stack.json").read_text()))

    def ready(self) -> bool:
        try:
            with urllib.request.urlopen(f"{self.description['url']}/readyz", timeout=5) as answer:
                return bool(json.load(answer)["ready"])
        except OSError:
            return False

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[Stack]:
    running = Stack(tmp_path / "data")
    try:
        yield running
    finally:
        running.close()


def gone(pids: dict[str, int]) -> bool:
    return all(_started(pid) is None for pid in pids.values())


def test_what_dies_is_started_again_and_a_stop_leaves_nothing(stack: Stack) -> None:
    second = subprocess.run([*COMMAND, "--data", str(stack.data)], cwd=ROOT, capture_output=True, text=True, check=False)
    assert second.returncode == 2
    assert second.stderr.splitlines()[-1].startswith("error: --data: a stack with the data directory")

    before = stack.description["pids"]
    assert set(before) == {"queue", "control", "solve", "api", "api-2"}
    os.kill(before["queue"], signal.SIGKILL)
    os.kill(before["api"], signal.SIGKILL)
    eventually(lambda: not set(stack.description["pids"].values()) & {before["queue"], before["api"]}, "both are started again")
    eventually(stack.ready, "the API reaches the queue again")

    after = stack.description["pids"]
    stack.process.send_signal(signal.SIGTERM)
    assert stack.process.wait(30) == 0
    assert gone(after)
    assert not (stack.data / "stack.json").exists()


def test_a_worker_that_was_drained_is_not_started_again(stack: Stack) -> None:
    def ask(path: str, method: str = "GET") -> Any:
        with urllib.request.urlopen(urllib.request.Request(f"{stack.description['url']}{path}", method=method), timeout=20) as answer:
            return json.load(answer)

    def solver() -> str | None:
        return next((worker["id"] for worker in ask("/v1/workers")["workers"] if worker["kind"] == "solve"), None)

    before = stack.description["pids"]
    ask(f"/v1/workers/{eventually(solver, 'the worker says that it lives')}/drain", "POST")
    eventually(lambda: gone({"solve": before["solve"]}), "it ends")
    time.sleep(3)
    assert stack.description["pids"] == before
    assert solver() is None
    assert not gone({"control": before["control"]})


def test_an_address_of_ipv6_is_served(tmp_path: Path) -> None:
    stack = Stack(tmp_path / "data", CIRIS_HOST="::1")
    try:
        assert stack.description["url"].startswith("http://[::1]:")
        eventually(stack.ready, "the service is ready")
    finally:
        stack.close()


def test_the_processes_of_the_api_share_the_port_and_count_together(stack: Stack) -> None:
    def ask(path: str) -> str:
        with urllib.request.urlopen(f"{stack.description['url']}{path}", timeout=10) as answer:
            return str(answer.read().decode())

    def answered(name: str) -> float:
        file = stack.data / "requests" / name
        return sum(memoryview(file.read_bytes()).cast("d")[::2]) if file.exists() else 0.0

    def told() -> float:
        return sum(float(line.split()[1]) for line in ask("/metrics").splitlines() if line.startswith("ciris_http_requests_total{"))

    eventually(lambda: ask("/healthz") and answered("api") and answered("api-2"), "both have answered")
    eventually(lambda: answered("api") + answered("api-2") - told() in (0, -1), "one tells of both")


def test_nothing_outlives_a_supervisor_that_is_killed(stack: Stack) -> None:
    pids = stack.description["pids"]
    stack.process.kill()
    eventually(lambda: gone(pids), "every child ends")


def test_a_child_ends_by_its_signal_though_the_supervisor_ignores_it() -> None:
    def prepare() -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        die_with_parent(signal.SIGINT)

    with subprocess.Popen(["sleep", "60"], preexec_fn=prepare) as child:
        child.send_signal(signal.SIGINT)
        assert child.wait(timeout=20) == -signal.SIGINT


def test_a_port_that_was_asked_for_and_is_taken_is_told(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        failed = subprocess.run([*COMMAND, "--data", str(tmp_path), "--port", port], cwd=ROOT, capture_output=True, text=True, check=False)
    assert failed.returncode == 2
    assert failed.stderr.startswith(f"error: --port: port {port} of 127.0.0.1 cannot be bound")


@pytest.mark.parametrize(
    ("host", "port", "problem"),
    [
        ("127.0.0.1", 65536, "port 65536 of 127.0.0.1 cannot be bound"),
        ("127.0.0.1", -1, "port -1 of 127.0.0.1 cannot be bound"),
        ("192.0.2.1", None, "no port of 192.0.2.1 can be bound"),
    ],
)
def test_a_port_or_address_that_there_is_not_is_told(tmp_path: Path, host: str, port: int | None, problem: str) -> None:
    with pytest.raises(CirisError, match=problem), _reserved_port(Settings(data_dir=tmp_path, host=host), port):
        pass


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_the_port_stays_ours_while_nobody_listens(tmp_path: Path, host: str) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with _reserved_port(Settings(data_dir=tmp_path, host=host), 0) as port:
        with socket.socket(family) as other:
            other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            with pytest.raises(OSError, match="in use"):
                other.bind((host, port))
        with socket.create_server((host, port), family=family, reuse_port=True):
            socket.create_connection((host, port), timeout=5).close()
    with socket.socket(family) as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind((host, port))


def test_a_child_that_keeps_dying_is_waited_for_longer_each_time(tmp_path: Path) -> None:
    child = Child("dies", [sys.executable, "-c", ""], signal.SIGTERM)
    waits = []
    for _ in range(3):
        child.start(dict(os.environ), tmp_path)
        assert child.process is not None
        child.process.wait()
        assert child.dead
        child.wait_longer()
        waits.append(child.backoff)
    assert waits == [1.0, 2.0, 4.0]
