"""A box about the seed in which nothing can touch is certified first where the seed is in a narrow place.

There the first stage takes long, and may end with nothing. No contact has to be cut off in this box, and nearly all pairs take one cell. So
there is a region in a few seconds, however small.

No vertex moves farther than its levers times the changes of the joints' positions (certifier.motion.chains), and a gap at the seed that is
larger than all of that stays open.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from certifier.collisions.seen import seen_of
from certifier.growth.state import Start
from certifier.model import Polytope, Scene, Volume
from certifier.partition.together import gaps_between

PART = 0.9
"""In the box, every two bodies come nearer to each other by at most this part of their distance at the seed."""
NARROW = 0.015
"""A seed is in a narrow place if the box has a smaller half width than this, in radians, and metres of slides."""


def nearby(scene: Scene, start: Start) -> Polytope | None:
    """Returns the box, as half widths that are the same for all joints, within the joint limits; None where the seed has more room, or
    where another point to keep is outside of it.
    """
    seen = seen_of(scene)
    moved = np.array([seen.levers[first:last].sum() for first, last in pairwise(seen.views.begins)])[seen.moving]
    volumes = [[Volume.of(scene.geometry(name)) for name in (pair.a, pair.b)] for pair in scene.pairs]
    gaps = np.array([gaps_between(scene, a, b, start.seed[None])[0] for a, b in volumes])
    half = PART * float((gaps[moved > 0] / moved[moved > 0]).min(initial=np.inf))
    if not 0 < half < NARROW:
        return None
    q, n = scene.to_q(start.seed), scene.n
    lower, upper = (scene.to_s(np.clip(q + sign * half, scene.q_lower, scene.q_upper)) for sign in (-1, 1))
    box = scene.polytope(np.concatenate([np.eye(n), -np.eye(n)]), np.concatenate([upper, -lower]))
    return box if (start.keep @ box.C.T < box.d).all() else None
