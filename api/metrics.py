"""The metrics are in Prometheus' text format (version 0.0.4).

They count the rows of the database, the messages in the queues and the requests that were answered.
"""

from __future__ import annotations

import logging
import math
import mmap
from bisect import bisect_left
from collections.abc import Iterable, Mapping
from itertools import accumulate
from pathlib import Path

from api.probes import OK
from db.statistics import Statistics

log = logging.getLogger(__name__)

OTHER = "other"
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", OTHER)
STATUSES = range(100, 600)
BUCKETS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0)
"""Upper bounds of the latencies that are counted, in seconds."""
_LATENCIES = 2 * len(METHODS) * len(STATUSES)
_LATENCY_CELLS = len(BUCKETS) + 2
"""For each method: a count for each bucket, one for what is beyond them, and the sum."""
_BYTES = 8 * (_LATENCIES + len(METHODS) * _LATENCY_CELLS)
QUANTILES = (0.5, 0.9, 0.99)
"""The metrics have the times within which these parts of the jobs are."""
AGES = (0, 1, 10, 60, 600, 3600)
"""Waiting work is counted by these least ages, in seconds."""
MEDIA_TYPE = "text/plain; version=0.0.4"

Samples = Mapping[tuple[tuple[str, str], ...], float]


class Requests:
    """Counts the answered requests by method and status, and sums the seconds they took.

    Every API process of the service counts in a file of its own, which it maps into its memory. A process that is started again goes on
    with the counts of its file. The totals are those of all files.

    Args:
        file: this process's file; the other files of its directory belong to the other processes. None for a process that is alone.
    """

    def __init__(self, file: Path | None = None) -> None:
        mapped = None if file is None else _mapped(file)
        self._file = None if mapped is None else file
        self._cells = memoryview(mmap.mmap(-1, _BYTES) if mapped is None else mapped).cast("d")

    def note(self, method: str, status: int, seconds: float, *, stream: bool = False) -> None:
        """Counts one request. All methods outside ``METHODS`` count as ``OTHER``, however many a client invents.

        Args:
            stream: the answer lasts as long as the client listens, so its time is no latency.
        """
        cell = _cell(method, status)
        self._cells[cell] += 1
        self._cells[cell + 1] += seconds
        if not stream:
            latencies = _LATENCIES + _row(method) * _LATENCY_CELLS
            self._cells[latencies + bisect_left(BUCKETS, seconds)] += 1
            self._cells[latencies + len(BUCKETS) + 1] += seconds

    def totals(self) -> dict[tuple[str, int], tuple[int, float]]:
        """Returns (method, status) -> (how many requests, their seconds), summed over all processes."""
        every = self._of_all()
        found = {}
        for method in METHODS:
            for status in STATUSES:
                cell = _cell(method, status)
                if count := sum(cells[cell] for cells in every):
                    found[method, status] = int(count), sum(cells[cell + 1] for cells in every)
        return found

    def latencies(self) -> dict[str, tuple[list[int], float]]:
        """Returns method -> how many requests took at most as long as each bucket, and at last how many there were, and their seconds."""
        every = self._of_all()
        found = {}
        for method in METHODS:
            begin = _LATENCIES + _row(method) * _LATENCY_CELLS
            counts = [int(sum(cells[begin + i] for cells in every)) for i in range(len(BUCKETS) + 1)]
            if any(counts):
                found[method] = list(accumulate(counts)), sum(cells[begin + len(BUCKETS) + 1] for cells in every)
        return found

    def _of_all(self) -> list[memoryview[float]]:
        """Returns the cells of all processes."""
        others: list[bytes] = []
        if self._file is not None:
            others = [path.read_bytes() for path in self._file.parent.iterdir() if path != self._file]
        return [self._cells, *(memoryview(content).cast("d") for content in others if len(content) == _BYTES)]


def _row(method: str) -> int:
    return METHODS.index(method if method in METHODS else OTHER)


def _cell(method: str, status: int) -> int:
    return 2 * (_row(method) * len(STATUSES) + STATUSES.index(status))


def _mapped(file: Path) -> mmap.mmap | None:
    """Returns the file in memory; None where it cannot be written, as on a full disk.

    All of the file is written first. A process that touches a mapped page without a place on a full disk is ended by a signal.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        counted = file.read_bytes()[:_BYTES] if file.exists() else b""
        with file.open("r+b" if counted else "w+b") as stream:
            stream.write(counted.ljust(_BYTES, b"\0"))
            stream.flush()
            return mmap.mmap(stream.fileno(), _BYTES)
    except OSError as error:
        log.warning("requests are counted for this process alone, because %s cannot be written: %s", file, error.strerror)
        return None


def render(
    counted: tuple[float, Statistics] | None,
    waiting: Mapping[str, int],
    requests: Requests,
    checks: Mapping[str, str],
    connections: Mapping[tuple[str, str], int],
) -> str:
    """Returns all metrics as text.

    Args:
        counted: the rows of the database, and how many seconds ago they were counted; None where the database does not answer.
        waiting: messages in each queue; empty when Redis cannot be reached.
        checks: what each check says; ``ok`` where all is well.
        connections: connections to the database, by pool and use.
    """
    answered = requests.totals()
    passed = {check: int(said == OK) for check, said in checks.items()}
    pools: Samples = {(("pool", pool), ("use", use)): count for (pool, use), count in connections.items()}
    families = [
        _family("ciris_check", "gauge", "1 where a check of /readyz says ok, else 0.", _by("check", passed)),
        _family("ciris_database_connections", "gauge", "Connections of this process, by pool and use.", pools),
        _family("ciris_queue_messages", "gauge", "Messages that wait, by queue.", _by("queue", waiting)),
        _family("ciris_http_requests_total", "counter", "Requests answered.", _requests(answered, 0)),
        _family("ciris_http_request_seconds_total", "counter", "Time that they took.", _requests(answered, 1)),
        _histogram("ciris_http_latency_seconds", "Time until a request was answered, without streams.", requests.latencies()),
        *([] if counted is None else _of_rows(*counted)),
    ]
    return "".join(families)


def _of_rows(age: float, statistics: Statistics) -> list[str]:
    return [
        _family("ciris_statistics_age_seconds", "gauge", "Time since the rows of the database were counted.", {(): age}),
        _family("ciris_jobs", "gauge", "Jobs by state.", _by("state", statistics.jobs)),
        _family("ciris_jobs_ended", "gauge", "Stored jobs that have ended, by project and how.", _ended(statistics)),
        _family(
            "ciris_job_wait_seconds",
            "gauge",
            "Time until a solver began a job, for those of the last 15 minutes.",
            _quantiles(statistics.waited),
        ),
        _family("ciris_job_seconds", "gauge", "Time until a job ended, for those of the last 15 minutes.", _quantiles(statistics.took)),
        _family("ciris_pairs", "gauge", "Pairs by state; the settled ones by outcome.", _by("state", statistics.pairs)),
        _family("ciris_pair_seconds", "gauge", "Time spent on the stored pairs, by state.", _by("state", statistics.pair_seconds)),
        _family("ciris_step_seconds", "gauge", "Time spent on the stored steps, by kind.", _by("kind", statistics.step_seconds)),
        _family("ciris_webhooks", "gauge", "Webhooks by state.", _by("state", statistics.webhooks)),
        _family("ciris_regions", "gauge", "Certified regions.", {(): statistics.regions}),
        _family("ciris_workers", "gauge", "Workers that live, by kind and state.", _workers(statistics)),
        _family("ciris_workers_in_trouble", "gauge", "Workers of whose regular tasks one fails.", {(): statistics.workers_in_trouble}),
        _family("ciris_workers_wanted", "gauge", "Solving processes that would be busy now.", {(): statistics.workers_wanted}),
        _family("ciris_jobs_without_solver", "gauge", "Jobs with work of which no solver does any.", {(): statistics.jobs_without_solver}),
        _family("ciris_decisions_due", "gauge", "Jobs that wait for a control worker.", {(): statistics.decisions_due}),
        _family("ciris_open_pieces", "gauge", "Pieces that wait, of iterations begun longer ago than.", _ages(statistics)),
        _family("ciris_oldest_open_piece_seconds", "gauge", "Age of what waits longest.", {(): max(statistics.waiting, default=0.0)}),
    ]


def _ended(statistics: Statistics) -> Samples:
    return {(("project", project), ("end", end)): count for (project, end), count in statistics.ended.items()}


def _quantiles(seconds: Mapping[str, list[float]]) -> Samples:
    """Returns the least time within which each of these parts of a project's jobs is."""
    return {
        (("project", project), ("quantile", f"{part:g}")): ordered[math.ceil(part * len(ordered)) - 1]
        for project, ordered in seconds.items()
        for part in QUANTILES
    }


def _ages(statistics: Statistics) -> Samples:
    older = {age: sum(pieces for seconds, pieces in statistics.waiting.items() if seconds >= age) for age in AGES}
    return {(("seconds", f"{age:g}"),): count for age, count in older.items()}


def _histogram(name: str, text: str, latencies: Mapping[str, tuple[list[int], float]]) -> str:
    lines = [f"# HELP {name} {text}", f"# TYPE {name} histogram"]
    for method, (counts, seconds) in latencies.items():
        for bound, count in zip((*BUCKETS, "+Inf"), counts, strict=True):
            lines.append(f"{name}_bucket{_labels((('method', method), ('le', str(bound))))} {count}")
        lines.append(f"{name}_sum{_labels((('method', method),))} {seconds}")
        lines.append(f"{name}_count{_labels((('method', method),))} {counts[-1]}")
    return "".join(f"{line}\n" for line in lines)


def _by(label: str, values: Mapping[str, float]) -> Samples:
    return {((label, name),): value for name, value in values.items()}


def _workers(statistics: Statistics) -> Samples:
    return {(("kind", kind), ("state", state)): count for (kind, state), count in statistics.workers.items()}


def _requests(answered: Mapping[tuple[str, int], tuple[float, float]], part: int) -> Samples:
    return {(("method", method), ("status", str(status))): values[part] for (method, status), values in answered.items()}


def _family(name: str, kind: str, text: str, samples: Samples) -> str:
    lines = [f"# HELP {name} {text}", f"# TYPE {name} {kind}", *(f"{name}{_labels(labels)} {value}" for labels, value in samples.items())]
    return "".join(f"{line}\n" for line in lines)


def _labels(labels: Iterable[tuple[str, str]]) -> str:
    inside = ",".join(f'{name}="{value}"' for name, value in labels)
    return f"{{{inside}}}" if inside else ""
