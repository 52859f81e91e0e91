"""The killable child: results, errors, deaths, limits; and the nursery that it comes from."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from certifier.errors import CirisError, RegionError
from certifier.isolation import child
from certifier.isolation.child import prepare, run_in_child

GIB = 2**30

FUNCTIONS = """
import ctypes, os, signal, sys, time
import numpy as np
from certifier.errors import RegionError
from certifier.isolation.telling import tell

def twice(payload):
    print("noise on standard output")
    return {"x": 2 * payload["x"], "n": np.int64(3), "empty": np.zeros((0, 4))}

def refuse(payload):
    raise RegionError("seed_wrong_length", "has 3 numbers", field="seed.q", hint="give 7")

def abort(payload):
    for _ in range(3):
        print("about to abort", file=sys.stderr, flush=True)
    os.abort()

def hog(payload):
    return np.ones(payload["count"]).sum()

def sleep(payload):
    with open(payload["file"], "w") as f:
        f.write(f"{os.getpid()} {os.getppid()}")
    time.sleep(60)

def broken(payload):
    raise ValueError("a bug")

def whoami(payload):
    return {"pid": os.getpid()}

calls = 0

def count(payload):
    global calls
    calls += 1
    return {"calls": calls, "nursery": os.getppid()}

def meet(payload):
    # ends once two of these are here
    with open(os.path.join(payload["directory"], f"here-{os.getpid()}"), "w"):
        pass
    while sum(name.startswith("here-") for name in os.listdir(payload["directory"])) < 2:
        time.sleep(0.01)
    return {"pid": os.getpid()}

def report(payload):
    tell(done=0, of=2)
    tell(done=1)
    time.sleep(payload["seconds"])
    return {"lines": "a\\nb"}

def fill(payload):
    with open(payload["file"], "wb") as file:
        for _ in range(2**10):
            file.write(bytes(2**20))
"""


@pytest.fixture
def call(tmp_path, monkeypatch):
    (tmp_path / "child_functions.py").write_text(FUNCTIONS)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    def call(name, payload=None, timeout_s=30.0, memory_bytes=2 * GIB, fork=True, tell=None):
        return run_in_child(f"child_functions:{name}", payload, timeout_s=timeout_s, memory_bytes=memory_bytes, fork=fork, tell=tell)

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
    wait_for(lambda: not alive(int((tmp_path / "pid").read_text().split()[0])))


@pytest.mark.parametrize("victim", ["caller", "nursery"])
def test_a_call_ends_with_its_caller_and_with_its_nursery(call, tmp_path, victim):
    pids = tmp_path / "pid"
    script = f"""
from certifier.isolation.child import run_in_child
run_in_child("child_functions:sleep", {{"file": {str(pids)!r}}}, timeout_s=60, memory_bytes=2 << 30)
"""
    root = str(Path(__file__).parents[3])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([root, str(tmp_path)])}
    with subprocess.Popen([sys.executable, "-c", script], env=environment, stderr=subprocess.PIPE, text=True) as caller:
        wait_for(lambda: pids.exists() and len(pids.read_text().split()) == 2)
        called, nursery = map(int, pids.read_text().split())
        os.kill(caller.pid if victim == "caller" else nursery, signal.SIGKILL)
        wait_for(lambda: not alive(called) and not alive(nursery))
        said = caller.communicate(timeout=20)[1]
    assert ("the process died (signal SIGKILL)" in said) == (victim == "nursery")


def test_the_module_stays_loaded_for_the_next_call_and_keeps_nothing_of_it(call):
    first, second = call("count"), call("count")
    assert first["nursery"] == second["nursery"]
    assert first["calls"] == second["calls"] == 1


def test_a_call_that_dies_costs_the_next_one_nothing(call):
    nursery = call("count")["nursery"]
    with pytest.raises(CirisError):
        call("abort")
    assert call("count")["nursery"] == nursery


def test_a_nursery_that_died_or_was_killed_with_its_call_is_replaced(call, tmp_path):
    nursery = call("count")["nursery"]
    os.kill(nursery, signal.SIGKILL)
    wait_for(lambda: not alive(nursery))
    other = call("count")["nursery"]
    assert other != nursery
    with pytest.raises(CirisError, match="more than"):
        call("sleep", {"file": str(tmp_path / "pid")}, timeout_s=1.0)
    assert not alive(other)
    assert call("count")["nursery"] != other


def test_a_death_says_nothing_of_calls_before(call):
    with pytest.raises(CirisError, match="about to abort"):
        call("abort")
    with pytest.raises(CirisError, match="a bug") as caught:
        call("broken")
    assert "about to abort" not in caught.value.message


def test_calls_at_once_do_not_wait_for_each_other(call):
    with ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(lambda _: call("meet", {"directory": os.environ["PYTHONPATH"]}), range(2)))
    assert answers[0]["pid"] != answers[1]["pid"]


def test_nobody_waits_for_what_has_answered_already(call):
    """It says once that it has loaded."""
    nursery = call("count", {})["nursery"]
    began = time.monotonic()
    assert prepare("child_functions:count", 60.0) == nursery
    assert time.monotonic() - began < 30.0


def test_what_was_prepared_answers_the_first_call(call):
    prepare("child_functions:count")
    waiting = [nursery.process.pid for nursery in child._idle["child_functions"]]
    prepare("child_functions:count")
    assert call("count")["nursery"] == waiting[-1]
    assert [nursery.process.pid for nursery in child._idle["child_functions"]] == waiting


def test_a_nursery_that_has_computed_much_goes_on_until_another_has_loaded(call, monkeypatch):
    monkeypatch.setattr(child, "MOST", 2)
    monkeypatch.setattr(child, "MORE", 2)
    (own,) = {call("whoami", fork=False)["pid"] for _ in range(4)}
    (following,) = {call("whoami", fork=False)["pid"] for _ in range(2)}
    assert following != own
    assert not alive(own)


def test_a_fork_of_this_process_has_nurseries_of_its_own(call):
    nursery = call("count")["nursery"]
    reading, writing = os.pipe()
    forked = os.fork()
    if forked == 0:
        os.write(writing, str(call("count")["nursery"]).encode())
        os._exit(0)
    os.waitpid(forked, 0)
    assert int(os.read(reading, 100)) != nursery
    assert call("count")["nursery"] == nursery
    os.close(reading)
    os.close(writing)


def test_a_file_cannot_grow_without_limit(call, tmp_path):
    with pytest.raises(CirisError, match="File too large"):
        call("fill", {"file": str(tmp_path / "filled")})
    assert (tmp_path / "filled").stat().st_size <= 2**28


def test_what_is_told_is_heard_while_the_function_runs_and_when_its_time_is_up(call, monkeypatch):
    monkeypatch.setattr(child, "TELL_S", 0.05)
    heard = []
    assert call("report", {"seconds": 2.0}, tell=heard.append) == {"lines": "a\nb"}
    assert len(heard) > 2
    assert heard[-1] == {"done": 1, "of": 2}
    monkeypatch.setattr(child, "TELL_S", 60.0)
    heard.clear()
    with pytest.raises(CirisError) as error:
        call("report", {"seconds": 60}, timeout_s=1.0, tell=heard.append)
    assert (error.value.code, heard) == ("child_timeout", [{"done": 1, "of": 2}])
    assert call("report", {"seconds": 0}) == {"lines": "a\nb"}, "where nobody listens"


def test_an_interrupt_while_it_runs_leaves_nothing_behind(call, tmp_path):
    file = tmp_path / "pids"

    def interrupted(told):
        if file.exists() and file.read_text():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        call("sleep", {"file": str(file)}, tell=interrupted)
    wait_for(lambda: not any(alive(pid) for pid in file.read_text().split()))


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


def test_modules_in_the_working_directory_are_not_run(tmp_path: Path) -> None:
    """A stranger's folder may hold a ``struct.py`` beside the proof or the scene that is to be read."""
    for name in ("struct", "json", "numpy"):
        (tmp_path / f"{name}.py").write_text("open('ran', 'w')\nraise SystemExit\n")
    call = (
        "from certifier.isolation.child import run_in_child; print(run_in_child('json:dumps', {'a': 1}, timeout_s=60, memory_bytes=2**33))"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    done = subprocess.run([sys.executable, "-P", "-c", call], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == '{"a": 1}\n', done.stderr
    assert not (tmp_path / "ran").exists()
