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
        s = uniform_in_q(polytope, scene, CHAINS, EACH, _SEED)
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
        found = {"value": None, "stderr": None, "collision_free": float(self.free.mean()), "samples": self.free.size}
        return found | _ratio(self.free & region.contains(self.s), self.free) if self.free.any() else found

    def kept(self, region: Polytope) -> dict[str, float]:
        """Returns how much of the proposal a region keeps, whether it is free or not: ``value`` and ``stderr`` as of :meth:`share`."""
        return _ratio(region.contains(self.s), np.ones_like(self.free))


def _ratio(some: NDArray[np.bool_], of: NDArray[np.bool_]) -> dict[str, float]:
    """Returns how many of the samples in ``of``, (CHAINS, EACH), are in ``some`` as well, with the standard error."""
    kept, total = some.sum(axis=1), of.sum(axis=1)
    value = kept.sum() / total.sum()
    spread = np.sqrt(len(total) / (len(total) - 1) * ((kept - value * total) ** 2).sum()) / total.sum()
    return {"value": float(value), "stderr": float(max(spread, 1 / total.sum()))}
