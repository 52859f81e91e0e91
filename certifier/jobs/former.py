"""A former region is one of the scene before it changed; it is read here, and what a new region's manifest says of it is written."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any

from certifier.carry.carry import Carry, carry
from certifier.jobs.share import SampledProposal
from certifier.model import Polytope, Scene
from certifier.proof.region import RegionProof


@dataclass(frozen=True, eq=False)
class Former:
    """Says which region is certified again, and what its proof is worth in the new scene.

    Attributes:
        region: its id on the service; None for one of a file.
        proof: the SHA-256 of its proof file.
        scene: the hash of its scene.
    """

    region: str | None
    proof: str
    scene: str
    carried: Carry

    @classmethod
    def of(cls, old: RegionProof, proof: str, scene: Scene, region: str | None = None) -> Former:
        """Compares the scene of a region, with this digest of its proof file, with another scene.

        Raises:
            SceneError: ``other_robot``.
        """
        return cls(region, proof, old.scene.hash, carry(old, scene))

    def document(self, scene: Scene, cut: Collection[int], proposal: SampledProposal, region: Polytope) -> dict[str, Any]:
        """Returns what the provenance of a region says of the one that it comes from.

        Args:
            cut: the pairs of the new scene for which something was cut off.
            proposal: the former region's polytope, sampled.
            region: the part of it that the new region keeps.
        """
        carried = self.carried.proofs.keys()
        return {
            "region": self.region,
            "proof_digest": self.proof,
            "scene": self.scene,
            "kept": proposal.kept(region),
            "carried": _named(scene, (i for i in range(len(scene.pairs)) if i in carried)),
            "proved": _named(scene, (i for i in range(len(scene.pairs)) if i not in carried)),
            "cut": _named(scene, sorted(cut)),
        }


def _named(scene: Scene, pairs: Iterable[int]) -> list[dict[str, str]]:
    return [{"a": pair.a, "b": pair.b} for pair in (scene.pairs[index] for index in pairs)]
