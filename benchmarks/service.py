"""This module measures what the service costs beside ``--local``.

It runs ``ciris grow`` and ``ciris grow --local`` on the same example in turn, and takes their time by the clock and in processor time.
"""

from __future__ import annotations

import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from certifier.errors import CirisError

CIRIS = [sys.executable, "-P", "-m", "client.cli"]
SERVICE, LOCAL = "service", "--local"


@dataclass(frozen=True)
class Service:
    """A service that runs: its process, and its address."""

    pid: int
    url: str


def beside_local(name: str, processes: int, turns: int, progress: Progress) -> dict[str, Any]:
    """Grows the example's region in both ways, ``turns`` times, and returns the document of ``ciris bench service``.

    The way that comes first changes with every turn. Both ways do the same computations for seeding and pairs. On a machine that others
    share, the time of these varies by more than all the rest takes.

    Raises:
        CirisError: the service does not start, a command fails, or the two come to different regions.
    """
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as directory, running(Path(directory) / "data", processes) as service:
        for turn in range(turns):
            for way in (SERVICE, LOCAL) if turn % 2 == 0 else (LOCAL, SERVICE):
                rows.append({"turn": turn, "way": way, **_grown(name, way, service, Path(directory), processes)})
                if rows[-1]["ellipsoid"] != rows[0]["ellipsoid"]:
                    raise CirisError("regions_differ", f"the runs came to different regions of {name}")
                progress(_line(rows[-1]))
    return {
        "benchmark": "service",
        "machine": measure.machine(),
        "scene": name,
        "processes": processes,
        "rows": rows,
        "more": {what: _more(rows, what) for what in ("seconds", "besides_seconds", "processor_seconds")},
    }


def _more(rows: list[dict[str, Any]], what: str) -> dict[str, Any]:
    """Returns the medians, and how much more the service takes in every turn, as a share of that turn's ``--local`` command's seconds."""
    by_way = {way: [row for row in sorted(rows, key=lambda row: row["turn"]) if row["way"] == way] for way in (SERVICE, LOCAL)}
    shares = [(mine[what] - other[what]) / other["seconds"] for mine, other in zip(by_way[SERVICE], by_way[LOCAL], strict=True)]
    medians = {way: statistics.median(row[what] for row in found) for way, found in by_way.items()}
    return {"medians": medians, "share": statistics.median(shares), "each": shares}


def _grown(name: str, way: str, service: Service, directory: Path, processes: int) -> dict[str, Any]:
    """Runs one command. Returns its seconds, those besides seeding and pairs, and the processor time of the command and the service."""
    proof = directory / "proof"
    proof.unlink(missing_ok=True)
    command = [*CIRIS, "grow", str(catalogue.ROOT / "examples" / name / "scene.yaml"), "--json", "--out", str(proof)]
    command += [LOCAL] if way == LOCAL else ["--url", service.url]
    before, start, busy = _stolen(), time.perf_counter(), _processor_seconds(service.pid)
    # ``--local`` uses all cores it may, so it may use as many as the service.
    allowed = set(sorted(os.sched_getaffinity(0))[:processes])
    fewer = partial(os.sched_setaffinity, 0, allowed) if way == LOCAL else None
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=fewer) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        output, said = process.stdout.read(), process.stderr.read()  # what the command says on standard error fits into a pipe
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise CirisError("command_failed", f"{' '.join(command)} ended with {process.returncode}: {said.strip()[-300:]}")
    seconds, document = time.perf_counter() - start, json.loads(output)
    parts = document["provenance"]
    return {
        "seconds": seconds,
        "seeding_seconds": parts["seeding_seconds"],
        "pair_seconds": parts["pair_seconds"],
        "besides_seconds": seconds - parts["seeding_seconds"] - parts["pair_seconds"],
        "processor_seconds": usage.ru_utime + usage.ru_stime + _processor_seconds(service.pid) - busy,
        "stolen_seconds": _stolen() - before,
        "ellipsoid": document["volume"]["ellipsoid"],
    }


@contextmanager
def running(data: Path, processes: int) -> Iterator[Service]:
    """Runs a separate service while the block runs, with its data in a directory of its own."""
    own = {"CIRIS_SOLVE_PROCESSES": str(processes)}
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
    return (
        f"{row['turn']} {row['way']}: {row['seconds']:.1f} s, {row['besides_seconds']:.1f} of them besides seeding and pairs, "
        f"{row['processor_seconds']:.1f} s of processor time, {row['stolen_seconds']:.1f} s stolen"
    )
