"""A search leaves subtrees: what has become of the cells that it was given. Later searches go on with their open cells.

The first search of a pair is given one cell, the root. What it leaves open is dealt out to the *parts* of the next round, a cell to each in
turn, and so on. When no cell is open, the subtrees of all rounds are put together to one tree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from certifier.partition.tree import Node, OpenCell, of_streams
from certifier.proof.container import FORMAT, pack, unpack
from certifier.proof.partition import OPEN, STREAMS

KIND = "subtrees"
_OF_OPEN_CELLS = ("lower", "upper", "levels")
"""These arrays say which cells are open."""
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Subtrees:
    """Holds what one search has left.

    Attributes:
        roots: a tree for each cell that the search was given.
        open_cells: the cells that are open in them, in order.
        faces: how many faces the polytope had, to which the multipliers belong.
    """

    roots: Sequence[Node]
    open_cells: Sequence[OpenCell]
    faces: int

    @classmethod
    def of(cls, given: Sequence[OpenCell], faces: int) -> Subtrees:
        """Returns what a search has left of the cells that it was given."""
        return cls([node for node, _, _ in given], [cell for node, *bounds in given for cell in node.open_cells(*bounds)], faces)

    def to_bytes(self, streams: Mapping[str, np.ndarray]) -> bytes:
        """Returns the subtrees as a file.

        Args:
            streams: what :func:`certifier.partition.tree.to_streams` makes of the roots.
        """
        arrays = {
            "lower": np.array([lower for _, lower, _ in self.open_cells]),
            "upper": np.array([upper for _, _, upper in self.open_cells]),
            "levels": np.array([node.level for node, _, _ in self.open_cells], dtype=np.int8),
            **streams,
        }
        return pack({"format": FORMAT, "kind": KIND, "roots": len(self.roots), "faces": self.faces}, arrays)


def open_cells(files: Sequence[bytes]) -> list[OpenCell]:
    """Returns the cells that the parts of a round have left open, in order, each with a node of its own."""
    found = []
    for data in files:
        arrays = unpack(data, KIND, _OF_OPEN_CELLS.__contains__)[1]
        nodes = (Node(level=level) for level in arrays["levels"].tolist())
        found += [OpenCell(*cell) for cell in zip(nodes, arrays["lower"], arrays["upper"], strict=True)]
    return found


def dealt(cells: Sequence[T], part: int, parts: int) -> Sequence[T]:
    """Returns the cells, or their nodes, that this part of a round gets, when the round has ``parts`` parts."""
    return cells[part::parts]


def put_together(rounds: Sequence[Sequence[bytes]], faces: int, limits: int, vertices: Sequence[int]) -> Node:
    """Returns the tree of a pair from what the parts of all its rounds have left.

    Args:
        faces: how many faces the polytope has now; faces were added since before the last ``limits`` ones.
        vertices: as for :func:`certifier.partition.tree.of_streams`.
    """
    root = Node()
    still_open = [root]
    for files in rounds:
        following: list[Node] = []
        for part, data in enumerate(files):
            for node, grown in zip(dealt(still_open, part, len(files)), _roots(data, faces, limits, vertices), strict=True):
                vars(node).update(vars(grown))
                following += [below for below in node.preorder() if below.kind == OPEN]
        still_open = following
    return root


def _roots(data: bytes, faces: int, limits: int, vertices: Sequence[int]) -> Iterator[Node]:
    """Gives the trees of a file, with the numbers that the polytope's faces have now."""
    header, arrays = unpack(data, KIND)
    added, before = faces - header["faces"], header["faces"] - limits
    moved = np.where(arrays["faces"] >= before, arrays["faces"] + added, arrays["faces"]).astype(STREAMS["faces"])
    yield from of_streams({**arrays, "faces": moved}, vertices, header["roots"])
