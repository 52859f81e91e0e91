"""This module measures what the service costs beside ``--local``, on each database.

It runs ``ciris grow`` and ``ciris grow --local`` on the same example in turn, and takes their time by the clock and in processor time. The
server of PostgreSQL is none of the service's processes, so its processor time is not counted.
"""

from __future__ import annotations

import json
import os
import signal
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import catalogue, measure
from benchmarks.commands import CIRIS
from benchmarks.measure import Progress
from certifier.errors import CirisError

SQLITE, POSTGRESQL, LOCAL = "SQLite", "PostgreSQL", "--local"
"""The ways: the service with either database, and no service."""


@dataclass(frozen=True)
class Service:
    """A service that runs: its process, and its address."""

    pid: int
    url: str


def beside_local(names: list[str], postgresql: str | None, processes: int, turns: int, progress: Progress) -> dict[str, Any]:
    """Grows a region of every example in all ways, ``turns`` times, and returns the document of ``ciris bench service``.

    The way that comes first changes with every turn. All ways do the same computations for seeding and pairs. On a machine that others
    share, the time of these varies by more than all the rest takes.

    Args:
        postgresql: the URL of an empty database; None to measure SQLite alone.

    Raises:
        CirisError: the service does not start, a command fails, or two ways give different regions.
    """
    rows: list[dict[str, Any]] = []
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        services = {SQLITE: stack.enter_context(running(directory / "data", processes))}
        if postgresql is not None:
            services[POSTGRESQL] = stack.enter_context(running(directory / "other", processes, postgresql))
        ways = [*services, LOCAL]
        for name in names:
            volumes = set()
            for turn in range(turns):
                first = turn % len(ways)
                for way in ways[first:] + ways[:first]:
                    row = {"scene": name, "turn": turn, "way": way, **_grown(name, services.get(way), directory, processes)}
                    progress(_line(row))
                    rows.append(row)
                    volumes.add(row["ellipsoid"])
                    if len(volumes) > 1:
                        raise CirisError("regions_differ", f"the runs gave different regions of {name}")
    more = [row for name in names for row in _more(name, [row for row in rows if row["scene"] == name])]
    return {"benchmark": "service", "machine": measure.machine(), "processes": processes, "rows": rows, "more": more}


def _more(name: str, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Returns, for either database, how much more the service takes than ``--local``, by the medians; also for one cell of the proof."""
    found: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        found.setdefault(row["way"], []).append(row)
    local, cells = found.pop(LOCAL), rows[0]["cells"]
    more = []
    for way, served in found.items():
        seconds, processor = (_median(served, what) - _median(local, what) for what in ("seconds", "processor_seconds"))
        per_cell = 1e3 * processor / cells
        more.append({"scene": name, "way": way, "cells": cells, "seconds": seconds, "processor_seconds": processor, "cell_ms": per_cell})
    return more


def _median(rows: list[dict[str, Any]], what: str) -> float:
    return statistics.median(row[what] for row in rows)


def _grown(name: str, service: Service | None, directory: Path, processes: int) -> dict[str, Any]:
    """Runs one command, ``--local`` without a service. Returns its seconds, and the processor time of the command and the service."""
    proof = directory / "proof"
    proof.unlink(missing_ok=True)
    command = [*CIRIS, "grow", str(catalogue.ROOT / "examples" / name / "scene.yaml"), "--json", "--out", str(proof)]
    command += [LOCAL] if service is None else ["--url", service.url]
    before, start, busy = _stolen(), time.perf_counter(), 0.0 if service is None else _processor_seconds(service.pid)
    # ``--local`` uses all cores it may, so it may use as many as the service.
    allowed = set(sorted(os.sched_getaffinity(0))[:processes])
    fewer = partial(os.sched_setaffinity, 0, allowed) if service is None else None
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=fewer) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        output, said = process.stdout.read(), process.stderr.read()  # what the command says on standard error fits into a pipe
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise CirisError("command_failed", f"{' '.join(command)} ended with {process.returncode}: {said.strip()[-300:]}")
    seconds, document = time.perf_counter() - start, json.loads(output)
    served = 0.0 if service is None else _processor_seconds(service.pid) - busy
    return {
        "seconds": seconds,
        "seeding_seconds": document["provenance"]["seeding_seconds"],
        "processor_seconds": usage.ru_utime + usage.ru_stime + served,
        "stolen_seconds": _stolen() - before,
        "cells": measure.cells(proof.read_bytes()),
        "ellipsoid": document["volume"]["ellipsoid"],
    }


@contextmanager
def running(data: Path, processes: int, postgresql: str | None = None) -> Iterator[Service]:
    """Runs a separate service while the block runs, with its data in a directory of its own, or in this PostgreSQL database."""
    own = {"CIRIS_SOLVE_PROCESSES": str(processes)} | ({} if postgresql is None else {"CIRIS_DATABASE_URL": postgresql})
    environment = {name: value for name, value in os.environ.items() if not name.startswith("CIRIS_")} | own
    command = [*CIRIS, "up", "--data", str(data), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        try:
            said = process.stdout.readline()
            if "http" not in said:
                raise CirisError("service_failed", "the service did not start", hint="try `ciris up`")
            yield Service(process.pid, said.split()[-1])
        finally:
            process.send_signal(signal.SIGINT)


def _processor_seconds(root: int) -> float:
    """Returns the processor seconds so far of a process, its descendants, and those of them that have been waited for (Linux)."""
    fields = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields[int(stat.parent.name)] = stat.read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
    family, grew = {root}, True
    while grew:
        found = {pid for pid, values in fields.items() if int(values[1]) in family} - family
        family, grew = family | found, bool(found)
    ticks = sum(int(value) for pid in family & fields.keys() for value in fields[pid][11:15])
    return ticks / os.sysconf("SC_CLK_TCK")


def _stolen() -> float:
    """Returns the seconds, since the machine started, that the host gave this machine's cores to others."""
    return int(Path("/proc/stat").read_text().split(maxsplit=9)[8]) / os.sysconf("SC_CLK_TCK")


def _line(row: dict[str, Any]) -> str:
    took = f"{row['seconds']:.1f} s, {row['processor_seconds']:.1f} s of processor time, {row['stolen_seconds']:.1f} s stolen"
    return f"{row['scene']}, {row['turn']} {row['way']}: {took}; {row['cells']} cells"
