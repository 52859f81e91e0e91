"""What a process may use of its machine, with control groups of both versions as Linux and Docker lay them out."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from certifier.errors import CirisError
from db import machine
from db.settings import Settings, chosen

GIB = 2**30


@pytest.fixture(autouse=True)
def eight_cores_and_sixteen_gib(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))
    monkeypatch.setattr(os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 16 * GIB // 4096}.__getitem__)


def look(root: Path, own: str, files: dict[str, str]) -> tuple[int, float]:
    """The cores, and the memory in GiB, with these files under /sys/fs/cgroup."""
    groups = root / "cgroup"
    for name, text in files.items():
        file = groups / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text + "\n")
    (root / "own").write_text(own)
    return machine.cores(groups, root / "own"), machine.memory_bytes(groups, root / "own") / GIB


def test_without_groups_it_is_the_machine(tmp_path: Path) -> None:
    assert (machine.cores(tmp_path, tmp_path / "none"), machine.memory_bytes(tmp_path, tmp_path / "none")) == (8, 16 * GIB)
    assert look(tmp_path, "0::/\n", {}) == (8, 16.0)


def test_a_container_of_version_2_is_the_root_of_what_it_sees(tmp_path: Path) -> None:
    assert look(tmp_path, "0::/\n", {"cpu.max": "250000 100000", "memory.max": str(3 * GIB)}) == (2, 3.0)


def test_no_limit_is_the_machine(tmp_path: Path) -> None:
    assert look(tmp_path, "0::/\n", {"cpu.max": "max 100000", "memory.max": "max"}) == (8, 16.0)


def test_less_than_a_core_is_one_process(tmp_path: Path) -> None:
    assert look(tmp_path, "0::/\n", {"cpu.max": "20000 100000"})[0] == 1


def test_limits_above_the_machine_change_nothing(tmp_path: Path) -> None:
    assert look(tmp_path, "0::/\n", {"cpu.max": "6400000 100000", "memory.max": str(2**60)}) == (8, 16.0)


def test_the_groups_above_limit_too(tmp_path: Path) -> None:
    """A service of systemd: its own group has no limit, its slice has one of memory, and the group between them one of time."""
    own = "0::/system.slice/ciris.slice/solve.service\n"
    limits = {"system.slice/memory.max": str(5 * GIB), "system.slice/ciris.slice/cpu.max": "400000 100000"}
    unlimited = {"system.slice/ciris.slice/solve.service/cpu.max": "max 100000"}
    assert look(tmp_path, own, {**limits, **unlimited}) == (4, 5.0)


def test_version_1_as_a_container_sees_it(tmp_path: Path) -> None:
    """/proc names the group as the host does, and the container has its own files at the root of each controller."""
    own = "4:memory:/docker/4f1c\n3:cpu,cpuacct:/docker/4f1c\n2:cpuset:/docker/4f1c\n1:name=systemd:/docker/4f1c\n"
    time = {"cpu,cpuacct/cpu.cfs_quota_us": "300000", "cpu,cpuacct/cpu.cfs_period_us": "100000"}
    assert look(tmp_path, own, {"memory/memory.limit_in_bytes": str(2 * GIB), **time}) == (3, 2.0)


def test_version_1_without_limits(tmp_path: Path) -> None:
    own = "4:memory:/a\n3:cpu,cpuacct:/a\n"
    time = {"cpu,cpuacct/a/cpu.cfs_quota_us": "-1", "cpu,cpuacct/a/cpu.cfs_period_us": "100000"}
    assert look(tmp_path, own, {"memory/a/memory.limit_in_bytes": "9223372036854771712", **time}) == (8, 16.0)


def test_a_pair_may_need_what_every_process_of_a_worker_can_have_at_the_same_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker of two processes has a third one, for new jobs."""
    monkeypatch.setattr(machine, "memory_bytes", lambda: 6 * GIB)
    assert Settings(solve_processes=5).pair_memory_bytes == GIB
    assert Settings(solve_processes=2).pair_memory_bytes == 2 * GIB
    monkeypatch.setenv("CIRIS_SOLVE_PROCESSES", "nothing")
    with pytest.raises(CirisError, match="valid integer") as refused:
        chosen()
    assert refused.value.field == "CIRIS_SOLVE_PROCESSES"
