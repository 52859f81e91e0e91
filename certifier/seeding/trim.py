"""The corners of a proposal that collide are cut off here, by faces that lose as little as they can (certifier.polytopes.cutting).

Samples that are uniform in q show where something touches. One of the geometries, or of the volumes that growth will keep apart by faces
(:mod:`certifier.seeding.coarse_pairs`), is enough. What is cut off here costs growth no cell.

A seed in a narrow place has contacts all about it, which samples of the whole polytope do not show. So small copies of the polytope about
the seed are cut first. Faces near the seed cut much of the rest off as well, so few corners of the rest collide then. In the other order,
the faces of both often leave a sliver.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from certifier.isolation.telling import tell
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Polytope, Scene
from certifier.polytopes.cutting import cut
from certifier.polytopes.ellipsoid import Ellipsoid, inscribed_ellipsoid
from certifier.polytopes.gibbs import uniform_in_q
from certifier.polytopes.polytope import without_redundant
from certifier.polytopes.sampling import hit_and_run
from certifier.seeding.coarse_pairs import coarse_pairs_of, with_coarse_pairs
from certifier.seeding.contacts import Contacts
from certifier.seeding.corners import without_contacts
from certifier.seeding.options import SeedOptions

EACH = 40
"""This many samples come from one chain."""
PASSES = 0.5
"""The polytope passes if at most this part of epsilon of the samples collides."""
SIZES, LOOKED_AT, FEW = (0.1, 0.15, 0.2, 0.3, 0.45, 0.7), 2000, 10
"""Copies of these sizes about the seed are cut, one after the other, until at most FEW of LOOKED_AT samples of a copy collide."""


class Trim:
    """Cuts the corners that collide off a polytope.

    Attributes:
        polytope: the polytope as it is now.
        passed: whether the test of the last look at all of it was passed. It looks at N samples that are nearly independent and uniform in
            q. If more than epsilon of the volume in q collides, it fails with the probability 1 - delta (a Chernoff bound, as in Drake's
            IRIS).
    """

    def __init__(self, scene: Scene, polytope: Polytope, points: Array, options: SeedOptions, rng: np.random.Generator) -> None:
        """Begins with a polytope.

        Args:
            polytope: joint limits included, as its last rows.
            points: (k, n) points in s that stay inside, the seed first.

        Raises:
            RegionError: here and later: the polytope is empty or unbounded.
        """
        self.polytope, self.passed = polytope, False
        self._scene, self._points, self._rng, self._around = scene, points, rng, polytope
        coarse = coarse_pairs_of(scene, polytope, points)
        self._wider = with_coarse_pairs(scene, coarse) if coarse else scene
        self._rounds = options.max_iterations_separating_planes
        self._count = math.ceil(2 * math.log(1 / options.delta) / (options.epsilon * PASSES**2) / EACH)
        self._few = PASSES * options.epsilon * self._count * EACH

    def by_samples(self, least: float) -> Ellipsoid | None:
        """Cuts off what samples show: first of small copies about the seed, then of all of the polytope.

        Returns:
            the largest ellipsoid in the polytope then; None, at once, where its volume is ``least`` or smaller.
        """
        for size in SIZES:
            self._until_few(self._scene, partial(self._of_copy, size), FEW)
            if least and inscribed_ellipsoid(self.polytope).volume <= least:
                return None
        self.passed = self._until_few(self._wider, self._of_all, self._few)
        ellipsoid = inscribed_ellipsoid(self.polytope)
        return ellipsoid if ellipsoid.volume > least else None

    def by_descents(self) -> None:
        """Cuts off the contacts that descents find, and what samples show then."""
        before, self.polytope = self.polytope, without_contacts(self._scene, self.polytope, self._points)
        if self.polytope is not before:
            self.passed = self._until_few(self._wider, self._of_all, self._few)

    def _of_all(self) -> Array:
        return uniform_in_q(self.polytope, self._scene, self._count, EACH, int(self._rng.integers(2**31))).reshape(-1, self._scene.n)

    def _of_copy(self, size: float) -> Array:
        C, d, seed = self.polytope.C, self.polytope.d, self._points[0]
        return hit_and_run(Polytope(C, C @ seed + size * (d - C @ seed)), seed, LOOKED_AT, int(self._rng.integers(2**31)))

    def _until_few(self, wider: Scene, drawn: Callable[[], Array], few: float) -> bool:
        """Cuts off what collides of samples, drawn anew for each round, until at most ``few`` do; returns whether that is so.

        Args:
            wider: the scene, perhaps with coarse volumes.
        """
        contacts = Contacts(wider)
        for _ in range(self._rounds):
            tell(faces=len(self.polytope.d) - 2 * self._scene.n)
            samples = drawn()
            colliding = samples[~contacts.free(samples)]
            if len(colliding) <= few:
                return True
            corners = [(_joints(wider, pair), found, 1.0) for pair, found in contacts.touching(colliding).items()]
            made = cut(self._scene, self.polytope, self._points, corners, self._around)
            if made.polytope is None or made.polytope is self.polytope:
                break
            self.polytope, self._around = without_redundant(made.polytope, fixed=2 * self._scene.n), made.around
        return False


def _joints(scene: Scene, pair: Pair) -> tuple[int, ...]:
    """Returns the position indices of the joints between a pair's bodies, ascending."""
    return tuple(sorted(Kinematics.of(scene).chain(scene.geometry(pair.a).body, scene.geometry(pair.b).body)))
