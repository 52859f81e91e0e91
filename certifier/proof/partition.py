"""A pair's proof over a partition of the polytope is held here as data, and is written to and read from its portable file.

A binary tree of cuts s_j = v divides the box of the proof's ground into cells. j is one of the *joints in play*, those between the
frame and the body of any of its volumes. Every leaf of the tree has a plane that is affine in s,

    [a; b](s) = Z [1; s_J],   J the k joints in play, ascending,

in the frame, in metres; or multipliers that show that its cell misses the polytope. For every vertex of either volume, the leaf's cell is
halved into *pieces*. Every piece has multipliers lambda_j >= 0 of the polytope's faces g_j = d_j - C_j s that make

    z0 f - sum_j lambda_j g_j  >  0          (f: the vertex is on its side of the plane; z0 is 1, or 0 where the piece misses the polytope)

visible (certifier.verify.partition says how). Trees are streams in preorder, the lower part first.

A leaf may choose a *coarse volume* in the place of either volume. This is a ball or a capsule, fixed to another body, that contains the
volume's geometries whatever the angles of the joints between this body and theirs are (certifier.verify.coarse). These joints do not move
it, so few cells are enough where the bodies are not close. A volume may have several, from slim to fat.

Nothing here decides whether a proof holds: certifier.verify does. docs/proofs.md describes the file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from certifier.document import Node
from certifier.model import Array, Volume
from certifier.proof import limits
from certifier.proof.container import Arrays
from certifier.proof.separation import Common, Separation, item

PLANE = -1
"""This node of the tree of cuts is a leaf with a plane; this node of a tree of pieces is a piece with z0 = 1."""
EMPTY = -2
"""The cell of this node, or its piece (z0 = 0), misses the polytope."""
OPEN = -3
"""The cell of this node is open: nothing is proved about it. Outlines and maps have such nodes."""
OBLIQUE = 127
"""The cell of this node is cut by a face, a half-space of s, in place of a joint. Maps have such nodes (certifier.proof.map)."""

STREAMS = {
    "nodes": "int8",
    "cuts": "float64",
    "planes": "float64",
    "choices": "int8",
    "pieces": "int8",
    "counts": "int16",
    "faces": "int16",
    "multipliers": "float32",
}
"""The arrays of a proof with their types, in the order of its attributes."""


Coarse = tuple[tuple[Volume, ...], tuple[Volume, ...]]
"""The coarse volumes of the first volume and of the second one."""


def choices_of(volumes: tuple[Volume, Volume], coarse: Coarse) -> list[tuple[Volume, Volume]]:
    """Returns the two volumes that a leaf's plane separates, by the leaf's choice; ``coarse`` is as in the proof."""
    firsts, seconds = ((volume, *others) for volume, others in zip(volumes, coarse, strict=True))
    return [(a, b) for b in seconds for a in firsts]


@dataclass(frozen=True)
class PartitionProof(Separation):
    """Holds planes that separate two volumes on the cells of a partition, with the multipliers that prove it.

    Attributes:
        coarse: the coarse volumes for the first volume and those for the second; their geometries are those of the volume.
        nodes: int8, the tree of cuts: the position index of the joint that is cut, or PLANE, or EMPTY.
        cuts: where each cut is, in s, in the order of the nodes.
        planes: (leaves with a plane, 5, 1 + k), the four rows of Z of each and then kappa, in the order of the nodes. kappa is affine in s
            as well, and bounds |a| on the cell; it counts where a radius is positive.
        choices: int8, of each leaf with a plane: i + (1 + len(coarse[0])) j. The plane separates the first volume, or ``coarse[0][i - 1]``
            for i > 0, from the second, or ``coarse[1][j - 1]`` for j > 0.
        pieces: int8, the trees of pieces: for every leaf with a plane, for either volume chosen, for every vertex in order. An axis that
            is halved is numbered: first the joints between the frame and the volume's body, ascending, then the others in play, ascending.
        counts: int16, the number of multipliers of every piece and of every EMPTY node, in the order of the nodes.
        faces: int16, the face of every multiplier, a row of the ground's C.
        multipliers: float32, the multipliers themselves.
    """

    KIND: ClassVar[str] = "partition"
    NODES: ClassVar[tuple[int, ...]] = (PLANE, EMPTY)
    HEADER: ClassVar[tuple[str, ...]] = ("coarse",)

    coarse: Coarse
    nodes: np.ndarray
    cuts: Array
    planes: Array
    choices: np.ndarray
    pieces: np.ndarray
    counts: np.ndarray
    faces: np.ndarray
    multipliers: np.ndarray

    @property
    def all_volumes(self) -> tuple[Volume, ...]:
        return (*self.volumes, *self.coarse[0], *self.coarse[1])

    @property
    def chosen(self) -> list[tuple[Volume, Volume]]:
        """Returns the two volumes that a leaf's plane separates, by the leaf's choice."""
        return choices_of(self.volumes, self.coarse)

    def own(self, number: Callable[[Volume], int]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        coarse = [[number(volume) for volume in volumes] for volumes in self.coarse]
        return {"coarse": coarse}, {name: getattr(self, name) for name in STREAMS}

    @classmethod
    def read(cls, common: Common, header: dict[str, Node], volumes: Sequence[Volume], arrays: Arrays, prefix: str) -> Self:
        first, second = (tuple(item(node, volumes) for node in side.items(limits.COARSE)) for side in header["coarse"].two())
        return cls(*common, (first, second), *(arrays.take(f"{prefix}/{name}", kind) for name, kind in STREAMS.items()))
