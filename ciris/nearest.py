"""A compiled search for the configuration of a free set (ciris.free_set) that is nearest to another one. Distances are those of s.

What is not free is a union of boxes in q: the open cells, with a margin around them. What oblique cuts prove of them counts as open, too.
The search holds boxes about which it knows nothing, and takes the one whose nearest configuration is nearest of all. This configuration is
free, or it is in an open cell. Then the box without this cell is divided into others.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ciris.lookups import DEPTH, OBLIQUE, OPEN, Cells, Floats, lower_part

MARGIN = 2.0
"""The answer is this many tolerances away from open cells and from the joint limits, so that rounding leaves it free."""
PLUNGE = 64
"""After each such number of boxes, and until something is found, the search goes on with the nearest part of the same box. So an early end
has found something."""
ROOM = 256
"""There is room for this many boxes at first."""


class Aim(NamedTuple):
    """What to be near to.

    Attributes:
        q, s: (n,) the configuration.
        q_star: (n,) the positions at which s is 0.
        revolute: (n,) True where s = tan((q - q*) / 2), False where s = q - q*.
    """

    q: Floats
    s: Floats
    q_star: Floats
    revolute: NDArray[np.bool_]


@njit(cache=True, nogil=True)
def nearest(cells: Cells, aim: Aim, closer_than: float, most: int, found: Floats) -> tuple[float, int, bool]:
    """Fills in the free configuration that is nearest, (n,).

    Args:
        closer_than: only what is closer than this counts, in s.
        most: the search ends after about this many boxes.

    Returns:
        The distance, ``closer_than`` if nothing was found; the number of boxes; whether it is certain that nothing is closer.
    """
    n, best, looked, plunging = len(found), closer_than, 0, False
    boxes, used, margin = np.empty((ROOM, 2, n)), 1, MARGIN * cells.tolerance
    box, x, gap, cell, keys = np.empty((2, n)), np.empty(n), np.empty(n), np.empty((2, n)), np.empty((2, n))
    room = np.empty(DEPTH, np.int32), np.empty((DEPTH, 2, n)), np.empty((3, 2, n))
    for j in range(n):
        inwards = min(margin[j], (cells.q_upper[j] - cells.q_lower[j]) / 2)
        boxes[0, 0, j], boxes[0, 1, j] = cells.q_lower[j] + inwards, cells.q_upper[j] - inwards
    waiting = [(0.0, 0)]
    while plunging or len(waiting):
        if not plunging:
            if waiting[0][0] >= best:
                break
            if looked >= most:
                return best, looked, False
            box[:] = boxes[heapq.heappop(waiting)[1]]
        looked += 1
        square = 0.0
        for j in range(n):
            x[j] = min(max(aim.q[j], box[0, j]), box[1, j])
            gap[j] = _gap(aim, j, x[j]) if x[j] != aim.q[j] else 0.0
            square += gap[j] ** 2
        left = _cell_at(cells, aim, margin, box, x, gap, cell, keys, room)
        plunging = left > 0 and (plunging or looked % PLUNGE == 1 or best == closer_than)
        if left < 0 and square < best**2:
            best, found[:] = np.sqrt(square), x
        while left > 0:
            i, j = _farthest(keys)
            key, keys[i, j] = keys[i, j], -1.0
            if plunging and left == 1:
                box[1 - i, j], plunging = cell[i, j], key < best
            else:
                if key < best:
                    if used == len(boxes):
                        before, boxes = boxes, np.empty((2 * used, 2, n))
                        boxes[:used] = before
                    boxes[used] = box
                    boxes[used, 1 - i, j] = cell[i, j]
                    heapq.heappush(waiting, (key, used))
                    used += 1
                box[i, j] = cell[i, j]
            left -= 1
    return best, looked, True


@njit(cache=True)
def _gap(aim: Aim, j: int, x: float) -> float:
    """Returns how far a position of a joint is from that of the aim, in s."""
    offset = x - aim.q_star[j]
    return (np.tan(offset / 2) if aim.revolute[j] else offset) - aim.s[j]


@njit(cache=True)
def _farthest(keys: Floats) -> tuple[int, int]:
    """Returns where the largest number is."""
    side, joint = 0, 0
    for i in range(2):
        for j in range(keys.shape[1]):
            if keys[i, j] > keys[side, joint]:
                side, joint = i, j
    return side, joint


@njit(cache=True)
def _cell_at(
    cells: Cells,
    aim: Aim,
    margin: Floats,
    box: Floats,
    x: Floats,
    gap: Floats,
    cell: Floats,
    keys: Floats,
    room: tuple[NDArray[np.int32], Floats, Floats],
) -> int:
    """Fills in an open cell with its margin in which x is, and returns how many parts the box without it has; -1 if x is in none.

    Of the cells of different clauses it is the one without which the box is farthest away.

    Args:
        x: (n,) the nearest configuration of the box.
        gap: (n,) how far it is, in s.
        cell: (2, n) gets the lower and the upper ends.
        keys: (2, n) gets how far the part of the box is that is beyond each end, in s; -1 where there is none.
        room: is overwritten.
    """
    best, parts, n, square = -1.0, -1, len(x), (gap**2).sum()
    mine, other, far = room[2]
    for clause in range(len(cells.first) - 1):
        mine[0], mine[1], place, end = -np.inf, np.inf, cells.first[clause], cells.first[clause + 1]
        while place < end and _open_at(cells, cells.root[cells.tree[place]], x, other, room[0], room[1]):
            for j in range(n):
                mine[0, j], mine[1, j] = max(mine[0, j], other[0, j]), min(mine[1, j], other[1, j])
            place += 1
        if place < end:
            continue
        least, count = np.inf, 0
        for j in range(n):
            mine[0, j], mine[1, j] = mine[0, j] - margin[j], mine[1, j] + margin[j]
            for i in range(2):
                far[i, j] = -1.0
                if box[0, j] <= mine[i, j] <= box[1, j]:
                    far[i, j] = np.sqrt(max(square - gap[j] ** 2 + _gap(aim, j, mine[i, j]) ** 2, 0.0))
                    least, count = min(least, far[i, j]), count + 1
        if least > best:
            best, parts, cell[:], keys[:] = least, count, mine, far
            if count == 0:
                break
    return parts


@njit(cache=True)
def _open_at(cells: Cells, root: int, x: Floats, found: Floats, waiting: NDArray[np.int32], bounds: Floats) -> bool:
    """Says whether a tree has an open cell within the tolerance of x, and fills in the lower and upper ends of one, (2, n)."""
    node, top = root, 0
    found[0], found[1] = -np.inf, np.inf
    while True:
        if node >= 0:
            j, v, upper = cells.nodes[node].joint, cells.nodes[node].cut, cells.nodes[node].upper
            if j == OBLIQUE:
                node = lower_part(cells.nodes, node)
                continue
            near = cells.tolerance[j]
            if x[j] > v + near:
                found[0, j], node = v, upper
                continue
            if x[j] >= v - near:
                waiting[top], bounds[top] = upper, found
                bounds[top, 0, j] = v
                top += 1
            found[1, j], node = v, lower_part(cells.nodes, node)
            continue
        if node == OPEN or top == 0:
            return node == OPEN
        top -= 1
        node, found[:] = waiting[top], bounds[top]
