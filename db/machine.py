"""This module says how many cores and how much memory a process may use: those of the machine, or what a control group leaves of them.

Containers and systemd's services are control groups. Linux tells of them in ``/proc/self/cgroup`` and ``/sys/fs/cgroup``, in version 2
or version 1. The limit of every group above a process holds for it, too. In a container, ``/sys/fs/cgroup`` may be its own group.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

GROUPS, OWN = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")


def cores(groups: Path = GROUPS, own: Path = OWN) -> int:
    """Returns how many processes can compute at the same time at full speed, 1 at least.

    A group may have a share of the time that is no whole number of cores. It is rounded down, because processes that get less than a
    core each are paused again and again.
    """
    machine = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    shares = []
    for group in _groups(groups, own, "cpu"):
        quota, period = _numbers(group / "cpu.max") or (_number(group / "cpu.cfs_quota_us"), _number(group / "cpu.cfs_period_us"))
        if quota is not None and period:
            shares.append(quota / period)
    return max(1, int(min([machine, *shares])))


def memory_bytes(groups: Path = GROUPS, own: Path = OWN) -> int:
    """Returns how many bytes of memory all processes here may use together."""
    limits = []
    for group in _groups(groups, own, "memory"):
        limit = _number(group / "memory.max") or _number(group / "memory.limit_in_bytes")
        if limit:
            limits.append(limit)
    return min([os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"), *limits])


def _groups(groups: Path, own: Path, controller: str) -> Iterator[Path]:
    """Yields the directories of this process's group and of all groups above it. Not all of them need to exist."""
    try:
        lines = own.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers and controller not in controllers.split(","):
            continue
        root = groups / controllers  # version 2 has no name there
        yield root
        here = root
        for part in Path(path).parts[1:]:
            here /= part
            yield here


def _numbers(file: Path) -> tuple[int | None, int | None] | None:
    """Returns the two numbers of a file, None for one that means no limit; None for a file that is not there."""
    try:
        first, second = file.read_text().split()
    except (OSError, ValueError):
        return None
    return _parsed(first), _parsed(second)


def _number(file: Path) -> int | None:
    try:
        return _parsed(file.read_text().strip())
    except OSError:
        return None


def _parsed(text: str) -> int | None:
    """Returns a number that limits something; None for ``max`` and for -1, which mean no limit."""
    return int(text) if text.isdecimal() else None
