"""Proposals are rated here by how much of them a growth is likely to keep, so that the best of several is taken."""

from __future__ import annotations

import math
from dataclasses import dataclass

from certifier.model import Array, Polytope, Scene
from certifier.partition.parted import touched
from certifier.polytopes.ellipsoid import volume, volume_in_q
from certifier.polytopes.gibbs import uniform_in_q

CHAINS, EACH = 400, 20
"""A proposal is looked at in this many samples of this many chains."""
LOST = 2.0
"""Growth loses about this many times the root of the share that is touched (docs/trials.md)."""


@dataclass(frozen=True)
class Rating:
    """A rating says how large a proposal is, and in how much of it faces have to separate volumes.

    Attributes:
        q_volume: volume in joint positions, in radians and metres.
        touched: the share of it at which volumes touch that faces keep apart (certifier.partition.parted).
    """

    q_volume: float
    touched: float

    @property
    def kept(self) -> float:
        """Returns the q-volume that a growth is likely to keep."""
        return self.q_volume * (1 - min(LOST * math.sqrt(self.touched), 1.0))


def rated(scene: Scene, polytope: Polytope, keep: Array) -> Rating:
    """Returns the rating of a proposal, the same one for the same proposal.

    Args:
        polytope: joint limits included.
        keep: (k, n) configurations that stay inside.

    Raises:
        RegionError: the polytope is empty or unbounded.
    """
    q_volume, _ = volume_in_q(polytope, scene, volume(polytope, 0), 0)
    return Rating(q_volume, touched(scene, polytope, samples_of(scene, polytope), keep))


def samples_of(scene: Scene, polytope: Polytope) -> Array:
    """Returns samples of a polytope, (CHAINS * EACH, n), uniform in q; the same ones for the same polytope."""
    return uniform_in_q(polytope, scene, CHAINS, EACH, 0).reshape(-1, scene.n)
