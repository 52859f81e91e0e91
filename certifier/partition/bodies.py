"""Two bodies on a cell: the plane between them, the proof that it separates them there, and where they are nearest."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from certifier.model import Array, Volume
from certifier.partition import planes
from certifier.partition.area import Area
from certifier.partition.cell import Cell
from certifier.partition.chords import chords
from certifier.partition.hulls import approach, gaps, hull
from certifier.partition.sides import Side
from certifier.partition.tree import Streams, joined

CHORDS = 40
CORNERS = 64
MORE = 400
"""At most this many configurations may join the first ones of a cell."""
CALM = 0.3
"""The slopes of a plane weigh less than the rest by this factor: it turns less, and its normal's length has a tight affine bound."""
LEAST, ENOUGH = 3e-4, 0.8
"""A plane's margin is at least LEAST, relative to the bodies' extent, and at least ENOUGH of the widest one."""
SAFE, ROUNDING = 1e-9, 1e-12
"""The bound of a normal's length is larger than it by the first part, and by the second part of the terms that it is made of."""
LOOKS, ROUNDS = 20, 8
"""Before a cell is cut, a proof is tried for at most ROUNDS planes. Each of them is found by trying at most LOOKS planes against
configurations."""
PIECES, MANY_PIECES = 25, 250
"""A vertex may take this many pieces: PIECES with up to 5 joints between the bodies, MANY_PIECES with more."""
FEW_JOINTS = 5
DESCENT = 8
"""Number of steps in which a vertex is moved to where it is farther on the wrong side."""
CLOSE = 0.05
"""Bodies that come as close as this, relative to their extent, start a search for a contact."""
STEPS = 6
"""The search for a contact takes this many steps."""
TOUCH = 3e-4
"""Bodies that are nearer than this, relative to their extent, are too close for a plane."""


@dataclass(frozen=True, eq=False)
class Separated:
    """A plane separates the bodies on the polytope and the cell.

    Attributes:
        plane: (5, 1 + k), as a proof holds it, with the k joints that are in play for the bodies.
        streams: the pieces and multipliers of either side.
    """

    plane: Array
    streams: tuple[Streams, Streams]


@dataclass(frozen=True, eq=False)
class Undecided:
    """No plane was found, or none that could be proved.

    Attributes:
        points: (p, n) the points of the polytope in the cell that were looked at.
        support: (w, n) points that no plane separates, with weights, (w,); None where there was a plane.
        joint: the one to cut the cell in, where there was a plane that took too many pieces to prove.
    """

    points: Array
    support: Array | None
    weights: Array
    joint: int | None = None


class Bodies:
    """Two volumes, in the frame of the plane.

    Attributes:
        volumes: the two volumes.
        joints: position indices of those that move one volume against the other, ascending.
        hulls: the bodies, in the space of the search.
        extent: half the size of the space that their vertices are seen in, in metres.
    """

    def __init__(self, area: Area, frame: str, volumes: tuple[Volume, Volume]) -> None:
        self._area, self.volumes = area, volumes
        self._radii = [volume.radius + area.scene.padding_between(volumes) for volume in volumes]
        # A joint between the frame and both bodies moves neither against the other, but stays in the plane's frame.
        self.joints = sorted({joint for volume in volumes for joint in area.kinematics.chain(frame, volume.body)})
        self._sides = [
            Side(area, frame, volume, self.joints, sign, radius)
            for volume, sign, radius in zip(volumes, (1.0, -1.0), self._radii, strict=True)
        ]
        seen = [area.kinematics.points(frame, volume.body, volume.vertices, area.samples[:64]).reshape(-1, 3) for volume in volumes]
        points = np.concatenate(seen)
        self._middle = (points.min(axis=0) + points.max(axis=0)) / 2
        self.extent = float(np.abs(points - self._middle).max()) or 1.0  # all vertices may be one point
        self.hulls = tuple(
            hull(area.kinematics, frame, volume, radius, self._middle, self.extent)
            for volume, radius in zip(volumes, self._radii, strict=True)
        )
        self._pieces = PIECES if len(self.joints) <= FEW_JOINTS else MANY_PIECES
        signs = np.array(list(itertools.product((False, True), repeat=min(len(self.joints), 12))))
        self._corners = signs if len(signs) <= CORNERS else None

    def separate(self, cell: Cell, start: Array) -> Separated | Undecided:
        """Looks for a plane on the polytope and a cell, and proves it.

        Args:
            start: (n,) a point of the polytope in the cell.
        """
        C, d = cell.inside.C, cell.inside.d
        X, N = self._configurations(cell, start)
        for _ in range(ROUNDS):
            kind, z, places, weights, N = self._look(cell, X, N)
            if kind != planes.FOUND:
                break
            plane = self._in_s(cell, z)
            result = self._prove(cell, plane)
            if isinstance(result, tuple):
                return Separated(plane, result)
            if isinstance(result, int) or len(X) == N:
                return Undecided(X[:N].copy(), None, weights, result if isinstance(result, int) else None)
            X[N] = chords(C, d, start, result[None], 0, 0)[0]
            N += 1
        return Undecided(X[:N].copy(), X[places], weights)

    def held_by(self, cell: Cell, plane: Array, play: Sequence[int]) -> Separated | None:
        """Returns the proof that a given plane separates the bodies on the polytope and a cell; None where it cannot be proved.

        Args:
            plane: (4, 1 + k), as a proof holds it that has the joints ``play`` in play, ascending; a bound of its normal's length on the
                cell is made anew.
        """
        own = [0, *(1 + play.index(joint) for joint in self.joints)]
        if np.delete(plane, own, axis=1).any():
            return None  # It moves with joints that move neither body.
        plane = self._bounded(cell, plane[:, own])
        result = self._prove(cell, plane)
        return Separated(plane, result) if isinstance(result, tuple) else None

    def changes(self, cell: Cell, s: Array, joints: Sequence[int]) -> Array:
        """Returns how much the gap changes when one joint moves across the cell, for each of these joints, (k,).

        Args:
            s: (n,) where the other joints stay, and where the gap is looked at beside both ends.
        """
        X = np.tile(s, (len(joints), 3, 1))
        for row, joint in zip(X, joints, strict=True):
            row[0, joint], row[2, joint] = cell.lower[joint], cell.upper[joint]
        found: Array = np.ptp(gaps(*self.hulls, X.reshape(-1, len(s))).reshape(-1, 3), axis=1)
        return found

    def _configurations(self, cell: Cell, start: Array) -> tuple[Array, int]:
        """Returns the configurations of the cell to look at first, and how many these are; there is room for MORE."""
        n, seed = len(start), cell.seed
        rng = np.random.default_rng(seed)
        targets = np.where(rng.random((CORNERS if self._corners is None else len(self._corners), n)) < 0.5, cell.lower, cell.upper)
        if self._corners is not None:
            targets[:, self.joints] = np.where(self._corners, cell.upper[self.joints], cell.lower[self.joints])
        ends = chords(cell.inside.C, cell.inside.d, start, targets, CHORDS, seed)
        N = 1 + len(ends) + len(cell.points)
        X = np.empty((N + MORE, n))
        X[0], X[1 : 1 + len(ends)], X[1 + len(ends) : N] = start, ends, cell.points
        return X, N

    def _look(self, cell: Cell, X: Array, N: int) -> tuple[int, Array, Array, Array, int]:
        """Looks for a plane on the polytope and a cell (:func:`certifier.partition.planes.look`)."""
        J = np.array(self.joints)
        chart = planes.Chart(J, cell.mid[J], CALM / cell.half[J], CALM)
        found: tuple[int, Array, Array, Array, int] = planes.look(
            *self.hulls, chart, cell.inside.C, cell.inside.d, X, N, LOOKS, DESCENT, LEAST / self._area.finer, ENOUGH
        )
        return found

    def nearest(self, cell: Cell, configurations: Array) -> tuple[Array, float] | None:
        """Returns where the bodies are nearest in the cell, from the one of some configurations (w, n) on, and their gap in metres there.

        Returns None where they are not close at any of these.
        """
        found = gaps(*self.hulls, configurations)
        place = int(found.argmin())
        if found[place] > CLOSE:
            return None
        return self.approached(cell, configurations[place], STEPS)

    def approached(self, cell: Cell, s: Array, steps: int) -> tuple[Array, float]:
        """Returns where the bodies are nearest in the cell, ``steps`` steps from a configuration on, and their gap in metres there."""
        s = s.copy()
        gap = approach(*self.hulls, np.array(self.joints), cell.half, cell.inside.C, cell.inside.d, s, steps, 0.0)
        return s, gap * self.extent

    def in_proof(self, found: Separated, play: Sequence[int]) -> tuple[Array, Streams]:
        """Returns a plane and its streams as a proof holds them that has more joints in play, which are ascending."""
        plane = np.zeros((5, 1 + len(play)))
        plane[:, [0, *(1 + play.index(joint) for joint in self.joints)]] = found.plane
        return plane, joined([side.renumbered(streams, play) for side, streams in zip(self._sides, found.streams, strict=True)])

    def _prove(self, cell: Cell, plane: Array) -> tuple[Streams, Streams] | Array | int:
        """Returns the streams of both sides, or what :meth:`certifier.partition.sides.Side.prove` says."""
        faces = cell.inside.faces
        C, d = self._area.polytope.C[faces], self._area.polytope.d[faces]
        found = []
        for side in self._sides:
            result = side.prove(plane, cell.lower, cell.upper, C, d, faces, self._pieces)
            if not isinstance(result, Streams):
                return result
            found.append(result)
        first, second = found
        return first, second

    def _in_s(self, cell: Cell, z: Array) -> Array:
        """Returns a plane as a proof holds it, (5, 1 + k), from one in the coordinates of the search."""
        plane = z.reshape(4, 1 + len(self.joints)).copy()
        plane[:3] /= self.extent
        plane[3] -= self._middle @ plane[:3]
        plane[:, 1:] *= CALM / cell.half[self.joints]
        plane[:, 0] -= plane[:, 1:] @ cell.mid[self.joints]
        return self._bounded(cell, plane / np.abs(plane[:3]).max())

    def _bounded(self, cell: Cell, plane: Array) -> Array:
        """Returns a plane (4, 1 + k) with a bound of its normal's length on the cell, larger than that by more than rounding errors."""
        k, mid, half = len(self.joints), cell.mid[self.joints], cell.half[self.joints]
        bound = np.zeros(1 + k)
        if max(self._radii) > 0:
            at_mid = np.column_stack([plane[:, 0] + plane[:, 1:] @ mid, plane[:, 1:] * half / CALM])
            planes.length_bound(at_mid.ravel(), k, CALM, bound)
            bound[0] += SAFE * np.abs(bound).sum()
            bound[1:] *= CALM / half
            bound[0] -= bound[1:] @ mid
        normal = np.abs(np.vstack([plane[:3], bound]))
        # In a narrow cell, terms that nearly cancel leave a short normal, and the verifier adds up their rounding errors.
        farthest = np.maximum(np.abs(cell.lower), np.abs(cell.upper))[self.joints]
        bound[0] += ROUNDING * (normal[:, 0].sum() + (normal[:, 1:] @ farthest).sum())
        return np.vstack([plane, bound])
