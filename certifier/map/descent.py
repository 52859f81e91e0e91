"""Where configurations lie in a tree of cuts: compiled loops over linked nodes."""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array
from certifier.polytopes.simplex import dot
from certifier.proof.partition import OBLIQUE, OPEN, PLANE

FIRST = 1024
"""A tree has room for this many nodes at first."""


class Descent:
    """Holds a tree of cuts to which subtrees are added in the places of open nodes.

    Nodes are numbered in the order in which they were added; the root is 0.

    Attributes:
        kinds: int16, the joint that is cut, or OBLIQUE, or the kind of a leaf.
        values: where it is cut.
        planes: the number of the plane of a leaf that has one; of an oblique cut, the row of its normal.
        children: (N, 2) numbers of the lower and the upper part.
        normals: (O, k) of the oblique cuts, in the order in which they were added.
    """

    def __init__(self, k: int) -> None:
        self.normals = np.zeros((0, k))
        self.kinds = np.full(FIRST, OPEN, np.int16)
        self.values = np.zeros(FIRST)
        self.planes = np.zeros(FIRST, np.int32)
        self.children = np.zeros((FIRST, 2), np.int32)
        self.size, self.held = 1, 0

    def add(self, places: Array, nodes: Array, cuts: Array, normals: Array) -> Array:
        """Puts trees in the places of open nodes, and returns the numbers of their own open nodes, in preorder.

        Args:
            places: numbers of open nodes, one for each tree.
            nodes, cuts, normals: the trees, one after the other, as a proof holds them (certifier.proof.partition).
        """
        needed = self.size + len(nodes)
        if needed > len(self.kinds):
            room = max(needed, 2 * len(self.kinds)) - len(self.kinds)
            self.kinds = np.concatenate([self.kinds, np.full(room, OPEN, np.int16)])
            self.values = np.concatenate([self.values, np.zeros(room)])
            self.planes = np.concatenate([self.planes, np.zeros(room, np.int32)])
            self.children = np.concatenate([self.children, np.zeros((room, 2), np.int32)])
        arrays, held = (self.kinds, self.values, self.planes, self.children), (self.held, len(self.normals))
        self.size, self.held, opened = _add(*arrays, self.size, *held, places, nodes, cuts)
        self.normals = np.concatenate([self.normals, normals])
        return opened

    def in_order(self) -> tuple[Array, Array, Array, Array]:
        """Returns the tree as a proof has it: nodes, cuts, the normals, and the numbers of the planes in their order."""
        nodes, cuts, numbers = preorder(self.kinds, self.values, self.children, self.size, 1)
        return nodes, cuts, self.normals[self.planes[numbers[nodes == OBLIQUE]]], self.planes[numbers[nodes == PLANE]]

    def boxes(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Returns the bounds of the open nodes, in preorder, (C, k) each, where the root has these, (k,) each."""
        return boxes(self.kinds, self.values, self.children, lower, upper)

    def leaves(self, X: Array) -> Array:
        """Returns the numbers of the leaves that points lie in, (N,); a point on a cut is in the lower part.

        Args:
            X: (N, k) of the joints of the tree.
        """
        return locate(self.kinds, self.values, self.planes, self.children, self.normals, X)


@njit(cache=True)
def locate(kinds: Array, values: Array, planes: Array, children: Array, normals: Array, X: Array) -> Array:
    found = np.empty(len(X), np.int32)
    for i in range(len(X)):
        node = 0
        while kinds[node] >= 0:
            at = dot(normals[planes[node]], X[i]) if kinds[node] == OBLIQUE else X[i, kinds[node]]
            node = children[node, 0 if at <= values[node] else 1]
        found[i] = node
    return found


@njit(cache=True)
def _add(
    kinds: Array,
    values: Array,
    planes: Array,
    children: Array,
    size: int,
    held: int,
    faces: int,
    places: Array,
    nodes: Array,
    cuts: Array,
) -> tuple[int, int, Array]:
    opened = np.empty(len(nodes), np.int64)
    waiting = np.empty(len(nodes) + 1, np.int64)
    tree, cut, many, depth = 0, 0, 0, 0
    for i in range(len(nodes)):
        if depth == 0:
            node = places[tree]
            tree += 1
        else:
            depth -= 1
            node = waiting[depth]
        kinds[node] = nodes[i]
        if nodes[i] >= 0:
            values[node] = cuts[cut]
            cut += 1
            children[node, 0], children[node, 1] = size, size + 1
            if nodes[i] == OBLIQUE:
                planes[node] = faces
                faces += 1
            waiting[depth], waiting[depth + 1] = size + 1, size
            depth += 2
            size += 2
        elif nodes[i] == PLANE:
            planes[node] = held
            held += 1
        else:
            opened[many] = node
            many += 1
    return size, held, opened[:many].copy()


@njit(cache=True)
def preorder(kinds: Array, values: Array, children: Array, size: int, roots: int) -> tuple[Array, Array, Array]:
    """Returns the trees of the first nodes, one after the other, as a proof has them: nodes and cuts, and the number of each node.

    Args:
        size: how many nodes there are.
    """
    nodes, cuts, numbers = np.empty(size, np.int8), np.empty(size), np.empty(size, np.int64)
    waiting, n, c = np.zeros(size + 1, np.int64), 0, 0
    for root in range(roots):
        waiting[0], depth = root, 1
        while depth:
            depth -= 1
            node = waiting[depth]
            nodes[n], numbers[n] = kinds[node], node
            n += 1
            if kinds[node] >= 0:
                cuts[c] = values[node]
                c += 1
                waiting[depth], waiting[depth + 1] = children[node, 1], children[node, 0]
                depth += 2
    return nodes[:n].copy(), cuts[:c].copy(), numbers[:n].copy()


@njit(cache=True)
def in_order(pieces: Array, ends: Array, which: Array) -> Array:
    """Returns the pieces of some planes, in this order; or what else each plane has several of.

    Args:
        ends: where the pieces of each plane end; those of the first one begin at 0.
    """
    total = 0
    for i in which:
        total += ends[i] - (ends[i - 1] if i else 0)
    found, at = np.empty(total, pieces.dtype), 0
    for i in which:
        part = pieces[(ends[i - 1] if i else 0) : ends[i]]
        found[at : at + len(part)] = part
        at += len(part)
    return found


@njit(cache=True)
def boxes(kinds: Array, values: Array, children: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Returns the bounds of the open leaves of a tree, in preorder, (C, k) each.

    Args:
        lower, upper: (k,) the bounds of the root.
    """
    lowers, uppers, waiting = [lower], [upper], [0]
    found_lower, found_upper = [lower], [upper]
    while len(waiting):
        node, low, high = waiting.pop(), lowers.pop(), uppers.pop()
        joint = kinds[node]
        if joint >= 0:
            below, above = high.copy(), low.copy()
            if joint != OBLIQUE:  # both parts of an oblique cut are taken to be the whole cell
                below[joint] = above[joint] = values[node]
            waiting.extend([children[node, 1], children[node, 0]])
            lowers.extend([above, low])
            uppers.extend([high, below])
        elif joint == OPEN:
            found_lower.append(low)
            found_upper.append(high)
    many = len(found_lower) - 1
    all_lower, all_upper = np.empty((many, len(lower))), np.empty((many, len(lower)))
    for i in range(many):
        all_lower[i], all_upper[i] = found_lower[i + 1], found_upper[i + 1]
    return all_lower, all_upper


@njit(cache=True)
def lengths_of(pieces: Array, counts: Array, vertices: Array) -> Array:
    """Returns how many nodes of pieces, pieces, and multipliers each plane has, (P, 3).

    Args:
        pieces, counts: a tree for each vertex of each plane, one after the other, and the number of multipliers of each piece.
        vertices: (P,) how many vertices each plane separates.
    """
    found, at, piece = np.zeros((len(vertices), 3), np.int64), 0, 0
    for plane in range(len(vertices)):
        for _ in range(vertices[plane]):
            left = 1
            while left:
                left += 1 if pieces[at] >= 0 else -1
                found[plane, 0] += 1
                if pieces[at] < 0:
                    found[plane, 1] += 1
                    found[plane, 2] += counts[piece]
                    piece += 1
                at += 1
    return found
