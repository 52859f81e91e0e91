"""The share says how much of a proposal a region keeps, by volume in joint positions q."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array, Polytope, Scene
from certifier.pair.collisions import in_collision
from certifier.polytopes.gibbs import uniform_in_q

CHAINS, EACH = 400, 25
"""A proposal is looked at in this many samples of this many chains."""
_SEED = 0


@dataclass(frozen=True, eq=False)
class SampledProposal:
    """A proposal with samples that are uniform in q, of which those are known that are free of collisions.

    Attributes:
        polytope: the proposal, joint limits included.
        s: (CHAINS, EACH, n) the samples, in s.
        free: (CHAINS, EACH) True where no pair of the scene touches, padding included.
    """

    polytope: Polytope
    s: Array
    free: NDArray[np.bool_]

    @classmethod
    def of(cls, scene: Scene, polytope: Polytope) -> SampledProposal:
        """Samples a proposal, whose polytope includes the joint limits; the same proposal has the same samples.

        Raises:
            RegionError: as :func:`certifier.polytopes.polytope.chebyshev_center`.
        """
        s = uniform_in_q(polytope, scene.revolute, CHAINS, EACH, _SEED)
        return cls(polytope, s, ~in_collision(scene, s.reshape(-1, scene.n)).reshape(s.shape[:2]))

    def share(self, region: Polytope) -> dict[str, Any]:
        """Returns how much of the proposal's free part a region keeps, as the manifest says it.

        ``value`` is the q-volume of the region within the free part over that of the free part, and ``stderr`` its standard error. The
        region may reach beyond the proposal, which does not count. Both are None where no sample is free. ``collision_free`` is the part
        of the ``samples`` that is free.

        The value is a ratio of two sums over the chains, which are independent. Its error is that of the ratio's linear part, taken from
        the spread between the chains, so it includes what the samples of one chain have in common. Where all samples agree there is no
        spread. Nothing smaller than one sample is seen, so the error is never said to be less than one in the number of free samples.
        """
        free, kept = self.free.sum(axis=1), (self.free & region.contains(self.s)).sum(axis=1)
        found = {"value": None, "stderr": None, "collision_free": float(self.free.mean()), "samples": self.free.size}
        if not free.any():
            return found
        value = kept.sum() / free.sum()
        spread = np.sqrt(len(free) / (len(free) - 1) * ((kept - value * free) ** 2).sum()) / free.sum()
        return found | {"value": float(value), "stderr": float(max(spread, 1 / free.sum()))}
