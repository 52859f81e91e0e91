"""The killable child: results, errors, deaths, limits."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from certifier.child import run_in_child
from certifier.errors import CirisError, RegionError

GIB = 2**30

FUNCTIONS = """
import ctypes, os, signal, sys, time
import numpy as np
from certifier.errors import RegionError

def twice(payload):
    print("noise on standard output")
    return {"x": 2 * payload["x"], "n": np.int64(3), "empty": np.zeros((0, 4))}

def refuse(payload):
    raise RegionError("seed_wrong_length", "has 3 numbers", field="seed.q", hint="give 7")

def abort(payload):
    print("about to abort", file=sys.stderr, flush=True)
    os.abort()

def hog(payload):
    return np.ones(payload["count"]).sum()

def sleep(payload):
    with open(payload["file"], "w") as f:
        f.write(str(os.getpid()))
    time.sleep(60)

def broken(payload):
    raise ValueError("a bug")
"""


@pytest.fixture
def call(tmp_path, monkeypatch):
    (tmp_path / "child_functions.py").write_text(FUNCTIONS)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    def call(name, payload=None, timeout_s=30.0, memory_bytes=2 * GIB):
        return run_in_child(f"child_functions:{name}", payload, timeout_s=timeout_s, memory_bytes=memory_bytes)

    return call


def test_arrays_travel_unchanged_and_prints_do_no_harm(call):
    x = np.random.default_rng(0).standard_normal((3, 2))
    x[0, 0], x[1, 1] = np.inf, 5e-324
    result = call("twice", {"x": x})
    np.testing.assert_array_equal(result["x"], 2 * x)
    assert result["n"] == 3
    assert result["empty"].shape == (0, 4)


def test_a_users_error_travels_with_its_class_and_parts(call):
    with pytest.raises(RegionError) as caught:
        call("refuse")
    assert caught.value.to_document() == {
        "code": "seed_wrong_length",
        "message": "has 3 numbers",
        "field": "seed.q",
        "hint": "give 7",
    }


@pytest.mark.parametrize(
    ("name", "code", "words"), [("abort", "child_died", ["SIGABRT", "about to abort"]), ("broken", "child_died", ["ValueError: a bug"])]
)
def test_a_death_is_an_error_with_the_last_words(call, name, code, words):
    with pytest.raises(CirisError) as caught:
        call(name)
    assert caught.value.code == code
    for word in words:
        assert word in caught.value.message
    assert "\n" not in str(caught.value)


def test_memory_is_limited(call):
    with pytest.raises(CirisError, match="memory") as caught:
        call("hog", {"count": 2**28}, memory_bytes=GIB)
    assert caught.value.code == "child_memory"


def test_time_is_limited(call, tmp_path):
    started = time.monotonic()
    with pytest.raises(CirisError) as caught:
        call("sleep", {"file": str(tmp_path / "pid")}, timeout_s=1.5)
    assert caught.value.code == "child_timeout"
    assert time.monotonic() - started < 10
    assert not alive(int((tmp_path / "pid").read_text()))


@pytest.mark.skipif(sys.platform != "linux", reason="the parent-death signal is Linux's")
def test_the_child_dies_with_its_parent(call, tmp_path):
    pid_file = tmp_path / "pid"
    script = f"""
from certifier.child import run_in_child
run_in_child("child_functions:sleep", {{"file": {str(pid_file)!r}}}, timeout_s=60, memory_bytes=2 << 30)
"""
    root = str(Path(__file__).parents[2])
    parent = subprocess.Popen([sys.executable, "-c", script], env={**os.environ, "PYTHONPATH": os.pathsep.join([root, str(tmp_path)])})
    try:
        wait_for(lambda: pid_file.exists() and pid_file.read_text())
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    child = int(pid_file.read_text())
    wait_for(lambda: not alive(child))


def alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def wait_for(condition, seconds=20):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "timed out"
        time.sleep(0.02)
