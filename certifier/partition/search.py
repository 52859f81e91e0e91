"""The search divides a polytope into cells until every cell has a plane that separates a pair, or the effort is spent.

A cell goes through these steps (certifier.partition.bodies), each of which sends it back to an earlier one or settles it:

    points of the polytope in the cell   -> none: multipliers show that the cell misses the polytope
    a plane, affine in s, between them   -> none: the cell is cut; where bodies touch at one of these points it stays open
    proofs that all vertices keep to their sides (certifier.partition.sides)
        -> a point of the polytope where one does not: the plane is looked for again, with this point
        -> too many pieces: the cell is cut

Coarse volumes (certifier.partition.coarse) come first, on levels (certifier.partition.levels). Where those of a level are not enough, the
cell is cut in the joints that move them, until it is narrow; then the next level is tried, the bodies themselves at last. Of two chains,
the next level is tried at once where the volumes touch. A cell is cut in the joint that changes the gap between the bodies most.

The largest cells, by q-volume, come first.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from certifier.model import Array, Volume
from certifier.partition.area import Area
from certifier.partition.bodies import TOUCH, Bodies, Separated, Undecided
from certifier.partition.cell import KEPT, Cell
from certifier.partition.frames import choose_frame
from certifier.partition.hulls import gaps
from certifier.partition.levels import MANY_JOINTS, Level, levels_of
from certifier.partition.shared import Shared
from certifier.partition.tree import Node, OpenCell, Streams
from certifier.polytopes.simplex import deepest, maximise
from certifier.proof.partition import EMPTY, OPEN, PLANE, choices_of

NARROW = np.radians(3.0)
"""A cell that turns less than this in every joint is not cut any more."""
NARROW_COARSE = np.radians(15.0)
"""A cell that turns less than this in every joint that moves the coarse volumes, or has neither a plane nor a sample, is not cut for
them any more."""
NARROW_CUT = np.radians(7.0)
"""A cell is not cut for coarse volumes in a joint in which it turns less than this. A joint next to a volume may turn as far as it likes:
the volume hardly moves for it, and cuts in others would go on for ever. Where the next level takes far too many cells, there are
exceptions: volumes that faces separate, bodies of two chains, and volumes that do not touch, of bodies that MANY_JOINTS or more move
(docs/trials.md)."""
NARROWER = np.radians(30.0)
"""Where MANY_JOINTS or more move one body against the other, a cell without a sample is cut for them until it turns less than NARROWER."""
NARROW_APART = np.radians(3.5)
"""Cells are cut until they turn less than this for volumes that faces separate, and for volumes that touch at none of the configurations
that are looked at, of bodies that MANY_JOINTS or more move."""
SAVED, MOST_PARTED = 2, 6
"""Where faces are added, and MANY_JOINTS or more move one body against the other, they separate the slimmest level that at most MOST_PARTED
joints move. Of bodies that are no two chains, it has to save SAVED joints, and to have a coarse volume in the place of one of them only.
Narrow cells of it stay open where slimmer volumes have no plane either, and are not cut for these: once the faces separate the volumes, the
bodies need no cells."""
ROOM = 0.25
"""At every point that stays inside, the volumes that faces separate are farther apart than this part of the larger radius. Faces between
nearer ones would have to pass close by the point, and cost most of the polytope."""
LOOKED_AT = 64
"""Whether volumes touch is looked at at this many configurations of a cell, and fewer than twice as many: cells are cut where volumes touch
in a small corner only. Of two chains, a cell in which the volumes of a level touch is tried with the next level at once, except for volumes
that faces separate. Cuts for them would only multiply the cells of the next level, which has to be cut in other joints."""
BEYOND = 1e-9
"""A point may lie beyond a face by this."""
SPARE, BESIDE = 0.4, 0.02
"""Where a plane takes too many pieces to prove, a side of the cell that the polytope leaves free is cut off, if it is the share SPARE
of the cell's width in a joint or more. Between the cut and the polytope lies BESIDE of the polytope's width."""
FEW = 16
"""At most this many points of a narrow cell are reported."""


class _Cut(NamedTuple):
    """Says how to cut a cell.

    Attributes:
        joint: the joint to cut it in.
        points: (p, n) points of the polytope in the cell.
        value: where, in s; None for the middle of its range of q.
    """

    joint: int
    points: Array
    value: float | None = None


@dataclass
class Report:
    """Says what a search has done.

    Attributes:
        cells: how many cells were looked at.
        contacts: points (n,) at which the bodies touch.
        narrow: points (w, n) of each cell that is too narrow to be cut, or in which the bodies come too close.
        left: how many samples of the polytope are in the cells that stay open.
    """

    cells: int = 0
    contacts: list[Array] = field(default_factory=list)
    narrow: list[Array] = field(default_factory=list)
    left: int = 0


class Search:
    """Searches the partition of two volumes on one polytope.

    Args:
        keep: (k, n) points that stay inside, where faces will be added to the polytope; None where it stays as it is.

    Attributes:
        frame: body in whose frame the planes are.
        joints: position indices of the joints in play, ascending.
        coarse: the coarse volumes that a leaf may choose, as in a proof.
        bodies: the volumes themselves.
        parted: the volumes that faces keep apart in the place of the bodies; None where it is the bodies.
        volumes_of_levels: the two volumes of every level; those of level 0 are the volumes themselves.
    """

    def __init__(self, area: Area, shared: Shared, volumes: tuple[Volume, Volume], keep: Array | None = None) -> None:
        self._area, self._shared = area, shared
        self.frame, self.joints = choose_frame(area.kinematics, volumes, area.lower, area.upper)
        self.coarse, levels, self._fat, self._two_chains = levels_of(area, self.frame, volumes)
        chosen = choices_of(volumes, self.coarse)
        self._choices = [i + (1 + len(self.coarse[0])) * j for i, j in levels]
        self.bodies = Bodies(area, self.frame, volumes)
        self.volumes_of_levels = [chosen[choice] for choice in self._choices]
        self._levels = [self.bodies, *(shared.bodies(self.frame, chosen[choice]) for choice in self._choices[1:])]
        self.parted = None if keep is None or len(self.joints) < MANY_JOINTS else self._parted(levels, keep)

    def run(self, cells: Sequence[OpenCell], most: int) -> Report:
        """Works on open cells, whose nodes it changes.

        Args:
            most: end after this many cells.
        """
        area, report, ties = self._area, Report(), itertools.count()
        heap: list[tuple[float, int, Cell]] = []

        def push(cell: Cell) -> None:
            heapq.heappush(heap, (-float(len(cell.samples)), next(ties), cell))

        for node, lower, upper in cells:
            inside = area.samples[((area.samples >= lower) & (area.samples <= upper)).all(axis=1)]
            push(Cell.at(area, node, lower, upper, inside))
        while heap and report.cells < most:
            cell = heapq.heappop(heap)[2]
            report.cells += 1
            cut = self._settle(cell, report)
            if cut is None:
                report.left += len(cell.samples) if cell.node.kind == OPEN else 0
                continue
            joint, points, value = cut
            narrow = self._turn(cell, self.bodies)[self.joints].max() * area.finer < NARROW
            if value is None and not narrow:
                value = self._middle_of(cell, joint)
            if value is None:
                report.left += len(cell.samples)
                report.narrow.append(points[:FEW])
                continue
            halves = self._halves(cell, joint, value, points)
            cell.node.kind, cell.node.value, cell.node.children = joint, value, tuple(half.node for half in halves)
            for half in halves:
                push(half)
        report.left += sum(len(cell.samples) for _, _, cell in heap)
        return report

    def settle_as(self, cell: Cell, plane: Array | None, level: int) -> None:
        """Settles a cell with a plane that is given, if it holds for the bodies of this level, or if the cell misses the polytope.

        Args:
            plane: (4, 1 + k), as a proof holds it, without the bound of its normal's length; None where none is given.
        """
        found = None if plane is None else self._levels[level].held_by(cell, plane, self.joints)
        if found is not None:
            self._separated(cell, level, found)
        else:
            self._start(cell)

    def _parted(self, levels: list[Level], keep: Array) -> Bodies | None:
        if self._two_chains:
            found = next((bodies for bodies in self._levels[1:] if len(bodies.joints) <= MOST_PARTED), None)
        else:
            most = min(MOST_PARTED, len(self.joints) - SAVED)
            one_sided = (bodies for bodies, level in zip(self._levels, levels, strict=True) if (level[0] > 0) != (level[1] > 0))
            found = next((bodies for bodies in one_sided if len(bodies.joints) <= most), None)
        if found is None:
            return None
        room = ROOM * max(volume.radius for volume in found.volumes)
        return found if (found.extent * gaps(*found.hulls, keep) > room).all() else None

    def _halves(self, cell: Cell, joint: int, value: float, points: Array) -> list[Cell]:
        """Returns the lower and the upper part of a cell, with nodes of their own."""
        halves = []
        for below in (True, False):
            lower, upper = cell.lower.copy(), cell.upper.copy()
            (upper if below else lower)[joint] = value
            of_points, of_samples = ((X[:, joint] <= value) == below for X in (points, cell.samples))
            node = Node(level=cell.node.level)
            halves.append(Cell(self._area, node, lower, upper, points[of_points][:KEPT], cell.samples[of_samples]))
        return halves

    def _middle_of(self, cell: Cell, joint: int) -> float | None:
        """Returns where to cut a cell, in the middle of its range of q; None where doubles do not allow it."""
        l, u = cell.lower[joint], cell.upper[joint]
        value = float(self._area.scene.of(joint).middle(l, u))
        return value if l < value < u else None

    def _turn(self, cell: Cell, bodies: Bodies) -> Array:
        """Returns how far every joint turns in the cell, (n,); a slide counts relative to the bodies' extent."""
        return 1 / self._area.scene.scale(bodies.extent) * cell.turn()

    def _settle(self, cell: Cell, report: Report) -> _Cut | None:
        """Settles a cell, or returns how to cut it."""
        start = self._start(cell)
        if start is None:
            return None
        for level in range(min(cell.node.level, len(self._levels)) - 1, 0, -1):
            bodies = self._levels[level]
            found = self._shared.tried(bodies, cell, start)
            if isinstance(found, Separated):
                self._separated(cell, level, found)
                return None
            beside = self._beside_polytope(cell, bodies, start, found)
            if beside is not None:
                return beside
            joint = self._cut_for(cell, bodies, found)
            if joint is not None:
                return _Cut(joint, found.points)
            if bodies is self.parted:
                self._try_slimmer(cell, start, level)
                return None
            cell.node.level = level
        found = self.bodies.separate(cell, start)
        if isinstance(found, Separated):
            self._separated(cell, 0, found)
            return None
        if found.support is not None and found.joint is None:
            nearest = self.bodies.nearest(cell, found.support)
            if nearest is not None and nearest[1] <= 0:
                report.contacts.append(nearest[0])
                return None
            if nearest is not None and nearest[1] * self._area.finer < TOUCH * self.bodies.extent:
                report.narrow.append(nearest[0][None])
                return None
        return self._beside_polytope(cell, self.bodies, start, found) or _Cut(self._cut(cell, self.bodies, found), found.points)

    def _try_slimmer(self, cell: Cell, start: Array, level: int) -> None:
        """Settles a cell, if it can be, with slimmer volumes than those of this level."""
        for slimmer in range(level - 1, -1, -1):
            found = self._levels[slimmer].separate(cell, start)
            if isinstance(found, Separated):
                self._separated(cell, slimmer, found)
                return

    def _beside_polytope(self, cell: Cell, bodies: Bodies, start: Array, found: Undecided) -> _Cut | None:
        """Returns how to cut off a side of a cell that the polytope leaves free; None where there was no plane to prove, or hardly a side.

        A proof is about all of the cell's box, and takes pieces for what lies beside the polytope as well.
        """
        if found.support is not None:
            return None
        joints = np.array(bodies.joints)
        axes = np.eye(len(start))[joints]
        try:
            ends = maximise(cell.inside.C, cell.inside.d, np.concatenate([axes, -axes]), start)[0]
        except np.linalg.LinAlgError:  # Rounding stands in the way, and the middle is a place as well.
            return None
        lower, upper = cell.lower[joints], cell.upper[joints]
        most, least = (part[np.arange(len(joints)), joints] for part in np.split(ends, 2))
        margin = BESIDE * (most - least) + BEYOND * (upper - lower)
        values = np.concatenate([least - margin, most + margin])
        free = np.concatenate([values[: len(joints)] - lower, upper - values[len(joints) :]]) / np.tile(upper - lower, 2)
        best = int(free.argmax())
        return _Cut(int(joints[best % len(joints)]), found.points, float(values[best])) if free[best] > SPARE else None

    def at_hand(self, node: Node) -> Bodies:
        """Returns the fat balls that an open cell is tried with next; the volumes themselves where it is tried with slimmer ones."""
        level = min(node.level, len(self._levels)) - 1
        return self._levels[level] if level >= self._fat else self.bodies

    def _cut_for(self, cell: Cell, bodies: Bodies, found: Undecided) -> int | None:
        """Returns the joint to cut a cell in for coarse volumes; None where it is too narrow for them."""
        in_all, in_one = self._narrow(cell, bodies, found)
        turn = self._turn(cell, bodies)
        if turn[bodies.joints].max(initial=0.0) <= in_all:
            return None
        joint = self._cut(cell, bodies, found)
        return joint if turn[joint] > in_one else None

    def _narrow(self, cell: Cell, bodies: Bodies, found: Undecided) -> tuple[float, float]:
        """Returns how far a cell may turn, in all joints of coarse volumes and in the joint of the cut, and is not cut for them."""
        many = len(self.bodies.joints) >= MANY_JOINTS
        touch = many and bodies is not self.parted and _touch(bodies, found)
        if bodies is self.parted or (many and not touch and not self._two_chains):
            return NARROW_APART, 0.0
        if self._two_chains and touch:
            return np.inf, np.inf
        in_all = NARROW_COARSE if len(cell.samples) or found.joint is not None else NARROWER if many else np.inf
        return in_all, 0.0 if self._two_chains else NARROW_CUT

    def _start(self, cell: Cell) -> Array | None:
        """Returns a point of the polytope in the cell; None, after the node was settled, where there is none."""
        start = cell.points.mean(axis=0) if len(cell.points) > len(cell.lower) else None
        if start is None or (cell.inside.d - cell.inside.C @ start).min() < 1e-7 * cell.half.min():
            return self._inside(cell)
        return start

    def _separated(self, cell: Cell, level: int, found: Separated) -> None:
        """Settles a cell with a plane for the bodies of this level."""
        node = cell.node
        node.kind, node.choice = PLANE, self._choices[level]
        node.plane, node.streams = self._levels[level].in_proof(found, self.joints)

    def _cut(self, cell: Cell, bodies: Bodies, found: Undecided) -> int:
        """Returns the joint to cut a cell in: where proofs took most pieces, or the one that changes the gap most (docs/trials.md)."""
        turn = self._turn(cell, bodies)
        wide = [joint for joint in bodies.joints if turn[joint] * self._area.finer > NARROW / 2] or bodies.joints
        if found.support is None:
            return found.joint if found.joint in wide else max(bodies.joints, key=lambda joint: float(turn[joint]))
        changes = bodies.changes(cell, found.weights @ found.support / found.weights.sum(), wide)
        return max(zip(changes, turn[wide], wide, strict=True))[2]

    def _inside(self, cell: Cell) -> Array | None:
        """Returns a point of the polytope in the cell; None, after the node was settled, where there is none."""
        cutting = cell.inside.faces
        point, depth, multipliers = deepest(cell.inside.C, cell.inside.d, cell.mid)
        if depth >= -BEYOND:
            return point
        y = multipliers[: len(cutting)] / self._area.norms[cutting]
        used = y > 1e-9 * y.max()
        faces, values = cutting[used], (y[used] / y.max()).astype(np.float32)
        C, d = self._area.polytope.C[faces], self._area.polytope.d[faces]
        slope = values @ C
        if slope @ cell.mid - np.abs(slope) @ cell.half - values @ d > 1e-9 * (values @ np.abs(d) + 1):
            streams = Streams(np.zeros(0, np.int8), np.array([len(faces)], np.int16), faces.astype(np.int16), values)
            cell.node.kind, cell.node.streams = EMPTY, streams
            return None
        return point


def _touch(bodies: Bodies, found: Undecided) -> bool:
    """Returns whether no plane was found, and volumes touch at a configuration that was looked at, so that there is none in this cell."""
    looked_at = found.points[:: max(1, len(found.points) // LOOKED_AT)]
    return found.support is not None and bool((gaps(*bodies.hulls, looked_at) <= 0).any())
