"""A pair's proof over a partition of the polytope is held here as data, and is written to and read from its portable file.

A binary tree of cuts s_j = v divides the box of the proof's ground into cells. j is one of the *joints in play*, those between the
frame and either body. Every leaf of the tree has a plane that is affine in s,

    [a; b](s) = Z [1; s_J],   J the k joints in play, ascending,

in the frame, in metres; or multipliers that show that its cell misses the polytope. For every vertex of either volume, the leaf's cell is
halved into *pieces*. Every piece has multipliers lambda_j >= 0 of the polytope's faces g_j = d_j - C_j s that make

    z0 f - sum_j lambda_j g_j  >  0          (f: the vertex is on its side of the plane; z0 is 1, or 0 where the piece misses the polytope)

visible (certifier.verify.partition says how). Trees are streams in preorder, the lower part first.

Nothing here decides whether a proof holds: certifier.verify does. docs/proofs.md describes the file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from certifier.document import Node
from certifier.model import Array
from certifier.proof.container import Arrays
from certifier.proof.separation import Common, Separation

PLANE = -1
"""This node of the tree of cuts is a leaf with a plane; this node of a tree of pieces is a piece with z0 = 1."""
EMPTY = -2
"""The cell of this node, or its piece (z0 = 0), misses the polytope."""

STREAMS = {
    "nodes": "int8",
    "cuts": "float64",
    "planes": "float64",
    "pieces": "int8",
    "counts": "int16",
    "faces": "int16",
    "multipliers": "float32",
}
"""The arrays of a proof with their types, in the order of its attributes."""


@dataclass(frozen=True)
class PartitionProof(Separation):
    """Holds planes that separate two volumes on the cells of a partition, with the multipliers that prove it.

    Attributes:
        nodes: int8, the tree of cuts: the position index of the joint that is cut, or PLANE, or EMPTY.
        cuts: where each cut is, in s, in the order of the nodes.
        planes: (leaves with a plane, 5, 1 + k), the four rows of Z of each and then kappa, in the order of the nodes. kappa is affine in s
            as well, and bounds |a| on the cell; it counts where a radius is positive.
        pieces: int8, the trees of pieces: for every leaf with a plane, for either volume, for every vertex in order. An axis that is
            halved is numbered: first the joints between the frame and the volume's body, ascending, then the others in play, ascending.
        counts: int16, the number of multipliers of every piece and of every EMPTY node, in the order of the nodes.
        faces: int16, the face of every multiplier, a row of the ground's C.
        multipliers: float32, the multipliers themselves.
    """

    KIND: ClassVar[str] = "partition"
    HEADER: ClassVar[tuple[str, ...]] = ()

    nodes: np.ndarray
    cuts: Array
    planes: Array
    pieces: np.ndarray
    counts: np.ndarray
    faces: np.ndarray
    multipliers: np.ndarray

    def own(self) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        return {}, {name: getattr(self, name) for name in STREAMS}

    @classmethod
    def read(cls, common: Common, header: dict[str, Node], arrays: Arrays, prefix: str) -> Self:
        return cls(*common, *(arrays.take(f"{prefix}/{name}", kind) for name, kind in STREAMS.items()))
