"""Each API process keeps the free sets of the scenes that it is asked about: what the latest map of each proves, for lookups."""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import Lock
from typing import Annotated

from cachetools import LRUCache
from fastapi import Depends, Request

from ciris.free_set import FreeSet
from db import maps
from db.session import Database

MOST = 4
"""Number of scenes whose free sets are kept, those that were asked about last."""


@dataclass
class _Shelf:
    job: str | None = None
    free: FreeSet | None = None
    lock: Lock = field(default_factory=Lock)


@dataclass(frozen=True)
class Mapped:
    """The free set of a scene's latest map, and the job that has grown it."""

    job: str
    free: FreeSet


class FreeSetsKept:
    """Holds the free sets of scenes. The database is the truth about which map is the latest: every question compares it."""

    def __init__(self) -> None:
        self._shelves: LRUCache[str, _Shelf] = LRUCache(MOST)
        self._lock = Lock()

    def of(self, db: Database, scene_id: str) -> Mapped | None:
        """Returns what the scene's latest map proves; None without a map."""
        with self._lock:
            if scene_id not in self._shelves:
                self._shelves[scene_id] = _Shelf()
            shelf = self._shelves[scene_id]
        with shelf.lock, db.read() as session:
            job = maps.latest(session, scene_id)
            if job is None:
                return None
            if shelf.job != job or shelf.free is None:
                shelf.job, shelf.free = job, FreeSet.of_bytes(maps.free_set(session, job), f"the free set of the job {job}")
            return Mapped(job, shelf.free)


async def _free_sets(request: Request) -> FreeSetsKept:
    kept: FreeSetsKept = request.app.state.free_sets
    return kept


KeptFreeSets = Annotated[FreeSetsKept, Depends(_free_sets)]
