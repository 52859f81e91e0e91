"""Two bodies on a cell: the plane between them, the proof that it separates them there, and where they are nearest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.conditioned import limit_of
from certifier.model import Array, Volume
from certifier.partition import planes
from certifier.partition.area import Area
from certifier.partition.cell import Cell
from certifier.partition.chords import chords, within
from certifier.partition.hulls import Hull, approach, gaps, hull
from certifier.partition.multipliers import PROVED, REFUTED
from certifier.partition.sides import Moving, Proofs, Side, prove_side, room_for
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
BESIDE = 1e-6
"""The plane of a condition's limit is moved by this part of the bodies' extent to what is allowed, so that there is room on both sides."""
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


class Pair(NamedTuple):
    """Two volumes as compiled loops see them.

    Attributes:
        a, b: the bodies in the space of the search.
        first, second: the same in the frame of the plane, the positive side first.
        joints: (k,) position indices of those that move one volume against the other, ascending.
        middle, extent: where the space of the search is in the frame, and its unit, in metres.
        rounded: whether a radius is positive.
        pieces: a vertex may take this many.
    """

    a: Hull
    b: Hull
    first: Moving
    second: Moving
    joints: Array
    middle: Array
    extent: float
    rounded: bool
    pieces: int


class Bodies:
    """Two volumes, in the frame of the plane.

    Attributes:
        volumes: the two volumes.
        joints: position indices of those that move one volume against the other, ascending.
        pair, hulls: the bodies as compiled loops see them; in the space of the search.
        extent: half the size of the space that their vertices are seen in, in metres.
    """

    def __init__(self, area: Area, frame: str, volumes: tuple[Volume, Volume]) -> None:
        self._area, self.volumes = area, volumes
        radii = [volume.radius + area.scene.padding_between(volumes) for volume in volumes]
        # A joint between the frame and both bodies moves neither against the other, but stays in the plane's frame.
        self.joints = sorted({joint for volume in volumes for joint in area.kinematics.chain(frame, volume.body)})
        self._sides = [
            Side(area, frame, volume, self.joints, sign, radius) for volume, sign, radius in zip(volumes, (1.0, -1.0), radii, strict=True)
        ]
        seen = [area.kinematics.points(frame, volume.body, volume.vertices, area.samples[:64]).reshape(-1, 3) for volume in volumes]
        points = np.concatenate(seen)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        self.extent = float(np.abs(points - middle).max()) or 1.0  # all vertices may be one point
        a, b = (hull(area.kinematics, frame, volume, radius, middle, self.extent) for volume, radius in zip(volumes, radii, strict=True))
        self.hulls = a, b
        pieces = PIECES if len(self.joints) <= FEW_JOINTS else MANY_PIECES
        first, second = (side.moving for side in self._sides)
        self.pair = Pair(a, b, first, second, np.array(self.joints, np.int64), middle, self.extent, max(radii) > 0, pieces)
        self._known = self._known_plane(frame)

    def _known_plane(self, frame: str) -> Array | None:
        """Returns the plane, (4, 1 + k), of the limit of a condition that stands still in the frame of the plane, if one volume is its box.

        No other plane separates more: the box reaches beyond all that the other volume can get to.
        """
        for volume, sign in zip(self.volumes, (-1.0, 1.0), strict=True):
            limit = limit_of(self._area.scene.geometry(volume.geometries[0]))
            if limit is None or not volume.is_geometry_of(self._area.scene) or self._area.kinematics.chain(frame, volume.body):
                continue
            (X,) = self._area.kinematics.points(frame, volume.body, np.array([[0.0, 0.0, 0.0], limit[:3]]), self._area.samples[:1])
            normal = X[1] - X[0]
            plane = np.zeros((4, 1 + len(self.joints)))
            plane[:3, 0], plane[3, 0] = sign * normal, sign * (limit[3] - normal @ X[0] - BESIDE * self.extent)
            return plane
        return None

    def separate(self, cell: Cell, start: Array) -> Separated | Undecided:
        """Looks for a plane on the polytope and a cell, and proves it.

        Args:
            start: (n,) a point of the polytope in the cell.
        """
        if self._known is not None:
            return self._prove(cell, start, self._known)
        kind, plane, proofs, first, X, places, weights = separated(
            self.pair, cell.lower, cell.upper, *self._inside(cell), start, cell.points, cell.seed, LEAST / self._area.finer
        )
        if kind == SEPARATED:
            return Separated(plane, _streams(proofs, first))
        if kind == NO_PLANE:
            return Undecided(X, X[places], weights)
        return Undecided(X, None, weights, None if kind == UNPROVED else -1 - kind)

    def _prove(self, cell: Cell, start: Array, plane: Array) -> Separated | Undecided:
        """Proves a plane (4, 1 + k) than which no other one can do more; all else is as for :meth:`separate`."""
        C, d, *cut = self._inside(cell)
        kind, bounded, proofs, first, refuted = _held_by(self.pair, cell.lower, cell.upper, *cut, plane)
        if kind == PROVED:
            return Separated(bounded, _streams(proofs, first))
        X, N = _configurations(self.pair.joints, cell.lower, cell.upper, C, d, start, cell.points, cell.seed)
        if kind != REFUTED:
            return Undecided(X[:N].copy(), None, np.zeros(0), -1 - kind)
        X[N] = within(C, d, start, refuted)
        return Undecided(X[: N + 1].copy(), X[N : N + 1].copy(), np.ones(1))

    def held_by(self, cell: Cell, plane: Array, play: Sequence[int]) -> Separated | None:
        """Returns the proof that a given plane separates the bodies on the polytope and a cell; None where it cannot be proved.

        Args:
            plane: (4, 1 + k), as a proof holds it that has the joints ``play`` in play, ascending; a bound of its normal's length on the
                cell is made anew.
        """
        own = [0, *(1 + play.index(joint) for joint in self.joints)]
        if np.delete(plane, own, axis=1).any():
            return None  # It moves with joints that move neither body.
        cut = self._inside(cell)[2:]
        kind, plane, proofs, first, _ = _held_by(self.pair, cell.lower, cell.upper, *cut, np.ascontiguousarray(plane[:, own]))
        return Separated(plane, _streams(proofs, first)) if kind == PROVED else None

    def _inside(self, cell: Cell) -> tuple[Array, Array, Array, Array, Array]:
        """Returns the part of the polytope in a cell, with rows of length 1; and the faces that cut the cell, and their numbers."""
        faces, C, d = cell.inside
        return C, d, self._area.polytope.C[faces], self._area.polytope.d[faces], faces

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


SEPARATED, NO_PLANE, UNPROVED = 2, 1, 0
"""What :func:`separated` finds: a plane and its proof, that there is none, or none that is proved. Where a plane took too many pieces,
-1 - j says in which joint j most of them were halved."""


def _streams(proofs: Proofs, first: Array) -> tuple[Streams, Streams]:
    """Returns the streams of the first volume, which have these lengths, and those of the second."""
    found = []
    for begin, end in ((np.zeros(3, np.int64), first), (first, proofs.lengths)):
        a, b, c = (slice(i, j) for i, j in zip(begin.tolist(), end.tolist(), strict=True))
        found.append(Streams(proofs.pieces[a].copy(), proofs.counts[b].copy(), proofs.faces[c].copy(), proofs.multipliers[c].copy()))
    return found[0], found[1]


@njit(cache=True)
def separated(
    pair: Pair,
    lower: Array,
    upper: Array,
    C: Array,
    d: Array,
    cutting: Array,
    offsets: Array,
    faces: Array,
    start: Array,
    points: Array,
    seed: int,
    least: float,
) -> tuple[int, Array, Proofs, Array, Array, Array, Array]:
    """Looks for a plane on the polytope and a cell, and proves it.

    Args:
        C, d: the part of the polytope in the cell, with rows of length 1.
        cutting, offsets, faces: the polytope's faces that cut the cell, and their numbers.
        start, points: a point of the polytope in the cell, and others to look at.

    Returns:
        What is found (SEPARATED and the others), the plane (5, 1 + k) as a proof holds it, the proofs of both sides, the lengths of the
        first one's, the configurations that were looked at, and which of these no plane separates, with weights.
    """
    J = pair.joints
    mid, half = (lower + upper) / 2, (upper - lower) / 2
    X, N = _configurations(J, lower, upper, C, d, start, points, seed)
    chart = planes.Chart(J, mid[J], CALM / half[J], CALM)
    plane, first, refuted = np.zeros((5, 1 + len(J))), np.zeros(3, np.int64), np.empty(len(start))
    proofs = room_for(len(pair.first.vertices) + len(pair.second.vertices), pair.pieces)
    places, weights = np.zeros(0, np.int64), np.zeros(0)
    for _ in range(ROUNDS):
        kind, z, places, weights, N = planes.look(pair.a, pair.b, chart, C, d, X, N, LOOKS, DESCENT, least, ENOUGH)
        if kind != planes.FOUND:
            break
        plane = in_s(pair, lower, upper, z)
        result = prove_both(pair, plane, lower, upper, cutting, offsets, faces, proofs, first, refuted)
        if result == PROVED:
            return SEPARATED, plane, proofs, first, X[:N].copy(), places, weights
        if result < 0:
            return result, plane, proofs, first, X[:N].copy(), places, weights
        if len(X) == N:
            return UNPROVED, plane, proofs, first, X[:N].copy(), places, weights
        X[N] = within(C, d, start, refuted)
        N += 1
    return NO_PLANE, plane, proofs, first, X[:N].copy(), places, weights


@njit(cache=True)
def _held_by(
    pair: Pair, lower: Array, upper: Array, cutting: Array, offsets: Array, faces: Array, plane: Array
) -> tuple[int, Array, Proofs, Array, Array]:
    """Proves a plane (4, 1 + k) as a proof holds it on the polytope and a cell. The arguments are those of :func:`separated`.

    Returns:
        What :func:`prove_both` finds, the plane with a bound of its normal's length, the proofs of both sides, the lengths of the first
        one's, and where the plane is refuted.
    """
    first, refuted = np.zeros(3, np.int64), np.empty(len(lower))
    proofs = room_for(len(pair.first.vertices) + len(pair.second.vertices), pair.pieces)
    bounded = _bounded(pair, lower, upper, plane)
    kind = prove_both(pair, bounded, lower, upper, cutting, offsets, faces, proofs, first, refuted)
    return kind, bounded, proofs, first, refuted


@njit(cache=True, inline="always")
def prove_both(
    pair: Pair,
    plane: Array,
    lower: Array,
    upper: Array,
    cutting: Array,
    offsets: Array,
    faces: Array,
    proofs: Proofs,
    first: Array,
    refuted: Array,
) -> int:
    """Proves both sides (:func:`certifier.partition.sides.prove_side`); ``first`` gets the lengths of the streams of the first one."""
    proofs.lengths[:] = 0
    result = prove_side(pair.first, plane, lower, upper, cutting, offsets, faces, pair.pieces, proofs, refuted)
    if result == PROVED:
        first[:] = proofs.lengths
        result = prove_side(pair.second, plane, lower, upper, cutting, offsets, faces, pair.pieces, proofs, refuted)
    return result


@njit(cache=True)
def _configurations(
    joints: Array, lower: Array, upper: Array, C: Array, d: Array, start: Array, points: Array, seed: int
) -> tuple[Array, int]:
    """Returns the configurations of the cell to look at first, and how many these are; there is room for MORE."""
    n, k = len(start), len(joints)
    corners = min(1 << k, CORNERS)
    np.random.seed(seed)
    targets = np.empty((corners, n))
    for i in range(corners):
        for j in range(n):
            targets[i, j] = lower[j] if np.random.random() < 0.5 else upper[j]
        if corners == 1 << k:
            for e in range(k):
                targets[i, joints[e]] = upper[joints[e]] if (i >> (k - 1 - e)) & 1 else lower[joints[e]]
    ends = chords(C, d, start, targets, CHORDS, seed)
    N = 1 + len(ends) + len(points)
    X = np.empty((N + MORE, n))
    X[0], X[1 : 1 + len(ends)], X[1 + len(ends) : N] = start, ends, points
    return X, N


@njit(cache=True)
def in_s(pair: Pair, lower: Array, upper: Array, z: Array) -> Array:
    """Returns a plane as a proof holds it, (5, 1 + k), from one in the coordinates of the search."""
    J, k = pair.joints, len(pair.joints)
    plane = z.reshape(4, 1 + k).copy()
    largest = 0.0
    for c in range(3):
        plane[c] /= pair.extent
        plane[3] -= pair.middle[c] * plane[c]
    for c in range(4):
        for e in range(k):
            j = J[e]
            plane[c, 1 + e] *= CALM / ((upper[j] - lower[j]) / 2)
            plane[c, 0] -= plane[c, 1 + e] * ((lower[j] + upper[j]) / 2)
    for c in range(3):
        for e in range(1 + k):
            largest = max(largest, abs(plane[c, e]))
    return _bounded(pair, lower, upper, plane / largest)


@njit(cache=True)
def _bounded(pair: Pair, lower: Array, upper: Array, plane: Array) -> Array:
    """Returns a plane (4, 1 + k) with a bound of its normal's length on the cell, larger than that by more than rounding errors."""
    J, k = pair.joints, len(pair.joints)
    bound = np.zeros(1 + k)
    if pair.rounded:
        at_mid = plane.copy()
        for c in range(4):
            for e in range(k):
                j = J[e]
                at_mid[c, 0] += plane[c, 1 + e] * ((lower[j] + upper[j]) / 2)
                at_mid[c, 1 + e] *= (upper[j] - lower[j]) / 2 / CALM
        planes.length_bound(at_mid.ravel(), k, CALM, bound)
        bound[0] += SAFE * np.abs(bound).sum()
        for e in range(k):
            j = J[e]
            bound[1 + e] *= CALM / ((upper[j] - lower[j]) / 2)
            bound[0] -= bound[1 + e] * ((lower[j] + upper[j]) / 2)
    # In a narrow cell, terms that nearly cancel leave a short normal, and the verifier adds up their rounding errors.
    rounding = abs(bound[0])
    for c in range(3):
        rounding += abs(plane[c, 0])
    for e in range(k):
        farthest = max(abs(lower[J[e]]), abs(upper[J[e]]))
        rounding += (abs(plane[0, 1 + e]) + abs(plane[1, 1 + e]) + abs(plane[2, 1 + e]) + abs(bound[1 + e])) * farthest
    bound[0] += ROUNDING * rounding
    found = np.empty((5, 1 + k))
    found[:4], found[4] = plane, bound
    return found
