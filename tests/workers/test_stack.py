"""The embedded stack: one command starts all of it, mends it, and leaves nothing behind."""

from __future__ import annotations

import json
import os
import signal
import socket
import stat
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml

from api.metrics import METHODS, STATUSES
from certifier.errors import CirisError
from certifier.orphans import die_with_parent
from certifier.scene import pack_bundle
from db.activity import COMPILING
from db.leases import _started
from db.settings import Settings
from tests.workers.service import ROOT, eventually
from workers.stack import COMPILES, Child, _data_directory, _reserved_port

COMMAND = [sys.executable, "-m", "workers.stack"]
ASK_AGAIN_SECONDS = 0.2
"""Each question makes a process of the API work."""


def start(data: Path, stream: str, **own: str) -> subprocess.Popen[str]:
    """Starts a stack without the settings of a service that runs beside, as the session's own may."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("CIRIS_")}
    own = {"CIRIS_API_PROCESSES": "2", "CIRIS_SOLVE_PROCESSES": "1", **own}  # each solve process loads Drake
    return subprocess.Popen([*COMMAND, "--data", str(data)], cwd=ROOT, env=clean | own, text=True, **{stream: subprocess.PIPE})


class Stack:
    """A running stack and what its stack.json says."""

    def __init__(self, data: Path, **own: str) -> None:
        self.data = data
        self.process = start(data, "stdout", **own)
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


def test_what_dies_is_started_again_what_is_drained_is_not_and_a_stop_leaves_nothing(stack: Stack) -> None:
    second = subprocess.run([*COMMAND, "--data", str(stack.data)], cwd=ROOT, capture_output=True, text=True, check=False)
    assert second.returncode == 2
    assert second.stderr.splitlines()[-1].startswith("error: --data: a stack with the data directory")

    def ask(path: str, method: str = "GET") -> Any:
        with urllib.request.urlopen(urllib.request.Request(f"{stack.description['url']}{path}", method=method), timeout=20) as answer:
            return json.load(answer)

    def solver() -> str | None:
        return next((worker["id"] for worker in ask("/v1/workers")["workers"] if worker["kind"] == "solve"), None)

    assert solver() is not None, "a stack that says it is up takes work"
    before = stack.description["pids"]
    assert set(before) == {"queue", "control", "solve", "api", "api-2"}
    os.kill(before["queue"], signal.SIGKILL)
    os.kill(before["api"], signal.SIGKILL)
    eventually(lambda: not set(stack.description["pids"].values()) & {before["queue"], before["api"]}, "both are started again")
    eventually(stack.ready, "the API reaches the queue again", every=ASK_AGAIN_SECONDS)

    after = stack.description["pids"]
    drained = solver()
    ask(f"/v1/workers/{drained}/drain", "POST")
    eventually(lambda: gone({"solve": after["solve"]}), "it ends")
    time.sleep(3)
    assert stack.description["pids"] == after
    assert solver() is None
    assert not gone({"control": after["control"]})

    stack.process.send_signal(signal.SIGTERM)
    assert stack.process.wait(30) == 0
    assert gone(after)
    assert not (stack.data / "stack.json").exists()


def test_a_first_start_says_that_the_solvers_compile(tmp_path: Path) -> None:
    """Where nothing is compiled yet, the worker says so itself, and the command, the API and jobs pass it on."""
    data = tmp_path / "data"
    with start(data, "stderr", CIRIS_API_PROCESSES="1", NUMBA_CACHE_DIR=str(tmp_path / "compiled")) as stack:
        try:
            assert stack.stderr is not None
            assert next(line for line in stack.stderr if line.startswith("note: ")) == f"note: {COMPILES}\n"
            url = json.loads((data / "stack.json").read_text())["url"]

            def states() -> dict[str, str]:
                return {worker["kind"]: worker["state"] for worker in httpx.get(f"{url}/v1/workers").json()["workers"]}

            eventually(lambda: states() == {"solve": "compiling", "control": "running"}, "the control worker runs, the other one compiles")
            assert httpx.get(f"{url}/v1/workers").json()["missing"] == [COMPILING]
        finally:
            stack.terminate()


@pytest.fixture
def stack_on_ipv6(tmp_path: Path) -> Iterator[Stack]:
    running = Stack(tmp_path / "data", CIRIS_HOST="::1")
    try:
        yield running
    finally:
        running.close()


def test_the_processes_of_the_api_share_a_port_of_ipv6_and_count_together(stack_on_ipv6: Stack) -> None:
    stack = stack_on_ipv6
    assert stack.description["url"].startswith("http://[::1]:")
    eventually(stack.ready, "the service is ready", every=ASK_AGAIN_SECONDS)

    def ask(path: str) -> str:
        with urllib.request.urlopen(f"{stack.description['url']}{path}", timeout=10) as answer:
            return str(answer.read().decode())

    def answered(name: str) -> float:
        file = stack.data / "requests" / name
        counts = 2 * len(METHODS) * len(STATUSES)
        return sum(memoryview(file.read_bytes()).cast("d")[:counts:2]) if file.exists() else 0.0

    def told() -> float:
        return sum(float(line.split()[1]) for line in ask("/metrics").splitlines() if line.startswith("ciris_http_requests_total{"))

    eventually(lambda: ask("/healthz") and answered("api") and answered("api-2"), "both have answered")
    eventually(lambda: answered("api") + answered("api-2") - told() in (0, -1), "one tells of both")


def descendants(pid: int) -> set[int]:
    found: set[int] = set()
    for file in Path("/proc").glob(f"{pid}/task/*/children"):
        with suppress(FileNotFoundError, ProcessLookupError):
            for child in map(int, file.read_text().split()):
                found |= {child} | descendants(child)
    return found


def begin_a_job(stack: Stack) -> None:
    """Has the service seed a region of an arm with IRIS, which takes the pool, a nursery and a child of the nursery."""
    url, example = stack.description["url"], ROOT / "examples" / "iiwa_shelf"
    scene = httpx.post(f"{url}/v1/scenes", files={"bundle": pack_bundle(example / "scene.yaml")}, timeout=120).json()["id"]
    q = yaml.safe_load((example / "seed.yaml").read_text())["q"]
    job = httpx.post(f"{url}/v1/jobs", json={"kind": "grow", "scene": scene, "seed": {"q": q}}, timeout=60)
    assert job.status_code == 201, job.text


@pytest.mark.skipif(sys.platform != "linux", reason="/proc tells who is whose child")
@pytest.mark.parametrize(
    "loading", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["while nurseries load", "while nurseries work"]
)
def test_nothing_outlives_a_supervisor_that_is_killed(stack: Stack, loading: bool) -> None:
    begin_a_job(stack)
    solve = stack.description["pids"]["solve"]
    if loading:
        eventually(lambda: any(map(is_nursery, descendants(solve))), "a nursery loads")
    else:
        eventually(lambda: any(is_nursery(pid) and descendants(pid) for pid in descendants(solve)), "a nursery has a child")
    pids = descendants(stack.process.pid)
    stack.process.kill()
    killed = time.monotonic()
    while left := [pid for pid in pids if _started(pid) is not None]:
        assert time.monotonic() - killed < 5, [Path(f"/proc/{pid}/cmdline").read_bytes() for pid in left]
        time.sleep(0.01)


def is_nursery(pid: int) -> bool:
    with suppress(FileNotFoundError, ProcessLookupError):
        return b"certifier.isolation.nursery" in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False


def test_a_reaper_ends_what_was_named_last() -> None:
    """It does on its own, as on macOS, where the kernel does not help."""
    with ExitStack() as stack:
        first, second = (stack.enter_context(subprocess.Popen(["sleep", "60"], start_new_session=True)) for _ in range(2))
        lines = f"{first.pid}\n{second.pid}\n"
        subprocess.run([sys.executable, "-m", "workers.reaper"], cwd=ROOT, input=lines, text=True, check=True)
        assert second.wait(20) == -signal.SIGKILL
        assert first.poll() is None
        subprocess.run([sys.executable, "-m", "workers.reaper"], cwd=ROOT, input=f"{first.pid}\n\n", text=True, check=True)
        assert first.poll() is None
        first.kill()


def test_a_data_directory_that_others_could_look_into_is_closed(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    old, fresh, foreign = tmp_path / "old", tmp_path / "fresh", tmp_path / "foreign"
    for directory in (old, foreign):
        directory.mkdir(mode=0o755)
    (old / "stack.lock").touch()
    (foreign / "thesis.tex").touch()
    for directory, mode in ((old, 0o700), (fresh, 0o700), (foreign, 0o755)):
        with _data_directory(directory):
            (directory / "made").touch()
        assert stat.S_IMODE(directory.stat().st_mode) == mode
        assert stat.S_IMODE((directory / "made").stat().st_mode) == 0o600
    (tmp_path / "after").touch()
    assert stat.S_IMODE((tmp_path / "after").stat().st_mode) & 0o044
    said = [record.getMessage() for record in caplog.records]
    assert [str(old) in said[0], "its mode is 700 now" in said[0], str(foreign) in said[1], len(said)] == [True, True, True, 2]


def test_a_child_is_started_though_its_log_cannot_be_opened(tmp_path: Path) -> None:
    child = Child("talks", [sys.executable, "-c", ""], signal.SIGTERM)
    child.start(dict(os.environ), tmp_path / "missing")
    assert child.process is not None
    assert child.process.wait(60) == 0


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
