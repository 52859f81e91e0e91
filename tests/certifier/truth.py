"""What is true of a scene, as far as sampling in floating point can tell: by other code than the verifier's."""

from __future__ import annotations

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Pair, Scene
from certifier.polytopes.closest import closest
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.sampling import hit_and_run


def distances(world: Scene, C: np.ndarray, d: np.ndarray, count: int) -> dict[Pair, float]:
    """Least distance of each pair's padded bodies over samples of the polytope, in floating point.

    Raises:
        RegionError: the polytope has no point strictly inside.
    """
    polytope = world.polytope(C, d)
    return distances_at(world, hit_and_run(polytope, chebyshev_center(polytope)[0], count, 0))


def distances_at(world: Scene, s: np.ndarray) -> dict[Pair, float]:
    """The same over the configurations s, (S, n)."""
    kinematics, found = Kinematics(world), {}
    for pair in world.pairs:
        a, b = world.geometry(pair.a), world.geometry(pair.b)
        A, B = (kinematics.points(WORLD, g.body, g.vertices, s) for g in (a, b))
        found[pair] = min(closest(x, y).gap for x, y in zip(A, B, strict=True)) - a.radius - b.radius - 2 * world.padding
    return found
