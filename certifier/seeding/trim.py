"""The corners of a proposal that collide are cut off here, by faces that lose as little as they can (certifier.polytopes.cutting).

Samples that are uniform in q show where something touches. One of the geometries, or of the volumes that growth will keep apart by faces
(:mod:`certifier.seeding.coarse_pairs`), is enough. What is cut off here costs growth no cell.
"""

from __future__ import annotations

import math

import numpy as np

from certifier.isolation.telling import tell
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Polytope, Scene
from certifier.polytopes.cutting import cut
from certifier.polytopes.gibbs import uniform_in_q
from certifier.seeding.coarse_pairs import coarse_pairs_of, with_coarse_pairs
from certifier.seeding.contacts import Contacts
from certifier.seeding.options import SeedOptions

EACH = 40
"""This many samples come from one chain."""
PASSES = 0.5
"""The polytope passes if at most this part of epsilon of the samples collides."""


def trimmed(scene: Scene, polytope: Polytope, points: Array, options: SeedOptions, rng: np.random.Generator) -> tuple[Polytope, bool]:
    """Returns the part of a polytope that faces leave, and whether it has passed the test.

    The test looks at N samples that are nearly independent and uniform in q. If more than epsilon of the volume in q collides, it fails
    with the probability 1 - delta (a Chernoff bound, as in Drake's IRIS).

    Args:
        polytope: joint limits included, as its last rows.
        points: (k, n) points in s that stay inside.

    Raises:
        RegionError: the polytope is empty or unbounded.
    """
    coarse = coarse_pairs_of(scene, polytope, points)
    wider = with_coarse_pairs(scene, coarse) if coarse else scene
    contacts, around = Contacts(wider), polytope
    count = math.ceil(2 * math.log(1 / options.delta) / (options.epsilon * PASSES**2) / EACH)
    for _ in range(options.max_iterations_separating_planes):
        tell(faces=len(polytope.d) - 2 * scene.n)
        samples = uniform_in_q(polytope, scene, count, EACH, int(rng.integers(2**31))).reshape(-1, scene.n)
        colliding = samples[~contacts.free(samples)]
        if len(colliding) <= PASSES * options.epsilon * len(samples):
            return polytope, True
        corners = [(_joints(wider, pair), found, 1.0) for pair, found in contacts.touching(colliding).items()]
        smaller = cut(scene, polytope, points, corners, around).polytope
        if smaller is None or smaller is polytope:
            break
        polytope = smaller
    return polytope, False


def _joints(scene: Scene, pair: Pair) -> tuple[int, ...]:
    """Returns the position indices of the joints between a pair's bodies, ascending."""
    return tuple(sorted(Kinematics.of(scene).chain(scene.geometry(pair.a).body, scene.geometry(pair.b).body)))
