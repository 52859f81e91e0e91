"""The metrics are in Prometheus' text format (version 0.0.4).

They count the rows of the database, the messages in the queues and the requests that were answered.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterable, Mapping
from pathlib import Path

from db.statistics import Statistics

OTHER = "other"
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", OTHER)
STATUSES = range(100, 600)
_BYTES = 16 * len(METHODS) * len(STATUSES)
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
        self._file, self._cells = file, memoryview(_mapped(file)).cast("d")

    def note(self, method: str, status: int, seconds: float) -> None:
        """Counts one request. All methods outside ``METHODS`` count as ``OTHER``, however many a client invents."""
        cell = _cell(method, status)
        self._cells[cell] += 1
        self._cells[cell + 1] += seconds

    def totals(self) -> dict[tuple[str, int], tuple[int, float]]:
        """Returns (method, status) -> (how many requests, their seconds), summed over all processes."""
        every = [self._cells]
        if self._file is not None:
            others = [path.read_bytes() for path in self._file.parent.iterdir() if path != self._file]
            every += [memoryview(content).cast("d") for content in others if len(content) == _BYTES]
        found = {}
        for method in METHODS:
            for status in STATUSES:
                cell = _cell(method, status)
                if count := sum(cells[cell] for cells in every):
                    found[method, status] = int(count), sum(cells[cell + 1] for cells in every)
        return found


def _cell(method: str, status: int) -> int:
    row = METHODS.index(method) if method in METHODS else METHODS.index(OTHER)
    return 2 * (row * len(STATUSES) + STATUSES.index(status))


def _mapped(file: Path | None) -> mmap.mmap:
    if file is None:
        return mmap.mmap(-1, _BYTES)
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("ab") as stream:
        stream.truncate(_BYTES)
    with file.open("r+b") as stream:
        return mmap.mmap(stream.fileno(), _BYTES)


def render(statistics: Statistics, waiting: Mapping[str, int], requests: Requests) -> str:
    """Returns all metrics as text.

    Args:
        waiting: messages in each queue; empty when Redis cannot be reached.
    """
    answered = requests.totals()
    families = [
        _family("ciris_jobs", "gauge", "Jobs by state.", _by("state", statistics.jobs)),
        _family("ciris_pairs", "gauge", "Pairs by state; the settled ones by outcome.", _by("state", statistics.pairs)),
        _family("ciris_pair_seconds", "gauge", "Time spent on the stored pairs, by state.", _by("state", statistics.pair_seconds)),
        _family("ciris_step_seconds", "gauge", "Time spent on the stored steps, by kind.", _by("kind", statistics.step_seconds)),
        _family("ciris_webhooks", "gauge", "Webhooks by state.", _by("state", statistics.webhooks)),
        _family("ciris_regions", "gauge", "Certified regions.", {(): statistics.regions}),
        _family("ciris_workers", "gauge", "Workers that live, by kind and state.", _workers(statistics)),
        _family("ciris_workers_wanted", "gauge", "Solving processes that would be busy now.", {(): statistics.workers_wanted}),
        _family("ciris_queue_messages", "gauge", "Messages that wait, by queue.", _by("queue", waiting)),
        _family("ciris_http_requests_total", "counter", "Requests answered.", _requests(answered, 0)),
        _family("ciris_http_request_seconds_total", "counter", "Time that they took.", _requests(answered, 1)),
    ]
    return "".join(families)


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
