"""A box about the seed in which nothing can touch is certified first where the seed is in a narrow place.

There the first stage takes long, and may end without a region. In the box there is no contact to cut off, and nearly all pairs take one
cell. So there is a small region after a few seconds.

A vertex moves at most as far as its levers times the changes of the joints' positions (certifier.motion.chains). Two bodies do not touch in
the box if they are farther apart than that at the seed.
"""

from __future__ import annotations

import numpy as np

from certifier.collisions.free import distance_at
from certifier.collisions.seen import seen_of
from certifier.growth.state import Start
from certifier.model import Polytope, Scene
from certifier.motion.bodies import bodies_of
from certifier.motion.views import moved

PART = 0.9
"""In the box, every two bodies come nearer to each other by at most this part of their distance at the seed."""
NARROW = 0.015
"""A seed is in a narrow place if the half width of the box is less than this, in radians, and in metres for slides."""


def nearby(scene: Scene, start: Start) -> Polytope | None:
    """Returns a box about the seed with the same half width in all joints, cut off at the joint limits.

    It is None where the seed has more room, or where another point to keep is outside of the box.
    """
    bodies, seen, q, n = bodies_of(scene), seen_of(scene), scene.to_q(start.seed), scene.n
    R, p, half = np.empty((len(bodies.parents), 3, 3)), np.empty((len(bodies.parents), 3)), np.inf
    for pair, view in enumerate(seen.moving):
        each = moved(seen.views, view, seen.levers, np.ones(n))  # by so much a vertex moves at most, where all joints move by 1
        if each > 0:
            half = min(half, PART * distance_at(bodies, seen, pair, q, R, p) / each)
    if not 0 < half < NARROW:
        return None
    lower, upper = (scene.to_s(np.clip(q + sign * half, scene.q_lower, scene.q_upper)) for sign in (-1, 1))
    box = scene.polytope(np.concatenate([np.eye(n), -np.eye(n)]), np.concatenate([upper, -lower]))
    return box if (start.keep @ box.C.T < box.d).all() else None
