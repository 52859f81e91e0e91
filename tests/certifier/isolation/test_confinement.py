"""What a child may reach that reads a stranger's files: it is taken over here, and tries everything."""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import Any

import pytest

from certifier.isolation.child import run_in_child
from certifier.isolation.confinement import NICENESS, Confinement, Layers, probed

SECRET = "postgresql://ciris:a-secret@database/ciris"
TAKEN_OVER = """
import ctypes, os, resource, signal, socket, subprocess

def tried(attempt):
    try:
        return attempt()
    except Exception as error:
        return f"refused: {type(error).__name__}"

def fork():
    child = os.fork()
    if child == 0:
        os._exit(0)
    os.waitpid(child, 0)
    return "forked"

def descriptors():
    found = b""
    for number in range(256):
        try:
            found += os.pread(number, 1000, 0)
        except OSError:
            pass
    return found.decode(errors="replace")

def connect(family, where):
    with socket.socket(family) as own:
        own.connect(where)
    return "connected"

def write(path):
    with open(path, "w") as file:
        file.write("x")
    return "written"

def read(path):
    with open(path) as file:
        return file.read()

def attack(payload):
    others = payload["caller"], os.getppid()
    return {
        "variables": str(dict(os.environ)),
        "descriptors": descriptors(),
        "variables of others": [tried(lambda: read(f"/proc/{pid}/environ")) for pid in others],
        "memory of others": [tried(lambda: write(f"/proc/{pid}/mem")) for pid in others],
        "tcp": tried(lambda: connect(socket.AF_INET, ("127.0.0.1", payload["port"]))),
        "unix": tried(lambda: connect(socket.AF_UNIX, payload["socket"])),
        "udp": tried(lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM).close()),
        "passwords": tried(lambda: read("/etc/passwd")),
        "home": tried(lambda: os.listdir(os.path.expanduser("~"))),
        "file of another": tried(lambda: read(payload["other"])),
        "write outside": tried(lambda: write(payload["outside"])),
        "write in its directory": tried(lambda: write(payload["inside"])),
        "fork": [tried(fork) for _ in range(100)],
        "program": tried(lambda: subprocess.run(["/bin/true"]).returncode),
        "signal": [tried(lambda: os.kill(pid, 0)) for pid in others],
        "limits of others": [tried(lambda: resource.prlimit(pid, resource.RLIMIT_CORE)) for pid in others],
        "trace": ctypes.CDLL(None).ptrace(16, others[0], 0, 0),
        "niceness": os.nice(0),
        "limits": {name: resource.getrlimit(getattr(resource, "RLIMIT_" + name))[0] for name in ("AS", "CPU", "FSIZE", "NOFILE", "CORE")},
    }
"""


@pytest.fixture
def tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Returns what a child finds that reads strange files, or that reads those of its user."""
    code, own, others = (tmp_path / name for name in ("code", "own", "others"))
    for directory in (code, own, others):
        directory.mkdir()
    (code / "taken_over.py").write_text(TAKEN_OVER)
    (others / "secret").write_text(SECRET)
    monkeypatch.setenv("PYTHONPATH", str(code))
    monkeypatch.setenv("CIRIS_DATABASE_URL", SECRET)
    monkeypatch.setenv("POSTGRES_PASSWORD", "a-secret")
    where = own / "socket"

    def call(strange: bool) -> dict[str, Any]:
        with socket.create_server(("127.0.0.1", 0)) as tcp, socket.socket(socket.AF_UNIX) as unix, open(others / "secret") as opened:
            unix.bind(str(where))
            unix.listen()
            os.set_inheritable(opened.fileno(), True)
            payload = {"caller": os.getpid(), "port": tcp.getsockname()[1], "socket": str(where)}
            payload |= {"other": str(others / "secret"), "outside": str(others / "new"), "inside": str(own / "new")}
            confinement = Confinement(str(own), strange)
            found: dict[str, Any] = run_in_child("taken_over:attack", payload, timeout_s=30, memory_bytes=2**31, confinement=confinement)
            return found

    return call


def test_who_reads_strange_files_finds_no_secret_and_reaches_nobody(tried: Any) -> None:
    found, on = tried(strange=True), probed()
    assert "a-secret" not in str({name: found[name] for name in ("variables", "descriptors")})
    assert found["write in its directory"] == "written"
    assert found["limits"] == {"AS": 2**31, "CPU": 31, "FSIZE": 2**28, "NOFILE": 256, "CORE": 0}
    assert found["niceness"] == min(19, os.nice(0) + NICENESS)
    if on.landlock:
        for name in ("passwords", "home", "file of another", "write outside"):
            assert found[name] == "refused: PermissionError", name
    if on.landlock or on.namespaces:
        for name in ("variables of others", "memory of others"):
            assert set(found[name]) == {"refused: PermissionError"}, name
    if on.seccomp:
        for name in ("tcp", "unix", "udp", "program"):
            assert found[name] == "refused: PermissionError", name
        for name in ("fork", "signal", "limits of others"):
            assert set(found[name]) == {"refused: PermissionError"}, name
        assert found["trace"] == -1
    if on.namespaces and not on.seccomp:
        assert found["tcp"].startswith("refused"), "its network has nothing in it"


def test_who_reads_files_of_its_user_reads_all_of_them_and_finds_no_secret_either(tried: Any) -> None:
    found, on = tried(strange=False), probed()
    assert "a-secret" not in str({name: found[name] for name in ("variables", "descriptors")})
    assert found["file of another"] == SECRET, "models may be anywhere"
    assert found["write in its directory"] == "written"
    if on.seccomp:
        assert {found["tcp"], found["unix"], found["udp"]} == {"refused: PermissionError"}
    if on.landlock:
        assert found["write outside"] == "refused: PermissionError"
        assert set(found["variables of others"]) == {"refused: PermissionError"}


def test_this_machine_has_a_layer_of_each_kind_or_says_that_it_has_not() -> None:
    assert str(Layers(namespaces=False, landlock=0, seccomp=True)) == "no namespaces, no Landlock, seccomp"
    assert str(Layers(namespaces=True, landlock=4, seccomp=False)) == "namespaces, Landlock 4, no seccomp"
    assert isinstance(probed(), Layers)
