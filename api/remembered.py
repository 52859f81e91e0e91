"""What is asked again and again, and cannot change, is remembered here."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping
from threading import Lock
from typing import Generic, TypeVar

from cachetools import LRUCache

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Remembered(Generic[Key, Value]):
    """It remembers what was said of the ``most`` keys that were asked for last, also that nothing was. Threads may share it."""

    def __init__(self, most: int) -> None:
        self._known: LRUCache[Key, Value | None] = LRUCache(most)
        self._lock = Lock()

    def of(self, keys: Collection[Key], ask: Callable[[Collection[Key]], Mapping[Key, Value]]) -> dict[Key, Value | None]:
        """Returns what is known of each of these keys; None where ``ask``, which is asked for those that are new, says nothing."""
        with self._lock:
            known = {key: self._known[key] for key in keys if key in self._known}
        if new := [key for key in keys if key not in known]:
            said = ask(new)
            known |= {key: said.get(key) for key in new}
            with self._lock:
                self._known.update({key: known[key] for key in new})
        return known
