"""Compiled loops that look a motion up in the cells of a free set (ciris.free_set).

A motion is straight in q, from ``x`` on, by ``dx`` while t goes from 0 to 1; a configuration is a motion by 0. A tree is walked with a
range of t: at a cut, each part gets the range in which the motion is on its side, or nearer to the cut than a tolerance. The tolerance is
far above rounding errors, so a walk visits every cell that the motion meets.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PROVED, OPEN = -1, -2
"""These nodes of a tree are leaves: a cell with a proof, and one without."""

DEPTH = 512
"""Trees are not deeper than this; ciris.free_set refuses others."""

ROOM = 64
"""There is room for this many ranges at first."""


class Cells(NamedTuple):
    """The trees of a free set.

    Attributes:
        joint: (N,) int16, for each node the joint that is cut, or PROVED, or OPEN. The lower part's node follows.
        cut: (N,) where, in q.
        upper: (N,) int32, the node of the upper part.
        root: (T,) int32, the first node of each tree.
        first: (K + 1,) int32, where the trees of each clause begin in ``tree``.
        tree: int32, the trees of all clauses. A clause holds where one of its trees has a proved cell.
        tolerance: (n,) of each joint.
    """

    joint: NDArray[np.int16]
    cut: Floats
    upper: NDArray[np.int32]
    root: NDArray[np.int32]
    first: NDArray[np.int32]
    tree: NDArray[np.int32]
    tolerance: Floats


@njit(cache=True, nogil=True)
def points(cells: Cells, X: Floats, found: NDArray[np.bool_]) -> None:
    """Fills in which configurations (m, n) are free. All of them are looked up in one tree after the other, which stays in the cache."""
    stack, room, still = _stack(), np.empty((2, ROOM, 2)), np.zeros(X.shape[1])
    left, count = np.arange(len(X)), len(X)
    for clause in range(len(cells.first) - 1):
        begin, end, n = cells.first[clause], cells.first[clause + 1], 0
        for place in range(count):
            i, leaf, near = left[place], OPEN, False
            for number in range(begin, end):
                if leaf == OPEN:
                    leaf, close = _leaf(cells, cells.root[cells.tree[number]], X[i])
                    near = near or close
            if near:
                open_parts = _open_in_clause(cells, clause, X[i], still, True, stack, room[0], room[1])[1]
                leaf = PROVED if open_parts == 0 else OPEN
            left[n] = i
            n += leaf == PROVED
        count = n
    found[:] = False
    for place in range(count):
        found[left[place]] = True


@njit(cache=True)
def _leaf(cells: Cells, root: int, x: Floats) -> tuple[int, bool]:
    """Returns the leaf of a tree that a configuration is in, and whether it is nearer to a cut than the tolerance."""
    joint, cut, upper, tolerance = cells.joint, cells.cut, cells.upper, cells.tolerance
    node, near = root, False
    j = joint[node]
    while j >= 0:
        beyond = x[j] - cut[node]
        near = near | (abs(beyond) <= tolerance[j])
        node = upper[node] if beyond > 0 else node + 1
        j = joint[node]
    return j, near


@njit(cache=True, nogil=True)
def motions(cells: Cells, X: Floats, dX: Floats, found: NDArray[np.bool_]) -> None:
    """Fills in which motions (m, n) are free all along."""
    stack, room, clauses = _stack(), np.empty((2, ROOM, 2)), len(cells.first) - 1
    for i in range(len(X)):
        x, dx, clause = X[i], dX[i], 0
        while clause < clauses and _open_in_clause(cells, clause, x, dx, True, stack, room[0], room[1])[1] == 0:
            clause += 1
        found[i] = clause == clauses


@njit(cache=True)
def open_ranges(cells: Cells, clause: int, x: Floats, dx: Floats) -> Floats:
    """Returns the ranges of t, (k, 2), in which no tree of a clause has a proved cell. They may overlap."""
    ranges, count = _open_in_clause(cells, clause, x, dx, False, _stack(), np.empty((ROOM, 2)), np.empty((ROOM, 2)))
    return ranges[:count].copy()


@njit(cache=True)
def _stack() -> tuple[NDArray[np.int32], Floats]:
    """Returns room for the parts of a tree that wait, each a node with its range."""
    return np.empty(DEPTH, np.int32), np.empty((DEPTH, 2))


@njit(cache=True)
def _open_in_clause(
    cells: Cells, clause: int, x: Floats, dx: Floats, one: bool, stack: tuple[NDArray[np.int32], Floats], ranges: Floats, others: Floats
) -> tuple[Floats, int]:
    """Returns the ranges of t in which no tree of a clause has a proved cell, and how many there are; at most one if ``one``.

    Args:
        stack: is overwritten.
        ranges, others: (ROOM, 2) are overwritten; larger arrays take their place where there are more ranges.
    """
    ranges[0, 0], ranges[0, 1], count = 0.0, 1.0, 1
    begin, end = cells.first[clause], cells.first[clause + 1]
    for place in range(begin, end):
        root, first, n = cells.root[cells.tree[place]], one and place == end - 1, 0
        for i in range(count):
            others, n = _open_in_tree(cells, root, x, dx, ranges[i, 0], ranges[i, 1], first, stack, others, n)
            if n and first:
                break
        ranges, others, count = others, ranges, n
        if count == 0:
            break
    return ranges, count


@njit(cache=True)
def _open_in_tree(
    cells: Cells,
    root: int,
    x: Floats,
    dx: Floats,
    begin: float,
    end: float,
    first: bool,
    stack: tuple[NDArray[np.int32], Floats],
    found: Floats,
    n: int,
) -> tuple[Floats, int]:
    """Appends the ranges of t in which the motion may be in an open cell of a tree, or the first of them only."""
    joint, cut, upper, tolerance = cells.joint, cells.cut, cells.upper, cells.tolerance
    nodes, spans = stack
    node, a, b, top = root, begin, end, 0
    while True:
        j = joint[node]
        if j >= 0:
            v, near = cut[node], tolerance[j]
            if dx[j] == 0.0:
                low = x[j] <= v + near
                if low and x[j] >= v - near:
                    nodes[top], spans[top, 0], spans[top, 1] = upper[node], a, b
                    top += 1
                node = node + 1 if low else upper[node]
                continue
            enters, leaves = (v - near - x[j]) / dx[j], (v + near - x[j]) / dx[j]
            ahead, behind = node + 1, upper[node]  # The motion begins in the part ahead.
            if dx[j] < 0:
                enters, leaves, ahead, behind = leaves, enters, behind, ahead
            if leaves < a:
                node = behind
            elif enters > b:
                node = ahead
            else:
                nodes[top], spans[top, 0], spans[top, 1] = behind, max(a, enters), b
                top += 1
                node, b = ahead, min(b, leaves)
            continue
        if j == OPEN:
            if n and found[n - 1, 0] <= a <= found[n - 1, 1]:
                found[n - 1, 1] = max(found[n - 1, 1], b)
            else:
                if n == len(found):
                    more = np.empty((2 * n, 2))
                    more[:n] = found
                    found = more
                found[n, 0], found[n, 1] = a, b
                n += 1
            if first:
                return found, n
        if top == 0:
            return found, n
        top -= 1
        node, a, b = nodes[top], spans[top, 0], spans[top, 1]


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
