"""The corners of a proposal that collide are cut off here, by faces that lose as little as they can (certifier.polytopes.cutting).

Samples that are uniform in q show where something touches. One of the geometries, or of the volumes that growth will keep apart by faces
(:mod:`certifier.seeding.coarse_pairs`), is enough. What is cut off here costs growth no cell.

Growth begins with a small copy of the proposal about the seed. A seed in a narrow place has contacts all about it, but of the whole
proposal they take up next to nothing. So samples of copies of several sizes are looked at as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from certifier.isolation.telling import tell
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Polytope, Scene
from certifier.polytopes.cutting import cut
from certifier.polytopes.gibbs import uniform_in_q
from certifier.polytopes.sampling import hit_and_run
from certifier.seeding.coarse_pairs import coarse_pairs_of, with_coarse_pairs
from certifier.seeding.contacts import Contacts
from certifier.seeding.corners import without_contacts
from certifier.seeding.options import SeedOptions

EACH = 40
"""This many samples come from one chain."""
PASSES = 0.5
"""The polytope passes if at most this part of epsilon of the samples collides."""
SIZES, LOOKED_AT, FEW = (0.1, 0.15, 0.2, 0.3, 0.45, 0.7), 2000, 1
"""Copies of these sizes about the seed are cut until at most FEW of LOOKED_AT samples collide."""


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
    trim = _Trim(scene, polytope, points, options.max_iterations_separating_planes)
    count = math.ceil(2 * math.log(1 / options.delta) / (options.epsilon * PASSES**2) / EACH)
    few = PASSES * options.epsilon * count * EACH

    def of_all() -> Array:
        return uniform_in_q(trim.polytope, scene, count, EACH, int(rng.integers(2**31))).reshape(-1, scene.n)

    def of_copy(size: float) -> Array:
        C, d = trim.polytope.C, trim.polytope.d
        copy = Polytope(C, C @ points[0] + size * (d - C @ points[0]))
        return hit_and_run(copy, points[0], LOOKED_AT, int(rng.integers(2**31)))

    passed, whole = trim.until_few(wider, of_all, few), trim.polytope
    for size in SIZES:
        trim.until_few(scene, partial(of_copy, size), FEW)
    trim.polytope = without_contacts(scene, trim.polytope, points)
    if trim.polytope is not whole:
        passed = trim.until_few(wider, of_all, few)
    return trim.polytope, passed


@dataclass
class _Trim:
    """Cuts corners off a polytope.

    Attributes:
        polytope: the polytope as it is now.
        points: (k, n) points in s that stay inside.
        rounds: at most this many are made until few samples collide.
    """

    scene: Scene
    polytope: Polytope
    points: Array
    rounds: int

    def __post_init__(self) -> None:
        self._around = self.polytope

    def until_few(self, wider: Scene, drawn: Callable[[], Array], few: float) -> bool:
        """Cuts off what collides of samples, drawn anew for each round, until at most ``few`` do; returns whether that is so.

        Args:
            wider: the scene, perhaps with coarse volumes.
        """
        contacts = Contacts(wider)
        for _ in range(self.rounds):
            tell(faces=len(self.polytope.d) - 2 * self.scene.n)
            samples = drawn()
            colliding = samples[~contacts.free(samples)]
            if len(colliding) <= few:
                return True
            corners = [(_joints(wider, pair), found, 1.0) for pair, found in contacts.touching(colliding).items()]
            smaller = cut(self.scene, self.polytope, self.points, corners, self._around).polytope
            if smaller is None or smaller is self.polytope:
                break
            self.polytope = smaller
        return False


def _joints(scene: Scene, pair: Pair) -> tuple[int, ...]:
    """Returns the position indices of the joints between a pair's bodies, ascending."""
    return tuple(sorted(Kinematics.of(scene).chain(scene.geometry(pair.a).body, scene.geometry(pair.b).body)))
