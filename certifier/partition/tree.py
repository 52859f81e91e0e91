"""The tree of a partition: cuts, and below them cells that have a plane, that miss the polytope, or that are open still."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from certifier.model import Array
from certifier.proof.partition import EMPTY, OPEN, PLANE, STREAMS

ALL = 127
"""Sentinel: more levels than there are."""


@dataclass(frozen=True, eq=False)
class Streams:
    """Holds pieces or multipliers as :class:`certifier.proof.partition.PartitionProof` does."""

    pieces: np.ndarray
    counts: np.ndarray
    faces: np.ndarray
    multipliers: np.ndarray


@dataclass(eq=False)
class Node:
    """A node is a cell and its state; a search changes open nodes.

    Attributes:
        kind: the joint that is cut, or PLANE, EMPTY or OPEN.
        value: where it is cut, in s.
        children: the lower and the upper part of a cell that is cut.
        plane: (5, 1 + k) of a cell with a plane, as a proof holds it.
        choice: which volumes the plane separates, as a proof says it.
        streams: the pieces and multipliers of a cell with a plane, or the multipliers of one that misses the polytope.
        level: how many levels of volumes, the finest ones, are to be tried in this cell.
    """

    kind: int = OPEN
    value: float = 0.0
    children: tuple[Node, ...] = ()
    plane: Array | None = None
    choice: int = 0
    streams: Streams | None = None
    level: int = ALL

    def preorder(self) -> Iterator[Node]:
        """Gives the nodes, each before its children, the lower part first."""
        waiting = [self]
        while waiting:
            node = waiting.pop()
            yield node
            waiting += reversed(node.children)

    def open_cells(self, lower: Array, upper: Array) -> list[OpenCell]:
        """Returns the cells of the open nodes, in preorder; the node's own cell is [lower, upper]."""
        found, waiting = [], [(self, lower, upper)]
        while waiting:
            node, low, high = waiting.pop()
            if node.kind == OPEN:
                found.append(OpenCell(node, low, high))
            elif node.children:
                middle_up, middle_low = high.copy(), low.copy()
                middle_up[node.kind] = middle_low[node.kind] = node.value
                waiting += [(node.children[1], middle_low, high), (node.children[0], low, middle_up)]
        return found


class OpenCell(NamedTuple):
    """An open node and the bounds of its cell, (n,) each."""

    node: Node
    lower: Array
    upper: Array


def to_streams(roots: Sequence[Node], k: int) -> dict[str, Any]:
    """Returns trees, one after the other, as the arrays of a proof whose planes move with k joints."""
    nodes = [node for root in roots for node in root.preorder()]
    held = [node.streams for node in nodes if node.streams is not None]
    found = {
        "nodes": [node.kind for node in nodes],
        "cuts": [node.value for node in nodes if node.children],
        "planes": np.array([node.plane for node in nodes if node.plane is not None]).reshape(-1, 5, 1 + k),
        "choices": [node.choice for node in nodes if node.plane is not None],
        **{name: np.concatenate([getattr(part, name) for part in held] or [[]]) for name in ("pieces", "counts", "faces", "multipliers")},
    }
    return {name: np.asarray(found[name], dtype=kind) for name, kind in STREAMS.items()}


def of_streams(arrays: Mapping[str, np.ndarray], vertices: Sequence[int], count: int) -> list[Node]:
    """Does the inverse of :func:`to_streams` for ``count`` trees.

    Args:
        vertices: the number of vertices of both volumes together, by choice.
    """
    reader = _Reader(arrays, vertices)
    return [reader.node() for _ in range(count)]


class _Reader:
    def __init__(self, arrays: Mapping[str, np.ndarray], vertices: Sequence[int]) -> None:
        self._vertices = vertices
        self._nodes, self._cuts, self._planes = iter(arrays["nodes"].tolist()), iter(arrays["cuts"].tolist()), iter(arrays["planes"])
        self._choices = iter(arrays["choices"].tolist())
        self._pieces, self._counts = arrays["pieces"], arrays["counts"]
        self._faces, self._multipliers = arrays["faces"], arrays["multipliers"]
        self._at = [0, 0, 0]

    def node(self) -> Node:
        """Reads a node with all below it."""
        root = Node()
        waiting = [root]
        while waiting:
            node = waiting.pop()
            node.kind = next(self._nodes)
            if node.kind >= 0:
                node.value, node.children = next(self._cuts), (Node(), Node())
                waiting += reversed(node.children)
            elif node.kind == PLANE:
                node.plane, node.choice = next(self._planes), next(self._choices)
                node.streams = self._take(self._trees(self._vertices[node.choice]))
            elif node.kind == EMPTY:
                node.streams = self._take((0, 1))
        return root

    def _trees(self, vertices: int) -> tuple[int, int]:
        """Returns how many codes and how many leaves the trees of pieces of the next leaf have, which has this many vertices."""
        begin = at = self._at[0]
        leaves = 0
        for _ in range(vertices):
            left = 1
            while left:
                split = self._pieces[at] >= 0
                leaves += not split
                left += 1 if split else -1
                at += 1
        return at - begin, leaves

    def _take(self, lengths: tuple[int, int]) -> Streams:
        codes, leaves = lengths
        a, b, c = self._at
        counts = self._counts[b : b + leaves]
        end = c + int(counts.sum(dtype=np.int64))
        self._at = [a + codes, b + leaves, end]
        return Streams(self._pieces[a : a + codes], counts, self._faces[c:end], self._multipliers[c:end])


def joined(parts: Sequence[Streams]) -> Streams:
    """Returns streams one after the other."""
    return Streams(*(np.concatenate([getattr(part, name) for part in parts] or [[]]) for name in Streams.__annotations__))
