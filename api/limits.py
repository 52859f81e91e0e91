"""Token buckets limit how often one caller may ask.

The buckets are in the memory of each API process, not in Redis: Redis may be away, or start empty, at any time. With k API
processes a caller may therefore ask k times as often, and k processes can serve that.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from cachetools import LRUCache

MAX_BUCKETS = 10_000
BURST_SECONDS = 2.0


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
