"""Two bodies on a cell: the plane between them, the proof that it separates them there, and where they are nearest."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from certifier.model import Array, Volume
from certifier.pair.closest import closest
from certifier.partition import kernels
from certifier.partition.area import Area
from certifier.partition.cell import Cell
from certifier.partition.sides import Side
from certifier.partition.tree import Streams, joined

CHORDS = 150
CORNERS = 64
CALM = 0.3
"""So much less weight is on the slopes of a plane than on the rest: it turns less, and its normal's length has a tight affine bound."""
LEAST, ENOUGH = 3e-4, 0.8
"""A plane's margin is at least LEAST, relative to the bodies' extent, and at least ENOUGH of the widest one."""
ROUNDS = 8
"""A plane is looked for this many times before its cell is cut."""
PIECES, MANY_PIECES = 10, 25
"""A vertex may take this many pieces: PIECES with up to 5 joints between the bodies, MANY_PIECES with more."""
FEW_JOINTS = 5
DESCENT = 3
CLOSE = 0.05
"""From bodies that come as close as this, relative to their extent, a contact is looked for."""
STEPS = 6
"""A contact is looked for in so many steps."""
TOUCH = 3e-4
"""Bodies that are nearer than this, relative to their extent, are too close for a plane."""


@dataclass(frozen=True, eq=False)
class Separated:
    """A plane separates the bodies on the polytope and the cell: (5, 1 + k), as a proof holds it, with its pieces and multipliers."""

    plane: Array
    streams: Streams


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

    Args:
        play: position indices of the joints that the plane may move with, ascending.
        choice: which of the volumes are coarse ones, as a proof holds it.

    Attributes:
        joints: those that move one volume against the other, ascending.
        reach: the bodies are apart where their vertices' hulls are farther apart than this, in metres.
        extent: half the size of the space that their vertices are seen in, in metres.
    """

    def __init__(self, area: Area, frame: str, play: list[int], volumes: tuple[Volume, Volume], choice: int) -> None:
        self._area, self._frame, self._play, self._volumes, self.choice = area, frame, play, volumes, choice
        self._radii = [volume.radius + area.scene.padding for volume in volumes]
        self.reach = sum(self._radii)
        self._sides = [
            Side(area, frame, volume, play, sign, radius) for volume, sign, radius in zip(volumes, (1.0, -1.0), self._radii, strict=True)
        ]
        # A joint between the frame and both bodies moves neither against the other, but stays in the plane's frame.
        self.joints = sorted({*self._sides[0].own, *self._sides[1].own})
        self._places = [play.index(joint) for joint in self.joints]
        A, B = self.vertices(area.samples[:64])
        points = np.concatenate([A.reshape(-1, 3), B.reshape(-1, 3)])
        self._middle = (points.min(axis=0) + points.max(axis=0)) / 2
        self.extent = float(np.abs(points - self._middle).max())
        self._pieces = PIECES if len(self.joints) <= FEW_JOINTS else MANY_PIECES
        signs = np.array(list(itertools.product((False, True), repeat=min(len(self.joints), 12))))
        self._corners = signs if len(signs) <= CORNERS else None

    def vertices(self, X: Array) -> tuple[Array, Array]:
        """Returns where the vertices are at points (N, n), in the frame, in metres."""
        a, b = (self._area.kinematics.points(self._frame, volume.body, volume.vertices, X) for volume in self._volumes)
        return a, b

    def separate(self, cell: Cell, start: Array, seed: int) -> Separated | Undecided:
        """Looks for a plane on the polytope and a cell, and proves it.

        Args:
            start: (n,) a point of the polytope in the cell.
        """
        n = len(start)
        C, d = cell.faces(self._area)
        rng = np.random.default_rng(seed)
        targets = np.where(rng.random((CORNERS if self._corners is None else len(self._corners), n)) < 0.5, cell.lower, cell.upper)
        if self._corners is not None:
            targets[:, self.joints] = np.where(self._corners, cell.upper[self.joints], cell.lower[self.joints])
        X = np.concatenate([start[None], kernels.chords(C, d, start, targets, CHORDS, seed), cell.points])
        A, B = self._points(X)
        for _ in range(ROUNDS):
            u = np.ascontiguousarray((CALM * (X - cell.mid) / cell.half)[:, self.joints])
            found, z, places, weights = kernels.separate(
                A, B, u, self._radii[0] / self.extent, self._radii[1] / self.extent, np.arange(len(X)), LEAST, ENOUGH
            )
            if not found:
                return Undecided(X, X[places], weights)
            plane = self._bounded(cell, self._in_s(cell, z))
            result, side = self._prove(cell, plane)
            if isinstance(result, Streams):
                return Separated(plane, result)
            if isinstance(result, int):
                return Undecided(X, None, weights, result)
            worse = self._descend(plane, side, C, d, cell, result, rng)
            X = np.concatenate([X, worse])
            more_a, more_b = self._points(worse)
            A, B = np.concatenate([A, more_a]), np.concatenate([B, more_b])
        return Undecided(X, X[places], weights)

    def nearest(self, cell: Cell, configurations: Array) -> tuple[Array, float] | None:
        """Returns where the bodies are nearest in the cell and their gap there, from the one of some configurations (w, n) on.

        Returns None where they are not close at any of these.

        In every step a linear program moves to where the bodies would be nearest if the points that are nearest now stayed so.
        """
        kinematics, n = self._area.kinematics, len(cell.lower)
        pairs = [closest(a, b) for a, b in zip(*self.vertices(configurations), strict=True)]
        place = int(np.argmin([pair.distance for pair in pairs]))
        s, nearest = configurations[place], pairs[place]
        if nearest.distance > self.reach + CLOSE * self.extent:
            return None
        (a, b), (C, d), reach = self._volumes, cell.faces(self._area), cell.half.copy()
        for _ in range(STEPS):
            if nearest.gap < self.reach + TOUCH * self.extent:
                break
            step = 1e-6 * cell.half
            around = np.concatenate([s + np.diag(step), s - np.diag(step)])
            p_a, p_b = (
                np.einsum("v,nvi->ni", w / w.sum(), kinematics.points(self._frame, volume.body, volume.vertices, around))
                for volume, w in zip((a, b), nearest.weights, strict=True)
            )
            gap = (p_a - p_b) @ nearest.normal
            slope = np.where(np.isin(np.arange(n), self.joints), (gap[:n] - gap[n:]) / (2 * step), 0.0)
            bounds = np.column_stack([np.maximum(cell.lower, s - reach), np.minimum(cell.upper, s + reach)])
            found = linprog(slope, A_ub=C[: -2 * n], b_ub=d[: -2 * n], bounds=bounds, method="highs")
            if found.status != 0:
                break
            tried = s + np.linspace(1.0, 0.2, 5)[:, None] * (found.x - s)
            further = [closest(*points) for points in zip(*self.vertices(tried), strict=True)]
            best = int(np.argmin([pair.distance for pair in further]))
            if further[best].distance >= nearest.distance - TOUCH * self.extent:
                break
            s, nearest, reach = tried[best], further[best], reach / 2
        return s, nearest.gap

    def _prove(self, cell: Cell, plane: Array) -> tuple[Streams | Array | int, Side]:
        """Returns the streams of a proof, or what :meth:`certifier.partition.sides.Side.prove` says, and of which side."""
        C, d = self._area.polytope.C, self._area.polytope.d
        cutting = np.flatnonzero(d - C @ cell.mid - np.abs(C) @ cell.half < 0)
        found = []
        for side in self._sides:
            result = side.prove(plane, cell.lower, cell.upper, C[cutting], d[cutting], cutting, self._pieces)
            if not isinstance(result, Streams):
                return result, side
            found.append(result)
        return joined(found), self._sides[1]

    def _in_s(self, cell: Cell, z: Array) -> Array:
        """Returns a plane in the frame, metres and s from one in the coordinates of the search, (4, 1 + k), k the joints in play."""
        plane = z.reshape(4, -1).copy()
        plane[:3] /= self.extent
        plane[3] -= self._middle @ plane[:3]
        plane[:, 1:] *= CALM / cell.half[self.joints]
        plane[:, 0] -= plane[:, 1:] @ cell.mid[self.joints]
        spread = np.zeros((4, 1 + len(self._play)))
        spread[:, [0, *(1 + place for place in self._places)]] = plane / np.abs(plane[:3]).max()
        return spread

    def _bounded(self, cell: Cell, plane: Array) -> Array:
        """Returns the plane with a bound of its normal's length below, (5, 1 + k), which is affine in s and holds on the cell.

        The length is convex, so a bound of it at the corners is enough. Its slopes are the mean differences between the corners.
        """
        bound = np.zeros(plane.shape[1])
        if max(self._radii) > 0:
            J = self._play
            signs = np.array(list(itertools.product((-1.0, 1.0), repeat=len(self.joints))))
            corners = np.zeros((len(signs), len(J)))
            corners[:, self._places] = signs
            s = cell.mid[J] + corners * cell.half[J]
            lengths = np.linalg.norm(plane[:3, :1] + plane[:3, 1:] @ s.T, axis=0) * (1 + 1e-9)
            slopes = lengths @ corners / len(corners)
            bound[1:] = slopes / cell.half[J]
            bound[0] = (lengths - s @ bound[1:]).max() + 1e-12 * (lengths.max() + np.abs(s @ bound[1:]).max())
        return np.vstack([plane, bound])

    def _descend(self, plane: Array, side: Side, C: Array, d: Array, cell: Cell, start: Array, rng: np.random.Generator) -> Array:
        """Returns points of the polytope and the cell that lie ever farther on the wrong side, beginning at one that does."""
        n = len(start)
        found, least = [start], np.inf
        for _ in range(DESCENT):
            ways = np.concatenate([np.diag(cell.half), -np.diag(cell.half), rng.normal(size=(12, n)) * cell.half])
            ends = kernels.chords(C, d, found[-1], found[-1] + 2 * ways, 0, 0)
            X = np.concatenate([ends, (ends + found[-1]) / 2])
            normals = np.einsum("ie,ne->ni", plane[:4], np.column_stack([np.ones(len(X)), X[:, self._play]]))
            volume = side.volume
            points = self._area.kinematics.points(self._frame, volume.body, volume.vertices, X)
            values = side.sign * (np.einsum("nvc,nc->nv", points, normals[:, :3]) + normals[:, 3, None])
            reach = side.radius * np.linalg.norm(normals[:, :3], axis=1)
            worst = values.min(axis=1) - reach
            if not worst.min() < least:
                break
            least = float(worst.min())
            found.append(X[worst.argmin()])
        return np.array(found)

    def _points(self, X: Array) -> tuple[Array, Array]:
        a, b = ((points - self._middle) / self.extent for points in self.vertices(X))
        return np.ascontiguousarray(a), np.ascontiguousarray(b)
