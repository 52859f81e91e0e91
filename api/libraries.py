"""Each API process keeps the regions of the scenes that it is asked about, and brings them up to date when they have changed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from threading import Lock
from typing import Annotated

from cachetools import LRUCache
from fastapi import Depends, Request

from db import regions
from db.session import Database
from planner.library import Library, renewed

MOST = 8
"""Number of scenes whose regions are kept, those that were asked about last."""


@dataclass
class _Shelf:
    library: Library
    lock: Lock = field(default_factory=Lock)


class Libraries:
    """Holds the libraries of scenes. The database is the truth about which regions there are: every question compares the version."""

    def __init__(self) -> None:
        self._shelves: LRUCache[str, _Shelf] = LRUCache(MOST)
        self._lock = Lock()

    def of(self, database: Database, scene_id: str, n: int) -> Library:
        """Returns the library of a scene with n joints, as of a version that is no older than this call."""
        with self._lock:
            shelf = self._shelves.setdefault(scene_id, _Shelf(Library(n)))
        with shelf.lock:
            while not _is_current(database, scene_id, shelf.library):
                shelf.library = _changed(database, scene_id, shelf.library)
            return shelf.library


def _is_current(database: Database, scene_id: str, library: Library) -> bool:
    with database.read() as session:
        return regions.version(session, scene_id) == library.version


def _changed(database: Database, scene_id: str, library: Library) -> Library:
    with database.read() as session:
        return renewed(library, partial(regions.roll, session, scene_id), partial(regions.polytopes, session))


async def _libraries(request: Request) -> Libraries:
    libraries: Libraries = request.app.state.libraries
    return libraries


KeptLibraries = Annotated[Libraries, Depends(_libraries)]
