"""The verifier checks the map of a scene exactly here (certifier.proof.map).

In every cell that has a plane, the volumes are apart at all configurations within the joint limits. What a map says of its pair's own
scene holds in the whole scene as well: the same bodies hang on the same joints (certifier.proof.sub_scene).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.errors import ProofError
from certifier.model import NO_PAIRS, Scene
from certifier.proof.map import MapProof
from certifier.proof.partition import PLANE
from certifier.verify.conditions import conditions
from certifier.verify.paddings import paddings
from certifier.verify.pair import check_ground, check_interior
from certifier.verify.scene import check_scene, following
from certifier.verify.separations import Progress, statements
from certifier.verify.uncovered import not_covered
from certifier.verify.volume import check_contained
from certifier.words import counted


@dataclass(frozen=True)
class MapStatement:
    """States what a valid map proves.

    Attributes:
        cells: how many cells have a plane.
        missing: how many pairs of the scene have no map, so that no configuration is proved to be free.
    """

    scene: Scene
    cells: int
    missing: int

    def lines(self) -> list[str]:
        """Returns the statement in plain words."""
        scene = self.scene
        pairs, of_bodies = len(scene.pairs), counted(len(scene.body_pairs), "pair")
        cells = counted(self.cells, "cell")
        free = (
            f"{self.missing} of {pairs} pairs {'has' if self.missing == 1 else 'have'} no cells: no configuration is proved to be free"
            if self.missing
            else NO_PAIRS
            if not scene.body_pairs
            else f"{of_bodies} of bodies; a configuration is free of collision if it is in a cell of each of them"
        )
        return [
            f"scene of hash {scene.hash}",
            *following(scene),
            f"a map of {cells} of the joint space within the joint limits; in each of them, a pair of bodies is apart",
            free,
            *([] if self.missing else [f"there, {line}" for line in conditions(scene)]),
            *paddings(scene),
            *not_covered(scene),
            "guarantee: exact (rigorous arithmetic; the parsed model taken at its word)",
        ]


def verify_map(data: bytes, processes: int = 1, progress: Progress | None = None) -> MapStatement:
    """Checks a map's file and returns what it proves.

    Args:
        processes: how many processes check the cells.
        progress: receives how many of how many cells they have checked.

    Raises:
        ProofError: the file is malformed or a cell does not hold.
    """
    proof = MapProof.from_bytes(data, check_scene)
    scene = proof.scene
    check_contained(*((part.scene, part.all_volumes) for part in proof.maps))
    for pairs, part in zip(proof.pairs, proof.maps, strict=True):
        check_scene(part.scene)
        check_ground(part.scene, part.ground)
        check_interior(part.scene, part.ground, part.interior)
        if part.ground.d.size:
            raise ProofError("proof_ground", "a tree of a map is about a polytope with faces of its own, not about all of the joint limits")
        if part.pairs != part.scene.pairs or len(part.pairs) != len(set(pairs)):
            raise ProofError(
                "proof_pairs", f"the volumes of a map do not stand for its pairs, the first of which is {pairs[0].a} and {pairs[0].b}"
            )
    statements(None, proof.maps, processes, progress)
    covered = {pair for pairs, part in zip(proof.pairs, proof.maps, strict=True) for pair in pairs if (part.nodes == PLANE).any()}
    cells = sum(int(np.count_nonzero(part.nodes == PLANE)) for part in proof.maps)
    return MapStatement(scene, cells, len(scene.pairs) - len(covered))
