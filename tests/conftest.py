"""What every test runs under: one numerical thread a process, Ctrl-C that works, Hypothesis examples that may take their time."""

import os
import re
import signal
from pathlib import Path

signal.signal(signal.SIGINT, signal.default_int_handler)  # a suite started in the background inherits that it is ignored

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402
from xdist.remote import Producer  # noqa: E402
from xdist.scheduler import LoadFileScheduling  # noqa: E402

settings.register_profile("ciris", deadline=None, derandomize=bool(os.environ.get("CI")))
settings.load_profile("ciris")

pytest_plugins = ["tests.services", "tests.skips"]


def pytest_xdist_auto_num_workers() -> int:
    """Many tests wait for processes, so there is one more of pytest than there are cores."""
    return len(os.sched_getaffinity(0)) + 1


SHARING = re.compile(r"tests/workers/test_(service|faults|motions|presence|covers|recertify)\.py::")
"""Tests whose fixture ``service`` starts workers, on either database, and shares them."""


class Together(LoadFileScheduling):
    """Gives each process whole files, and all that shares one service to one process, so that few services are started."""

    def _split_scope(self, nodeid: str) -> str:
        return "tests/workers" if SHARING.match(nodeid) else super()._split_scope(nodeid)


@pytest.hookimpl(tryfirst=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling | None:
    return Together(config, log) if config.getvalue("dist") == "loadfile" else None


ROOMS = Path(__file__).parent
WAITING = ("workers", "docs", "client", "benchmarks")
"""Rooms whose tests wait for processes, those first whose files take longest: what begins last must not take long."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Prepares what was collected, before anything is left out by its marker."""
    repeat_lengthy_ones_in_the_slow_suite(items)
    mix_waiting_and_computing(items)


def repeat_lengthy_ones_in_the_slow_suite(items: list[pytest.Item]) -> None:
    """What is marked ``lengthy`` is repeated on PostgreSQL by the slow suite only."""
    for item in items:
        if item.get_closest_marker("lengthy") and "postgresql" in item.nodeid:
            item.add_marker(pytest.mark.slow)


def mix_waiting_and_computing(items: list[pytest.Item]) -> None:
    """Spreads the files that wait among those that compute, so that a run in parallel does some of both at any time."""
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    rooms = {file: file.relative_to(ROOMS).parts[0] for file in files}
    waiting = sorted((file for file in files if rooms[file] in WAITING), key=lambda file: WAITING.index(rooms[file]))
    kinds = (waiting, [file for file in files if rooms[file] not in WAITING])
    place = {file: (i + 0.5) / len(kind) for kind in kinds for i, file in enumerate(kind)}
    items[:] = [item for file in sorted(files, key=place.__getitem__) for item in files[file]]
