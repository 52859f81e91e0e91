"""What every test runs under: one numerical thread a process, Ctrl-C that works, Hypothesis examples that may take their time."""

import os
import signal
from pathlib import Path

signal.signal(signal.SIGINT, signal.default_int_handler)  # a suite started in the background inherits that it is ignored

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

settings.register_profile("ciris", deadline=None, derandomize=bool(os.environ.get("CI")))
settings.load_profile("ciris")

pytest_plugins = ["tests.services", "tests.skips"]


def pytest_xdist_auto_num_workers() -> int:
    """Many tests wait for processes, so there is one more of pytest than there are cores."""
    return len(os.sched_getaffinity(0)) + 1


ROOMS = Path(__file__).parent
FIRST = ("workers", "client", "docs", "benchmarks")
"""Rooms whose tests wait for processes. Their files come first, so that short ones fill the end of a run in parallel."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def turn(item: pytest.Item) -> int:
        room = item.path.relative_to(ROOMS).parts[0]
        return FIRST.index(room) if room in FIRST else len(FIRST)

    items.sort(key=turn)
