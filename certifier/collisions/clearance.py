"""How far the pairs of a scene are apart at one configuration, and how deep they are in each other, in floating point.

Drake's signed distances are not asked. They do not come for minutes where the centre of a large ball lies on a vertex of a hull: FCL's
expanding polytope algorithm, whose steps nothing limits, needs more and more faces to come within 1e-6 m of the ball. Where bodies are
apart, they may be too large: by centimetres between boxes that are turned about one axis. Here, a plane with this room on either side is
known for each distance that is returned.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from certifier.collisions.free import distance_at, free_at_all
from certifier.collisions.seen import seen_of
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Scene
from certifier.motion.bodies import bodies_of


class Clearance:
    """Tells how far apart the pairs of a scene are."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._bodies, self._order = scene, bodies_of(scene), np.arange(len(scene.pairs))
        links = len(self._bodies.parents)
        self._work = np.empty((links, 3, 3)), np.empty((links, 3))

    def least(self, q: Array) -> tuple[float, Pair]:
        """Returns the least distance of the padded bodies of a pair at q, (n,), in metres, and the pair.

        It is negative where the bodies overlap: minus the least distance that one of them has to move.
        """
        distances = [self._distance(index, np.ascontiguousarray(q, dtype=float)) for index in range(len(self._scene.pairs))]
        nearest = int(np.argmin(distances))
        return distances[nearest], self._scene.pairs[nearest]

    def free(self, q: Array, room: float = 0.0) -> bool:
        """Returns whether all pairs are farther apart at q, (n,), than twice the padding and the room, in metres."""
        seen = seen_of(self._scene, room / 2)
        return bool(free_at_all(self._bodies, seen, np.ascontiguousarray(q, dtype=float)[None], self._order)[0])

    def _distance(self, index: int, q: Array) -> float:
        seen = seen_of(self._scene)
        distance, reach = float(distance_at(self._bodies, seen, index, q, *self._work)), float(seen.reaches[index])
        if distance > -reach:
            return distance
        pair = self._scene.pairs[index]
        a, b = self._scene.geometry(pair.a), self._scene.geometry(pair.b)
        s = self._scene.to_s(self._scene.in_windows(q))[None]
        return -reach - depth(a.vertices, Kinematics.of(self._scene).points(a.body, b.body, b.vertices, s)[0])


def depth(A: Array, B: Array) -> float:
    """Returns how far the hulls of A (v, 3) and B (w, 3), which meet, have to move at least until they only touch, in the unit of both.

    This is the distance from 0 to the boundary of the hull of all differences of a vertex of A and one of B.
    """
    try:
        faces = ConvexHull((A[:, None] - B).reshape(-1, 3)).equations
    except QhullError:  # the differences of points and segments are flat, so the least move is none
        return 0.0
    return max(0.0, -float(faces[:, 3].max()))
