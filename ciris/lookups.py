"""Compiled loops that look a motion up in the cells of a free set (ciris.free_set).

A motion is straight in q, from ``x`` to ``y`` while t goes from 0 to 1; at a configuration, x is y. A tree is walked with a range of t: at
a cut, each part gets the range in which the motion is on its side, or nearer to the cut than a tolerance. The tolerance is far above
rounding errors, so a walk visits every cell that the motion meets.

An oblique cut is a half-space {s: normal . s <= cut}. What is in the half-space is proved; what is not is in the upper part. Oblique cuts
have the tolerance already (certifier.map.free_set).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PROVED, OPEN = -1, -2
"""In the place of a node, these are leaves: a cell with a proof, and one without."""
OBLIQUE = 127
"""In the place of a joint, this is an oblique cut."""

NODE = np.dtype([("cut", np.float64), ("upper", np.int32), ("joint", np.int16), ("lower", np.int16)])
"""A cut of a tree, in one piece, because a step down a large tree takes as long as the memory does.

``joint`` is cut at ``cut``, in q. ``upper`` is the node of the upper part, or a leaf. The lower part's node follows, where ``lower`` is no
leaf. Of an oblique cut, ``upper`` is the row of its normal, ``cut`` is in s, and ``lower`` and the node that follows are its upper part.
"""

DEPTH = 512
"""Trees are not deeper than this; ciris.free_set refuses others."""

TOGETHER = 256
"""This many configurations are looked up together. What a tree says of each is kept meanwhile: several clauses have the same trees."""
UNKNOWN, NEAR = 0, 10
"""Of a configuration that was not looked up in a tree yet; NEAR is added to the leaf of one that is near a cut."""
ROOM = 64
"""There is room for this many ranges at first."""
HALVINGS, CLOSE = 16, 1e-4
"""Where a motion passes an oblique cut is known up to this part of the motion, or to this many halvings of it."""


class Cells(NamedTuple):
    """The trees of a free set.

    Attributes:
        nodes: of all trees.
        root: (T,) int32, the first node of each tree, or a leaf.
        first: (K + 1,) int32, where the trees of each clause begin in ``tree``.
        tree: int32, the trees of all clauses. A clause holds where one of its trees has a proved cell.
        normals: (O, n) of the oblique cuts.
        spans: (O, 2) int32, the first joint for which a normal is not 0, and the one behind the last.
        q_star: (n,) the positions at which s is 0.
        revolute: (n,) True where s = tan((q - q*) / 2), False where s = q - q*.
        q_lower, q_upper: (n,) the joint limits.
        tolerance: (n,) of each joint.
    """

    nodes: NDArray[np.void]
    root: NDArray[np.int32]
    first: NDArray[np.int32]
    tree: NDArray[np.int32]
    normals: Floats
    spans: NDArray[np.int32]
    q_star: Floats
    revolute: NDArray[np.bool_]
    q_lower: Floats
    q_upper: Floats
    tolerance: Floats


def nodes_of(joint: NDArray[np.int16], cut: Floats, upper: NDArray[np.int32]) -> tuple[NDArray[np.void], NDArray[np.int32]]:
    """Returns the cuts of trees, of type NODE, and for each given node which of these it is, or which leaf.

    Args:
        joint: for each node, in preorder, the joint that is cut, or OBLIQUE, or PROVED, or OPEN.
        cut: where, in q; of oblique cuts, in s.
        upper: the node of the upper part.
    """
    inner = np.flatnonzero(joint >= 0)
    number = joint.astype(np.int32)
    number[inner] = np.arange(len(inner))
    nodes = np.zeros(len(inner), NODE)
    nodes["cut"], nodes["joint"], nodes["upper"] = cut[inner], joint[inner], number[upper[inner]]
    nodes["lower"] = np.minimum(number[inner + 1], 0)
    oblique = np.flatnonzero(nodes["joint"] == OBLIQUE)
    nodes["lower"][oblique], nodes["upper"][oblique] = np.minimum(nodes["upper"][oblique], 0), np.arange(len(oblique))
    return nodes, number


def spans_of(normals: Floats) -> NDArray[np.int32]:
    """Returns the first joint for which each normal is not 0, and the one behind the last, (O, 2)."""
    O, n = normals.shape
    if not O:
        return np.zeros((0, 2), np.int32)
    moved = normals != 0
    first, behind = moved.argmax(axis=1), n - moved[:, ::-1].argmax(axis=1)
    return np.where(moved.any(axis=1)[:, None], np.stack([first, behind], axis=1), 0).astype(np.int32)


@njit(cache=True, nogil=True)
def points(cells: Cells, X: Floats, found: NDArray[np.bool_]) -> None:
    """Fills in which configurations (m, n) are within the joint limits and free."""
    for begin in range(0, len(X), TOGETHER):
        _points(cells, X[begin : begin + TOGETHER], found[begin : begin + TOGETHER])


@njit(cache=True)
def _points(cells: Cells, X: Floats, found: NDArray[np.bool_]) -> None:
    """Does so for a few configurations. All are looked up in one tree after the other, which stays in the cache, and once in each tree."""
    nodes, tolerance, stack, room = cells.nodes, cells.tolerance, _stack(), np.empty((2, ROOM, 2))
    known = np.full((len(cells.root), len(X)), UNKNOWN, np.int8)
    left, count, S = np.empty(len(X), np.int64), 0, np.empty(X.shape)
    for i in range(len(X)):
        left[count] = i
        count += _within(cells, X[i])
        if len(cells.normals):
            fill_s(cells, X[i], X[i], 0.0, S[i])
    for clause in range(len(cells.first) - 1):
        begin, end, n = cells.first[clause], cells.first[clause + 1], 0
        for place in range(count):
            i, leaf, near = left[place], OPEN, False
            for number in range(begin, end):
                if leaf == OPEN:
                    tree = cells.tree[number]
                    leaf = known[tree, i]
                    if leaf == UNKNOWN:
                        leaf = known[tree, i] = _leaf(cells, nodes, tolerance, cells.root[tree], X[i], S[i])
                    if leaf > 0:
                        leaf, near = leaf - NEAR, True
            if near:
                open_parts = _open_in_clause(cells, clause, X[i], X[i], True, stack, room[0], room[1])[1]
                leaf = PROVED if open_parts == 0 else OPEN
            left[n] = i
            n += leaf == PROVED
        count = n
    found[:] = False
    for place in range(count):
        found[left[place]] = True


@njit(cache=True)
def _leaf(cells: Cells, nodes: NDArray[np.void], tolerance: Floats, root: int, x: Floats, s: Floats) -> int:
    """Returns the leaf of a tree that a configuration is in, and adds NEAR where it is nearer to a cut of a joint than the tolerance."""
    node, near = root, False
    while node >= 0:
        at = nodes[node]
        if at.joint == OBLIQUE:
            if along(cells, at.upper, s) <= at.cut:
                return PROVED + NEAR * near
            node = lower_part(nodes, node)
            continue
        beyond = x[at.joint] - at.cut
        near = near | (abs(beyond) <= tolerance[at.joint])
        node = at.upper if beyond > 0 else lower_part(nodes, node)
    return node + NEAR * near


@njit(cache=True)
def along(cells: Cells, row: int, s: Floats) -> float:
    """Returns where a configuration is along the normal of an oblique cut."""
    t = 0.0
    for j in range(cells.spans[row, 0], cells.spans[row, 1]):
        t += cells.normals[row, j] * s[j]
    return t


@njit(cache=True)
def fill_s(cells: Cells, x: Floats, y: Floats, t: float, s: Floats) -> None:
    """Fills in where a motion is at t, in s."""
    for j in range(len(s)):
        s[j] = in_s(cells, j, x[j] + t * (y[j] - x[j]))


@njit(cache=True)
def in_s(cells: Cells, j: int, q: float) -> float:
    """Returns a position of a joint in s."""
    offset = q - cells.q_star[j]
    return np.tan(offset / 2) if cells.revolute[j] else offset


@njit(cache=True)
def lower_part(nodes: NDArray[np.void], node: int) -> int:
    """Returns the node of the lower part."""
    leaf = nodes[node].lower
    return leaf if leaf < 0 else node + 1


@njit(cache=True, nogil=True)
def motions(cells: Cells, X: Floats, Y: Floats, found: NDArray[np.bool_]) -> None:
    """Fills in which motions, from (m, n) to (m, n), are within the joint limits and free all along."""
    stack, room = _stack(), np.empty((2, ROOM, 2))
    for i in range(len(X)):
        x, y, holds = X[i], Y[i], _within(cells, X[i]) and _within(cells, Y[i])
        for clause in range(len(cells.first) - 1):
            if not holds:
                break
            first, last = cells.first[clause], cells.first[clause + 1] - 1
            holds = _open_in_tree(cells, cells.root[cells.tree[first]], x, y, 0.0, 1.0, True, stack, room[0], 0) == 0
            if not holds and first < last:  # several trees may prove one part each
                holds = _open_in_clause(cells, clause, x, y, True, stack, room[0], room[1])[1] == 0
        found[i] = holds


@njit(cache=True)
def _within(cells: Cells, x: Floats) -> bool:
    inside = True
    for j in range(len(x)):
        inside &= cells.q_lower[j] <= x[j] <= cells.q_upper[j]
    return inside


@njit(cache=True, nogil=True)
def open_ranges(cells: Cells, x: Floats, y: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Returns the ranges of t, (k, 2), in which no tree of a clause has a proved cell, and the clause of each, (k,).

    Those of one clause may overlap.
    """
    stack, ranges, others = _stack(), np.empty((ROOM, 2)), np.empty((ROOM, 2))
    found, clauses, n = np.empty((ROOM, 2)), np.empty(ROOM, np.int64), 0
    for clause in range(len(cells.first) - 1):
        mine, count = _open_in_clause(cells, clause, x, y, False, stack, ranges, others)
        if n + count > len(found):
            before, before_clauses, room = found, clauses, 2 * (n + count)
            found, clauses = np.empty((room, 2)), np.empty(room, np.int64)
            found[:n], clauses[:n] = before[:n], before_clauses[:n]
        found[n : n + count], clauses[n : n + count] = mine[:count], clause
        n += count
    return found[:n].copy(), clauses[:n].copy()


@njit(cache=True)
def _stack() -> tuple[NDArray[np.int32], Floats]:
    """Returns room for the parts of a tree that wait, each a node with its range."""
    return np.empty(DEPTH, np.int32), np.empty((DEPTH, 2))


@njit(cache=True)
def _open_in_clause(
    cells: Cells, clause: int, x: Floats, y: Floats, one: bool, stack: tuple[NDArray[np.int32], Floats], ranges: Floats, others: Floats
) -> tuple[Floats, int]:
    """Returns the ranges of t in which no tree of a clause has a proved cell, and how many there are; at most one if ``one``.

    Args:
        stack: is overwritten.
        ranges, others: (ROOM, 2) are overwritten; larger arrays take their place where there are more ranges.
    """
    ranges[0, 0], ranges[0, 1], count = 0.0, 1.0, 1
    begin, end = cells.first[clause], cells.first[clause + 1]
    for place in range(begin, end):
        root, first, i, n = cells.root[cells.tree[place]], one and place == end - 1, 0, 0
        while i < count and not (n and first):
            a, b = ranges[i]
            more = _open_in_tree(cells, root, x, y, a, b, first, stack, others, n)
            if more > len(others):
                larger = np.empty((2 * len(others), 2))
                larger[: len(others)] = others
                others = larger
            else:
                n, i = more, i + 1
        ranges, others, count = others, ranges, n
        if count == 0:
            break
    return ranges, count


@njit(cache=True)
def _open_in_tree(
    cells: Cells,
    root: int,
    x: Floats,
    y: Floats,
    begin: float,
    end: float,
    first: bool,
    stack: tuple[NDArray[np.int32], Floats],
    found: Floats,
    n: int,
) -> int:
    """Puts the ranges of t in which the motion may be in an open cell of a tree, or the first of them only, behind the first n ranges.

    Returns:
        How many there are now; more than there is room for where there is too little.
    """
    nodes, tolerance, (waiting, spans) = cells.nodes, cells.tolerance, stack
    node, a, b, top = root, begin, end, 0
    while True:
        if node >= 0:
            j, v, upper = nodes[node].joint, nodes[node].cut, nodes[node].upper
            if j == OBLIQUE:
                beyond = _beyond(cells, upper, v, x, y, a, b)
                node = PROVED if beyond[0] > beyond[1] else lower_part(nodes, node)
                if beyond[2] <= beyond[3]:
                    waiting[top], spans[top, 0], spans[top, 1] = node, beyond[2], beyond[3]
                    top += 1
                if node != PROVED:
                    a, b = beyond[0], beyond[1]
                continue
            near = tolerance[j]
            if max(x[j], y[j]) < v - near:  # most cuts are far from all of the motion
                node = lower_part(nodes, node)
                continue
            if min(x[j], y[j]) > v + near:
                node = upper
                continue
            way = y[j] - x[j]
            if way == 0.0:
                waiting[top], spans[top, 0], spans[top, 1] = upper, a, b
                top += 1
                node = lower_part(nodes, node)
                continue
            enters, leaves = (v - near - x[j]) / way, (v + near - x[j]) / way
            ahead, behind = lower_part(nodes, node), upper  # The motion begins in the part ahead.
            if way < 0:
                enters, leaves, ahead, behind = leaves, enters, behind, ahead
            if leaves < a:
                node = behind
            elif enters > b:
                node = ahead
            else:
                waiting[top], spans[top, 0], spans[top, 1] = behind, max(a, enters), b
                top += 1
                node, b = ahead, min(b, leaves)
            continue
        if node == OPEN:
            if n and found[n - 1, 0] <= a <= found[n - 1, 1]:
                found[n - 1, 1] = max(found[n - 1, 1], b)
            elif n == len(found):
                return n + 1
            else:
                found[n, 0], found[n, 1] = a, b
                n += 1
            if first:
                return n
        if top == 0:
            return n
        top -= 1
        node, a, b = waiting[top], spans[top, 0], spans[top, 1]


@njit(cache=True)
def _beyond(cells: Cells, row: int, value: float, x: Floats, y: Floats, begin: float, end: float) -> tuple[float, float, float, float]:
    """Returns where a motion may be beyond an oblique cut: two ranges of t, in order, of which both or the second one may be empty."""
    first, last, bent = _ends(cells, row, value, x, y, begin, end)
    if max(first, last) + bent <= 0:
        return np.inf, -np.inf, np.inf, -np.inf
    if min(first, last) - bent > 0:
        return begin, end, np.inf, -np.inf
    return _passed(cells, row, value, x, y, begin, end)


@njit(cache=True)
def _passed(cells: Cells, row: int, value: float, x: Floats, y: Floats, begin: float, end: float) -> tuple[float, float, float, float]:
    """Does as :func:`_beyond` for a motion that may pass the cut."""
    found = (np.inf, -np.inf, np.inf, -np.inf)
    level, waiting = np.zeros(HALVINGS + 2, np.int64), np.empty((HALVINGS + 2, 2))
    waiting[0, 0], waiting[0, 1], top = begin, end, 1
    while top:
        top -= 1
        a, b, halvings = waiting[top, 0], waiting[top, 1], level[top]
        first, last, bent = _ends(cells, row, value, x, y, a, b)
        if max(first, last) + bent <= 0:
            continue
        if min(first, last) - bent <= 0 and a < b:
            passed = abs(last - first)
            if halvings < HALVINGS and 2 * bent * (b - a) > CLOSE * passed:
                middle = (a + b) / 2
                waiting[top, 0], waiting[top, 1], waiting[top + 1, 0], waiting[top + 1, 1] = middle, b, a, middle
                level[top] = level[top + 1] = halvings + 1
                top += 2
                continue
            if first < last:
                a += max(0.0, -bent - first) / passed * (b - a)
            elif first > last:
                b -= max(0.0, -bent - last) / passed * (b - a)
        if found[0] > found[1]:
            found = a, b, np.inf, -np.inf
        elif found[2] > found[3] and a <= found[1]:
            found = found[0], b, np.inf, -np.inf
        else:
            found = found[0], found[1], min(found[2], a), b
    return found


@njit(cache=True)
def _ends(cells: Cells, row: int, value: float, x: Floats, y: Floats, a: float, b: float) -> tuple[float, float, float]:
    """Returns how far beyond an oblique cut a part of a motion begins and ends, and how far it may be from its chord along the normal.

    In a part, s_j is monotone, and |s_j''| = way_j^2 / 2 |s_j| (1 + s_j^2) is largest at an end. So normal . s is nowhere farther from its
    chord than an eighth of the sum of |normal_j| times these, times the square of the part's length.
    """
    first, last, bent = -value, -value, 0.0
    for j in range(cells.spans[row, 0], cells.spans[row, 1]):
        normal, way = cells.normals[row, j], y[j] - x[j]
        begin, end = in_s(cells, j, x[j] + a * way), in_s(cells, j, x[j] + b * way)
        first += normal * begin
        last += normal * end
        if cells.revolute[j]:
            s = max(abs(begin), abs(end))
            bent += abs(normal) * way**2 / 2 * s * (1 + s * s)
    return first, last, bent * (b - a) ** 2 / 8


@njit(cache=True)
def depth(joint: NDArray[np.int16], upper: NDArray[np.int32]) -> int:
    """Returns how many cuts are above the deepest node. Each node's parts come after it."""
    above, most = np.zeros(len(joint), np.int32), 0
    for node in range(len(joint)):
        if joint[node] >= 0:
            if node + 1 < len(joint):
                above[node + 1] = max(above[node + 1], above[node] + 1)
            above[upper[node]] = max(above[upper[node]], above[node] + 1)
        most = max(most, above[node])
    return most
