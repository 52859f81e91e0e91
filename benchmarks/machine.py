"""Where and with what a measurement was made."""

from __future__ import annotations

import os
import platform
import re
from importlib.metadata import version
from pathlib import Path
from typing import Any

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
"""What has to stand in the environment before numpy is loaded for everything to run on one thread."""
PACKAGES = ("drake", "numpy", "scipy", "numba", "python-flint")


def describe() -> dict[str, Any]:
    """The machine and the versions, JSON-able."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {package: version(package) for package in PACKAGES},
        "threads": 1 if all(os.environ.get(name) == value for name, value in ONE_THREAD.items()) else None,
    }


def sentence(machine: dict[str, Any]) -> str:
    """The machine in a line for people."""
    versions = ", ".join(f"{package} {number}" for package, number in machine["versions"].items())
    threads = "one thread" if machine["threads"] == 1 else "threads not limited"
    cores = f"{machine['cores']} cores, {machine['memory_gib']} GiB"
    return f"{machine['processor']}, {cores}; {machine['system']}, Python {machine['python']}; {versions}; {threads}"


def _processor() -> str:
    path = Path("/proc/cpuinfo")
    found = re.search(r"^model name\s*:\s*(.+)$", path.read_text(), re.MULTILINE) if path.exists() else None
    return found[1] if found else platform.processor()
