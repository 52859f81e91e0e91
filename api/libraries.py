"""Each API process keeps the regions of the scenes that it is asked about, and brings them up to date when they have changed."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from threading import Lock
from typing import Annotated

from fastapi import Depends, Request

from db import regions
from db.session import Database
from planner.library import Library

MOST = 8
"""The regions of so many scenes are kept, those that were asked about last."""
AT_ONCE = 200
"""So many regions are read from the database at once."""


@dataclass
class _Shelf:
    library: Library
    lock: Lock = field(default_factory=Lock)


class Libraries:
    """Holds the libraries of scenes. The database is the truth about which regions there are: every question compares the version."""

    def __init__(self) -> None:
        self._shelves: OrderedDict[str, _Shelf] = OrderedDict()
        self._lock = Lock()

    def of(self, database: Database, scene_id: str, n: int) -> Library:
        """Returns the library of a scene with n joints, as of a version that is no older than this call."""
        with self._lock:
            shelf = self._shelves.setdefault(scene_id, _Shelf(Library(n)))
            self._shelves.move_to_end(scene_id)
            if len(self._shelves) > MOST:
                self._shelves.popitem(last=False)
        with shelf.lock:
            while not _is_current(database, scene_id, shelf.library):
                shelf.library = _changed(database, scene_id, shelf.library)
            return shelf.library


def _is_current(database: Database, scene_id: str, library: Library) -> bool:
    with database.read() as session:
        return regions.version(session, scene_id) == library.version


def _changed(database: Database, scene_id: str, library: Library) -> Library:
    """Returns the library with the regions that the scene has now. Only those that are new are read."""
    known = set(library.ids)
    with database.read() as session:
        version, ids = regions.roll(session, scene_id)
        new = [region_id for region_id in ids if region_id not in known]
        read = [regions.polytopes(session, new[begin : begin + AT_ONCE]) for begin in range(0, len(new), AT_ONCE)]
    added = [region for part in read for region in part]
    if len(added) < len(new):
        return library  # a region was deleted in between: the version is another one by now
    return library.changed(version, ids, added)


async def _libraries(request: Request) -> Libraries:
    libraries: Libraries = request.app.state.libraries
    return libraries


KeptLibraries = Annotated[Libraries, Depends(_libraries)]
