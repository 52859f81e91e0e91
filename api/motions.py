"""Each API process keeps the proved motions of the scenes that it is asked about, as tubes, and brings them up to date."""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import Lock
from typing import Annotated

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
class Kept:
    """A proved motion.

    Attributes:
        number: of the motion; later ones have larger numbers.
        arrays: as db.models.MotionRow has them.
        tube: half the width of the tube about it, radians or metres.
    """

    number: int
    arrays: dict[str, Array]
    tube: float


class Known:
    """Holds the proved motions of a scene. It never changes.

    Args:
        limits: the lower and the upper limits of the joints, (n,) each, radians or metres.
        version: counts the changes of the scene's motions.
        motions: id -> motion, the latest last.

    Attributes:
        tubes: the tubes about the motions, in the same order.
    """

    def __init__(self, limits: tuple[Array, Array], version: int, motions: dict[str, Kept]) -> None:
        self.version, self.motions = version, motions
        self.tubes = Tubes(limits, [Tube(motion_id, kept.arrays["path"], kept.tube) for motion_id, kept in motions.items()])
        self._between: dict[tuple[bytes, bytes], list[str]] = {}
        for motion_id, kept in motions.items():
            q = kept.arrays["q"]
            self._between.setdefault((_key(q[0]), _key(q[-1])), []).append(motion_id)

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
        """Returns the id of the motion that answered the same question: from the start to the goal, with the limits, (n,) each; or None.

        One that had to go through other configurations, or along a line, answers no question without them.
        """
        for motion_id in reversed(self._between.get((_key(start), _key(goal)), [])):
            arrays = self.motions[motion_id].arrays
            same = (arrays["speed"] == speed).all() and (arrays["acceleration"] == acceleration).all()
            if same and arrays.get("direct", np.zeros(1)).all():
                return motion_id
        return None


def _key(q: Array) -> bytes:
    """Returns what is the same for equal joint positions, (n,), alone."""
    return (q + 0.0).tobytes()  # -0.0 is 0.0


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
            if scene_id not in self._shelves:
                self._shelves[scene_id] = _Shelf(Known(scene.own_limits, 0, {}))
            shelf = self._shelves[scene_id]
        with shelf.lock, db.read() as session:
            version = motions.version(session, scene_id)
            if version != shelf.known.version:
                oldest, latest = motions.oldest(session, scene_id), max((kept.number for kept in shelf.known.motions.values()), default=0)
                known = {motion_id: kept for motion_id, kept in shelf.known.motions.items() if kept.number >= oldest}
                known |= {row.id: Kept(row.number, row.arrays, row.tube) for row in motions.since(session, scene_id, latest)}
                shelf.known = Known(scene.own_limits, version, known)
            return shelf.known


async def _motions(request: Request) -> MotionsKept:
    kept: MotionsKept = request.app.state.motions
    return kept


KeptMotions = Annotated[MotionsKept, Depends(_motions)]
