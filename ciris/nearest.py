"""A compiled search for the configuration of a free set (ciris.free_set) that is nearest to another one. Distances are those of s.

What is not free is a union of boxes in q: the open cells, with a margin around them, but for the half-spaces that oblique cuts prove. The
search holds boxes about which it knows nothing, and takes the one whose nearest configuration is nearest of all. This configuration is
free, or it is in an open cell. Then the box without this cell is divided into others. The box around what a half-space has of the cell
joins them. It is halved where it is hardly smaller than the box before, down to the size of NEAR.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ciris.lookups import DEPTH, OBLIQUE, OPEN, PROVED, Cells, Floats, along, fill_s, in_s, lower_part

MARGIN = 2.0
"""The answer is this many tolerances away from open cells and from the joint limits, so that rounding leaves it free."""
PLUNGE = 64
"""After each such number of boxes, and until something is found, the search goes on with the nearest part of the same box. So an early end
has found something."""
ROOM = 256
"""There is room for this many boxes at first."""
NEAR, SMALLER, INSIDE = 1e-3, 0.9, 1e-9
"""Before an oblique cut, one corner stands for a box whose corners are less than NEAR apart along the normal, in s. A box is smaller than
another one if its sides together are less than SMALLER of the other's. The answer is INSIDE of the half-space, so that rounding leaves it
free.
"""
FACES = 16
"""At most FACES oblique cuts that a configuration is beyond are looked at. What others prove of its cell counts as open."""


class Aim(NamedTuple):
    """What to be near to.

    Attributes:
        q, s: (n,) the configuration.
    """

    q: Floats
    s: Floats


class Faces(NamedTuple):
    """Oblique cuts of an open cell that a configuration is beyond.

    Attributes:
        many: (1,) how many there are.
        rows, values: (FACES,) the rows of their normals, and where they are.
        parts: (FACES, 2, n) the box around what the half-space has of a box and the cell.
    """

    many: NDArray[np.int64]
    rows: NDArray[np.int64]
    values: Floats
    parts: Floats


class Room(NamedTuple):
    """What a search writes over: nodes that wait with their bounds and numbers of faces, boxes, a configuration in s, and faces."""

    waiting: NDArray[np.int32]
    bounds: Floats
    counts: NDArray[np.int64]
    boxes: Floats
    s: Floats
    seen: Faces


@njit(cache=True, nogil=True)
def nearest(cells: Cells, aim: Aim, closer_than: float, most: int, found: Floats) -> tuple[float, int, bool]:
    """Fills in the free configuration that is nearest, (n,).

    Args:
        closer_than: only what is closer than this counts, in s.
        most: the search ends after about this many boxes.

    Returns:
        The distance, ``closer_than`` if nothing was found; the number of boxes; whether it is certain that nothing is closer, but by NEAR
        before an oblique cut.
    """
    n, best, looked, plunging = len(found), closer_than, 0, False
    boxes, used, margin = np.empty((ROOM, 2, n)), 1, MARGIN * cells.tolerance
    box, x, gap, cell, keys = np.empty((2, n)), np.empty(n), np.empty(n), np.empty((2, n)), np.empty((2, n))
    counts = np.empty(DEPTH, np.int64)
    room = Room(np.empty(DEPTH, np.int32), np.empty((DEPTH, 2, n)), counts, np.empty((3, 2, n)), np.empty(n), _no_faces(n))
    faces, others, halves, unused = _no_faces(n), _no_faces(n), np.empty((2, 2, n)), np.empty((2, 2, n))
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
            gap[j] = _gap(cells, aim, j, x[j]) if x[j] != aim.q[j] else 0.0
            square += gap[j] ** 2
        left = _cell_at(cells, aim, margin, box, x, gap, cell, keys, faces, room)
        plunging = left > 0 and (plunging or looked % PLUNGE == 1 or best == closer_than)
        if left < 0 and square < best**2:
            best, found[:] = np.sqrt(square), x
        for f in range(faces.many[0] if left >= 0 else 0):
            row, part = faces.rows[f], faces.parts[f]
            if _width(cells, row, part) <= NEAR:
                square = _corner(cells, aim, row, part, x, gap)
                if square < best**2 and _cell_at(cells, aim, margin, part, x, gap, unused[0], unused[1], others, room) < 0:
                    best, found[:] = np.sqrt(square), x
                continue
            halves[0], count = part, 1
            if _sides(part) > SMALLER * _sides(box):
                count = _halved(cells, row, faces.values[f], part, halves)
            for i in range(count):
                key = _distance(cells, aim, halves[i])
                if key < best:
                    if used == len(boxes):
                        before, boxes = boxes, np.empty((2 * used, 2, n))
                        boxes[:used] = before
                    boxes[used] = halves[i]
                    heapq.heappush(waiting, (key, used))
                    used += 1
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
def _no_faces(n: int) -> Faces:
    return Faces(np.zeros(1, np.int64), np.zeros(FACES, np.int64), np.zeros(FACES), np.empty((FACES, 2, n)))


@njit(cache=True)
def _before(cells: Cells, row: int, value: float, box: Floats, part: Floats) -> bool:
    """Fills in the box around what the half-space before an oblique cut has of a box, (2, n), and returns whether that is anything."""
    normal, room = cells.normals[row], value - INSIDE
    for j in range(len(normal)):
        if box[0, j] > box[1, j]:
            return False
        part[0, j], part[1, j] = box[0, j], box[1, j]
        room -= normal[j] * in_s(cells, j, box[0 if normal[j] > 0 else 1, j])
    if room < 0:
        return False
    for j in range(len(normal)):
        if normal[j] != 0:
            end = in_s(cells, j, box[0 if normal[j] > 0 else 1, j]) + room / normal[j]
            end = cells.q_star[j] + (2 * np.arctan(end) if cells.revolute[j] else end)
            if normal[j] > 0:
                part[1, j] = min(part[1, j], end)
            else:
                part[0, j] = max(part[0, j], end)
    return True


@njit(cache=True)
def _width(cells: Cells, row: int, box: Floats) -> float:
    """Returns how far apart the corners of a box are along a normal."""
    total, normal = 0.0, cells.normals[row]
    for j in range(len(normal)):
        total += abs(normal[j]) * (in_s(cells, j, box[1, j]) - in_s(cells, j, box[0, j]))
    return total


@njit(cache=True)
def _corner(cells: Cells, aim: Aim, row: int, box: Floats, x: Floats, gap: Floats) -> float:
    """Fills in the configuration of a box that is first along a normal, and how far it is in s, (n,).

    Returns:
        The square of its distance.
    """
    square, normal = 0.0, cells.normals[row]
    for j in range(len(normal)):
        x[j] = min(max(aim.q[j], box[0, j]), box[1, j]) if normal[j] == 0 else box[0 if normal[j] > 0 else 1, j]
        gap[j] = _gap(cells, aim, j, x[j])
        square += gap[j] ** 2
    return square


@njit(cache=True)
def _sides(box: Floats) -> float:
    return (box[1] - box[0]).sum()


@njit(cache=True)
def _halved(cells: Cells, row: int, value: float, box: Floats, halves: Floats) -> int:
    """Fills in the boxes around what a half-space has of the halves of a box, (2, 2, n), and returns how many there are."""
    normal, best, longest = cells.normals[row], 0, -1.0
    for j in range(len(normal)):
        along_normal = abs(normal[j]) * (in_s(cells, j, box[1, j]) - in_s(cells, j, box[0, j]))
        if along_normal > longest:
            best, longest = j, along_normal
    count = 0
    for side in range(2):
        half = box.copy()
        half[1 - side, best] = (box[0, best] + box[1, best]) / 2
        count += _before(cells, row, value, half, halves[count])
    return count


@njit(cache=True)
def _distance(cells: Cells, aim: Aim, box: Floats) -> float:
    """Returns how far a box is from the aim, in s."""
    square = 0.0
    for j in range(box.shape[1]):
        q = min(max(aim.q[j], box[0, j]), box[1, j])
        square += (_gap(cells, aim, j, q) if q != aim.q[j] else 0.0) ** 2
    return np.sqrt(square)


@njit(cache=True)
def _gap(cells: Cells, aim: Aim, j: int, x: float) -> float:
    """Returns how far a position of a joint is from that of the aim, in s."""
    return in_s(cells, j, x) - aim.s[j]


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
    faces: Faces,
    room: Room,
) -> int:
    """Fills in an open cell with its margin in which x is, and returns how many parts the box without it has; -1 if x is in none.

    Of the cells of different clauses it is the one without which the box is farthest away.

    Args:
        x: (n,) the nearest configuration of the box.
        gap: (n,) how far it is, in s.
        cell: (2, n) gets the lower and the upper ends.
        keys: (2, n) gets how far the part of the box is that is beyond each end, in s; -1 where there is none.
        faces: gets the oblique cuts of the cell whose half-spaces have a part of it in the box.
    """
    best, parts, n, square = -1.0, -1, len(x), (gap**2).sum()
    mine, other, far, seen = room.boxes[0], room.boxes[1], room.boxes[2], room.seen
    fill_s(cells, x, x, 0.0, room.s)
    for clause in range(len(cells.first) - 1):
        mine[0], mine[1], place, end = -np.inf, np.inf, cells.first[clause], cells.first[clause + 1]
        seen.many[0] = 0
        while place < end and _open_at(cells, cells.root[cells.tree[place]], x, other, room):
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
                    far[i, j] = np.sqrt(max(square - gap[j] ** 2 + _gap(cells, aim, j, mine[i, j]) ** 2, 0.0))
                    least, count = min(least, far[i, j]), count + 1
        there = 0
        for f in range(seen.many[0]):
            other[0], other[1] = np.maximum(mine[0], box[0]), np.minimum(mine[1], box[1])
            if _before(cells, seen.rows[f], seen.values[f], other, seen.parts[there]):
                seen.rows[there], seen.values[there] = seen.rows[f], seen.values[f]
                least, there = min(least, _distance(cells, aim, seen.parts[there])), there + 1
        if least > best:
            best, parts, cell[:], keys[:] = least, count, mine, far
            faces.many[0] = there
            faces.rows[:there], faces.values[:there], faces.parts[:there] = seen.rows[:there], seen.values[:there], seen.parts[:there]
            if count + there == 0:
                break
    return parts


@njit(cache=True)
def _open_at(cells: Cells, root: int, x: Floats, found: Floats, room: Room) -> bool:
    """Says whether a tree has an open cell within the tolerance of x, and fills in the lower and upper ends of one, (2, n).

    The oblique cuts of the cell join those that were seen.
    """
    node, top, waiting, bounds, seen = root, 0, room.waiting, room.bounds, room.seen
    found[0], found[1] = -np.inf, np.inf
    while True:
        if node >= 0:
            j, v, upper = cells.nodes[node].joint, cells.nodes[node].cut, cells.nodes[node].upper
            if j == OBLIQUE:
                if along(cells, upper, room.s) <= v - INSIDE:
                    node = PROVED
                    continue
                if seen.many[0] < FACES:
                    seen.rows[seen.many[0]], seen.values[seen.many[0]] = upper, v
                    seen.many[0] += 1
                node = lower_part(cells.nodes, node)
                continue
            near = cells.tolerance[j]
            if x[j] > v + near:
                found[0, j], node = v, upper
                continue
            if x[j] >= v - near:
                waiting[top], bounds[top] = upper, found
                bounds[top, 0, j] = v
                room.counts[top] = seen.many[0]
                top += 1
            found[1, j], node = v, lower_part(cells.nodes, node)
            continue
        if node == OPEN or top == 0:
            return node == OPEN
        top -= 1
        node, found[:], seen.many[0] = waiting[top], bounds[top], room.counts[top]
