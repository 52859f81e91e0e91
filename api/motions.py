"""Each API process keeps the proved motions of the scenes that it is asked about, as tubes, and brings them up to date."""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import Lock
from typing import Annotated, Any

import numpy as np
from cachetools import LRUCache
from fastapi import Depends, Request

from certifier.model import Array, Scene
from db import motions
from db.session import Database
from planner.tubes import Tube, Tubes

MOST = 8
"""Number of scenes whose motions are kept, those that were asked about last."""


@dataclass(frozen=True, eq=False)
class Known:
    """Holds the proved motions of a scene.

    Attributes:
        version: counts their changes.
        arrays: id -> the arrays of each, as db.models.MotionRow has them, the latest last.
        tubes: the tubes about them, in the same order.
    """

    version: int
    arrays: dict[str, dict[str, Any]]
    tubes: Tubes

    def width(self, motion_id: str) -> float:
        """Returns half the width of a motion's tube, in radians or metres."""
        return next(tube.rho for tube in self.tubes.motions if tube.id == motion_id)

    def path(self, start: Array, goal: Array) -> tuple[str, Array] | None:
        """Returns the motion in whose tube both the start and the goal are, (n,) each, and a path between them in it, (k, n); or None.

        Of several motions it takes the one with the shortest path.
        """
        tubes, found = self.tubes, list[tuple[float, int, Array]]()
        (ahead, t), (behind, u) = tubes.at(start), tubes.at(goal)
        for motion in np.intersect1d(tubes.motion[ahead], tubes.motion[behind]).tolist():
            i, j = (int(np.flatnonzero(tubes.motion[lines] == motion)[0]) for lines in (ahead, behind))
            first, last, points = int(tubes.place[ahead[i]]), int(tubes.place[behind[j]]), tubes.motions[motion].path
            forward = (first, t[i]) <= (last, u[j])
            between = points[first + 1 : last + 1] if forward else points[last + 1 : first + 1][::-1]
            path = np.concatenate([start[None], between, goal[None]])
            found.append((float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()), motion, path))
        if not found:
            return None
        _, motion, path = min(found, key=lambda one: one[:2])
        return tubes.motions[motion].id, path

    def answer(self, start: Array, goal: Array, speed: Array, acceleration: Array) -> str | None:
        """Returns the id of a motion from the start to the goal, (n,) each, that keeps the limits, (n,) each; None where there is none."""
        for motion_id, arrays in reversed(self.arrays.items()):
            ends = (arrays["q"][0] == start).all() and (arrays["q"][-1] == goal).all()
            if ends and (arrays["speed"] <= speed).all() and (arrays["acceleration"] <= acceleration).all():
                return motion_id
        return None


@dataclass
class _Shelf:
    known: Known
    lock: Lock = field(default_factory=Lock)


class MotionsKept:
    """Holds the motions of scenes. The database is the truth about which there are: every question compares the version."""

    def __init__(self) -> None:
        self._shelves: LRUCache[str, _Shelf] = LRUCache(MOST)
        self._lock = Lock()

    def of(self, db: Database, scene_id: str, scene: Scene) -> Known:
        """Returns the motions of a scene, as of a version that is no older than this call."""
        with self._lock:
            shelf = self._shelves.setdefault(scene_id, _Shelf(Known(0, {}, Tubes(scene.own_limits, []))))
        with shelf.lock, db.read() as session:
            version = motions.version(session, scene_id)
            if version != shelf.known.version:
                ids = motions.roll(session, scene_id)
                there = set(ids)
                known = {motion_id: arrays for motion_id, arrays in shelf.known.arrays.items() if motion_id in there}
                widths = {tube.id: tube.rho for tube in shelf.known.tubes.motions}
                for motion_id, arrays, rho in motions.read(session, [motion_id for motion_id in ids if motion_id not in known]):
                    known[motion_id], widths[motion_id] = arrays, rho
                tubes = Tubes(scene.own_limits, [Tube(motion_id, arrays["path"], widths[motion_id]) for motion_id, arrays in known.items()])
                shelf.known = Known(version, known, tubes)
            return shelf.known


async def _motions(request: Request) -> MotionsKept:
    kept: MotionsKept = request.app.state.motions
    return kept


KeptMotions = Annotated[MotionsKept, Depends(_motions)]
