"""Each API process keeps the overlaps of the regions of the scenes that it plans in, as arrays."""

from __future__ import annotations

from threading import Lock
from typing import Annotated

import numpy as np
from cachetools import LRUCache
from fastapi import Depends, Request

from api import graph
from certifier.model import Scene
from db.session import Database
from planner.library import Library
from planner.trajectory.routes import Links

MOST = 8
"""Number of scenes whose overlaps are kept, those that were asked about last."""


class LinksKept:
    """Holds the overlaps of scenes, as of a version of whose regions all pairs have been compared."""

    def __init__(self) -> None:
        self._kept: LRUCache[str, tuple[int, Links]] = LRUCache(MOST)
        self._lock = Lock()

    def of(self, db: Database, scene_id: str, scene: Scene, library: Library) -> tuple[bool, Links]:
        """Returns whether all pairs of the library's regions have been compared, and their overlaps, with the library's numbers.

        Pairs that were not compared yet are compared now, for a few seconds.
        """
        with self._lock:
            version, links = self._kept.get(scene_id, (None, None))
        if links is not None and version == library.version:
            return True, links
        complete, known = graph.compared(db, scene_id, library)
        number = {region_id: i for i, region_id in enumerate(library.ids)}
        ends = np.array([(number[edge.earlier], number[edge.later]) for edge in known], dtype=np.intp).reshape(-1, 2)
        witness = np.array([edge.witness for edge in known]).reshape(-1, scene.n)
        links = Links(ends, witness, np.array([edge.depth for edge in known]), scene.to_q(witness))
        if complete:
            with self._lock:
                self._kept[scene_id] = library.version, links
        return complete, links


async def _links(request: Request) -> LinksKept:
    links: LinksKept = request.app.state.links
    return links


KeptLinks = Annotated[LinksKept, Depends(_links)]
