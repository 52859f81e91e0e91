"""A box about the seed in which nothing can touch is certified first. So a growth leaves a small region, however little time it has.

The proposal may take a while, and so may the first stage. In the box there is no contact to cut off, and nearly all pairs take one cell.

A vertex moves at most as far as its levers times the changes of the joints' positions (certifier.motion.chains). Two bodies do not touch in
the box if they are farther apart than that at the seed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from certifier.collisions.free import distance_at
from certifier.collisions.seen import seen_of
from certifier.errors import RegionError
from certifier.model import Array, Polytope, Scene
from certifier.motion.bodies import bodies_of
from certifier.motion.views import moved
from certifier.seeding.limits import check_limits, off_limits, too_long

PART = 0.9
"""In the box, every two bodies come nearer to each other by at most this part of their distance at the seed."""
LEAST = 1e-3
"""There is no box with a smaller half width than this, in radians, and in metres for slides: a reason helps more than such a region."""


def nearby(scene: Scene, seed: dict[str, Any]) -> tuple[Polytope, Array] | None:
    """Returns a box about the seed with the same half width in all joints, cut off at the joint limits, and the seed in s, (n,).

    It is None where the box would be too small or leave out a configuration to contain, where a slide is far longer than the robot, and
    where there is no seed or one that is refused. :func:`certifier.seeding.propose.propose` says why.

    Args:
        seed: a document of :class:`certifier.seeding.options.SeedOptions`.
    """
    points = [] if seed.get("q") is None else [seed["q"], *seed.get("contain", ())]
    if not points or any(len(q) != scene.n for q in points) or too_long(scene):
        return None
    try:
        for point in points:
            check_limits(scene, point)
    except RegionError:
        return None
    keep = scene.to_s(off_limits(scene, points))
    bodies, seen, q, n = bodies_of(scene), seen_of(scene), scene.to_q(keep[0]), scene.n
    R, p, half = np.empty((len(bodies.parents), 3, 3)), np.empty((len(bodies.parents), 3)), np.inf
    for pair, view in enumerate(seen.moving):
        each = moved(seen.views, view, seen.levers, np.ones(n))  # how far a vertex moves at most, where all joints move by 1
        if each > 0:
            half = min(half, PART * distance_at(bodies, seen, pair, q, R, p) / each)
    if not LEAST <= half < np.inf:
        return None
    lower, upper = (scene.to_s(np.clip(q + sign * half, scene.q_lower, scene.q_upper)) for sign in (-1, 1))
    box = scene.polytope(np.concatenate([np.eye(n), -np.eye(n)]), np.concatenate([upper, -lower]))
    return (box, keep[0]) if (keep @ box.C.T < box.d).all() else None
