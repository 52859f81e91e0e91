"""Prometheus' text format (version 0.0.4): what the database holds, what waits in the queue, what this process has answered."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from db.statistics import Statistics

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
MEDIA_TYPE = "text/plain; version=0.0.4"

Samples = Mapping[tuple[tuple[str, str], ...], float]


@dataclass
class Requests:
    """Requests that this process has answered, by method and status, and the seconds that they took together."""

    count: dict[tuple[str, int], int] = field(default_factory=dict)
    seconds: dict[tuple[str, int], float] = field(default_factory=dict)

    def note(self, method: str, status: int, seconds: float) -> None:
        """Counts one; methods that nobody uses count as one, however many a client thinks up."""
        key = (method if method in METHODS else "other", status)
        self.count[key] = self.count.get(key, 0) + 1
        self.seconds[key] = self.seconds.get(key, 0.0) + seconds


def render(statistics: Statistics, waiting: Mapping[str, int], requests: Requests) -> str:
    """All metrics.

    Args:
        waiting: messages in each queue; empty when Redis cannot be reached.
    """
    families = [
        _family("ciris_jobs", "gauge", "Jobs by state.", _by("state", statistics.jobs)),
        _family("ciris_pairs", "gauge", "Pairs by state; the settled ones by outcome.", _by("state", statistics.pairs)),
        _family("ciris_pair_seconds", "gauge", "Time spent on the stored pairs, by state.", _by("state", statistics.pair_seconds)),
        _family("ciris_step_seconds", "gauge", "Time spent on the stored steps, by kind.", _by("kind", statistics.step_seconds)),
        _family("ciris_webhooks", "gauge", "Webhooks by state.", _by("state", statistics.webhooks)),
        _family("ciris_regions", "gauge", "Certified regions.", {(): statistics.regions}),
        _family("ciris_queue_messages", "gauge", "Messages that wait, by queue.", _by("queue", waiting)),
        _family("ciris_http_requests_total", "counter", "Requests answered by this process.", _requests(requests.count)),
        _family("ciris_http_request_seconds_total", "counter", "Time that they took.", _requests(requests.seconds)),
    ]
    return "".join(families)


def _by(label: str, values: Mapping[str, float]) -> Samples:
    return {((label, name),): value for name, value in values.items()}


def _requests(values: Mapping[tuple[str, int], float]) -> Samples:
    return {(("method", method), ("status", str(status))): value for (method, status), value in values.items()}


def _family(name: str, kind: str, text: str, samples: Samples) -> str:
    lines = [f"# HELP {name} {text}", f"# TYPE {name} {kind}", *(f"{name}{_labels(labels)} {value}" for labels, value in samples.items())]
    return "".join(f"{line}\n" for line in lines)


def _labels(labels: Iterable[tuple[str, str]]) -> str:
    inside = ",".join(f'{name}="{value}"' for name, value in labels)
    return f"{{{inside}}}" if inside else ""
