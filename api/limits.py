"""Token buckets limit how often one caller may ask, and the requests of projects are spaced.

The buckets are in the memory of each API process, not in Redis: Redis may be away, or start empty, at any time. With k API
processes a caller may therefore ask k times as often, and k processes can serve that.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from cachetools import LRUCache

MAX_BUCKETS = 10_000
BURST_SECONDS = 2.0
LATELY_SECONDS, LONGEST_SECONDS = 10.0, 2.0
"""Names that asked within LATELY_SECONDS share the service. No request waits for longer than LONGEST_SECONDS."""


@dataclass
class _Bucket:
    tokens: float
    filled: float


class Buckets:
    """There is one token bucket for each name. It gains ``rate`` tokens a second and keeps those of at most ``BURST_SECONDS``.

    When there are more than ``MAX_BUCKETS`` names, the name that was quiet for longest is forgotten.
    """

    def __init__(self, rate: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate, self._size, self._clock = rate, max(1.0, BURST_SECONDS * rate), clock
        self._buckets: LRUCache[str, _Bucket] = LRUCache(MAX_BUCKETS)

    def take(self, name: str) -> float:
        """Takes a token. Returns 0, or the seconds until the next token when the bucket is empty."""
        now = self._clock()
        bucket = self._buckets.setdefault(name, _Bucket(self._size, now))
        bucket.tokens = min(self._size, bucket.tokens + self._rate * (now - bucket.filled))
        bucket.filled = now
        if bucket.tokens < 1:
            return (1 - bucket.tokens) / self._rate
        bucket.tokens -= 1
        return 0.0


class Spacing:
    """Spaces the requests of each name while several names ask: ``at_once`` of them at once, and then ``rate`` a second.

    Many that come at the same time would keep those of others waiting until all of them are answered.
    """

    def __init__(self, rate: float, at_once: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate, self._at_once, self._clock = rate, at_once, clock
        self._next: LRUCache[str, float] = LRUCache(MAX_BUCKETS)
        """When the next request of a name would come if all came evenly."""
        self._last: str | None = None
        self._shared_at = -math.inf
        """When another name asked than before."""

    def delay(self, name: str) -> float:
        """Returns for how many seconds a request that comes now is to wait. For more than ``LONGEST_SECONDS``, it is to be refused."""
        now = self._clock()
        if self._last not in (name, None):
            self._shared_at = now
        self._last = name
        if self._shared_at < now - LATELY_SECONDS:
            return 0.0
        even = max(now, self._next.get(name, now))
        delay = max(0.0, even - now - (self._at_once - 1) / self._rate)
        if delay <= LONGEST_SECONDS:
            self._next[name] = even + 1 / self._rate
        return delay
