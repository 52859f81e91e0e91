"""The search divides a polytope into cells until every cell has a plane that separates a pair, or the effort is spent.

A cell goes through these steps, each of which sends it back to an earlier one or settles it:

    points of the polytope in the cell   -> none: multipliers show that the cell misses the polytope
    a plane, affine in s, between them   -> none: the cell is cut; where bodies touch at one of these points it stays open
    proofs that all vertices keep to their sides (certifier.partition.sides)
        -> a point of the polytope where one does not: the plane is looked for again, with this point
        -> too many pieces: the cell is cut

The largest cells, by q-volume, come first.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linprog

from certifier.model import Array, Volume
from certifier.pair.closest import closest
from certifier.pair.frames import choose_frame
from certifier.partition import kernels
from certifier.partition.area import Area
from certifier.partition.sides import Side
from certifier.partition.tree import Node, Streams, joined
from certifier.proof.partition import EMPTY, PLANE

NARROW = np.radians(3.0)
"""A cell that turns less than this in every joint is not cut any more."""
CHORDS = 150
CORNERS = 64
KEPT = 200
"""A cell inherits at most this many points."""
LEAST, ENOUGH = 3e-4, 0.8
"""A plane's margin is at least LEAST, relative to the bodies' extent, and at least ENOUGH of the widest one."""
CALM = 0.3
"""Where a radius is involved, this much less weight is on the slopes of the plane: its normal's length must have a tight affine bound."""
ROUNDS = 8
"""A plane is looked for this many times before its cell is cut."""
PIECES = {4: 10, 5: 12}
MANY_PIECES = 25
"""A vertex may take this many pieces: PIECES by the number of joints in play, MANY_PIECES with more."""
DESCENT = 3
FEW = 16
"""So many points of a narrow cell are reported."""
CLOSE = 0.05
"""From bodies that come as close as this, relative to their extent, a contact is looked for."""
STEPS = 6
"""A contact is looked for in so many steps."""


@dataclass
class Report:
    """Says what a search has done.

    Attributes:
        cells: how many cells were looked at.
        contacts: points (n,) at which the bodies touch.
        narrow: points (w, n) of each cell that is too narrow to be cut.
    """

    cells: int = 0
    contacts: list[Array] = field(default_factory=list)
    narrow: list[Array] = field(default_factory=list)


@dataclass
class _Cell:
    node: Node
    lower: Array
    upper: Array
    points: Array
    samples: Array

    @property
    def mid(self) -> Array:
        return (self.lower + self.upper) / 2

    @property
    def half(self) -> Array:
        return (self.upper - self.lower) / 2


class Search:
    """Searches the partition of two volumes on one polytope."""

    def __init__(self, area: Area, volumes: tuple[Volume, Volume]) -> None:
        self._area, self._volumes = area, volumes
        frame = choose_frame(area.kinematics, volumes)
        self.frame, self.joints = frame.body, list(frame.path)
        self._radii = [volume.radius + area.scene.padding for volume in volumes]
        self.reach = sum(self._radii)
        self._calm = CALM
        self._sides = [
            Side(area, frame.body, volume, self.joints, sign, radius)
            for volume, sign, radius in zip(volumes, (1.0, -1.0), self._radii, strict=True)
        ]
        A, B = self.vertices(area.samples[:64])
        points = np.concatenate([A.reshape(-1, 3), B.reshape(-1, 3)])
        self._middle = (points.min(axis=0) + points.max(axis=0)) / 2
        self._extent = float(np.abs(points - self._middle).max())
        self._pieces = PIECES.get(len(self.joints), min(PIECES.values()) if len(self.joints) < 4 else MANY_PIECES)
        signs = np.array(list(itertools.product((False, True), repeat=min(len(self.joints), 12))))
        self._corners = signs if len(signs) <= CORNERS else None

    def run(self, root: Node, cells: int) -> Report:
        """Works on the open cells of a tree, which it changes.

        Args:
            cells: end after so many cells.
        """
        area, report, ties = self._area, Report(), itertools.count()
        heap: list[tuple[float, int, _Cell]] = []

        def push(node: Node, lower: Array, upper: Array, points: Array, samples: Array) -> None:
            heapq.heappush(heap, (-float(len(samples)), next(ties), _Cell(node, lower, upper, points, samples)))

        for node, lower, upper in root.open_cells(area.lower, area.upper):
            inside = ((area.samples >= lower) & (area.samples <= upper)).all(axis=1)
            push(node, lower, upper, area.samples[inside][:KEPT], area.samples[inside])
        while heap and report.cells < cells:
            cell = heapq.heappop(heap)[2]
            report.cells += 1
            cut = self._settle(cell, report, seed=report.cells)
            if cut is None:
                continue
            joint, points = cut
            value = self._middle_of(cell, joint)
            if value is None:
                report.narrow.append(points[:FEW])
                continue
            cell.node.kind, cell.node.value, cell.node.children = joint, value, (Node(), Node())
            for child, below in zip(cell.node.children, (True, False), strict=True):
                lower, upper = cell.lower.copy(), cell.upper.copy()
                (upper if below else lower)[joint] = value
                of_points, of_samples = ((X[:, joint] <= value) == below for X in (points, cell.samples))
                push(child, lower, upper, points[of_points][:KEPT], cell.samples[of_samples])
        return report

    def _faces(self, cell: _Cell) -> tuple[Array, Array]:
        """Returns the faces of the polytope, then those of the cell."""
        polytope, eye = self._area.polytope, np.eye(len(cell.lower))
        return np.concatenate([polytope.C, eye, -eye]), np.concatenate([polytope.d, cell.upper, -cell.lower])

    def _middle_of(self, cell: _Cell, joint: int) -> float | None:
        """Returns where to cut a cell, in the middle of its angle; None where it is narrow in all joints."""
        if self._turn(cell)[self.joints].max() < NARROW:
            return None
        l, u = cell.lower[joint], cell.upper[joint]
        value = float(np.tan((np.arctan(l) + np.arctan(u)) / 2)) if self._area.scene.revolute[joint] else float((l + u) / 2)
        return value if l < value < u else None

    def _turn(self, cell: _Cell) -> Array:
        turn: Array = np.where(
            self._area.scene.revolute, 2 * (np.arctan(cell.upper) - np.arctan(cell.lower)), (cell.upper - cell.lower) / self._extent
        )
        return turn

    def _settle(self, cell: _Cell, report: Report, seed: int) -> tuple[int, Array] | None:
        """Settles a cell, or returns the joint to cut it in and its points."""
        polytope, n = self._area.polytope, len(cell.lower)
        C, d = self._faces(cell)
        start = cell.points.mean(axis=0) if len(cell.points) > n else None
        if start is None or (d - C @ start).min() < 1e-7 * cell.half.min():
            start = self._inside(cell, C, d)
            if start is None:
                return None
        rng = np.random.default_rng(seed)
        targets = np.where(rng.random((CORNERS if self._corners is None else len(self._corners), n)) < 0.5, cell.lower, cell.upper)
        if self._corners is not None:
            targets[:, self.joints] = np.where(self._corners, cell.upper[self.joints], cell.lower[self.joints])
        X = np.concatenate([start[None], kernels.chords(C, d, start, targets, CHORDS, seed), cell.points])
        A, B = self._points(X)
        for _ in range(ROUNDS):
            u = np.ascontiguousarray((self._calm * (X - cell.mid) / cell.half)[:, self.joints])
            found, z, places, weights = kernels.separate(
                A, B, u, self._radii[0] / self._extent, self._radii[1] / self._extent, np.arange(len(X)), LEAST, ENOUGH
            )
            if not found:
                return self._inseparable(cell, report, X, X[places], weights)
            plane = self._bounded(cell, self._in_s(cell, z))
            result = self._prove(cell, plane, polytope.C, polytope.d)
            if isinstance(result, Streams):
                cell.node.kind, cell.node.plane, cell.node.streams = PLANE, plane, result
                return None
            if isinstance(result, int):
                return result, X
            worse = self._descend(plane, C, d, cell, result, rng)
            X = np.concatenate([X, worse])
            more_a, more_b = self._points(worse)
            A, B = np.concatenate([A, more_a]), np.concatenate([B, more_b])
        return self._spread(cell, X[places], weights), X

    def _inseparable(self, cell: _Cell, report: Report, X: Array, support: Array, weights: Array) -> tuple[int, Array] | None:
        """Keeps the cell open where the bodies touch; otherwise returns how to cut it."""
        contact = self._contact(cell, support)
        if contact is not None:
            report.contacts.append(contact)
            return None
        return self._spread(cell, support, weights), X

    def _contact(self, cell: _Cell, configurations: Array) -> Array | None:
        """Returns a contact in the cell, looked for from the configuration (of some, (w, n)) at which the bodies are nearest.

        In every step a linear program moves to where the bodies would be nearest if the points that are nearest now stayed so.
        """
        kinematics, n = self._area.kinematics, len(cell.lower)
        pairs = [closest(a, b) for a, b in zip(*self.vertices(configurations), strict=True)]
        place = int(np.argmin([pair.distance for pair in pairs]))
        s, nearest = configurations[place], pairs[place]
        if nearest.distance > self.reach + CLOSE * self._extent:
            return None
        (a, b), (C, d), reach = self._volumes, self._faces(cell), cell.half.copy()
        for _ in range(STEPS):
            if not nearest.gap > self.reach:
                return s
            step = 1e-6 * cell.half
            around = np.concatenate([s + np.diag(step), s - np.diag(step)])
            p_a, p_b = (
                np.einsum("v,nvi->ni", w / w.sum(), kinematics.points(self.frame, volume.body, volume.vertices, around))
                for volume, w in zip((a, b), nearest.weights, strict=True)
            )
            gap = (p_a - p_b) @ nearest.normal
            slope = np.where(np.isin(np.arange(n), self.joints), (gap[:n] - gap[n:]) / (2 * step), 0.0)
            bounds = np.column_stack([np.maximum(cell.lower, s - reach), np.minimum(cell.upper, s + reach)])
            found = linprog(slope, A_ub=C[: -2 * n], b_ub=d[: -2 * n], bounds=bounds, method="highs")
            if found.status != 0:
                return None
            tried = s + np.linspace(1.0, 0.2, 5)[:, None] * (found.x - s)
            further = [closest(*points) for points in zip(*self.vertices(tried), strict=True)]
            best = int(np.argmin([pair.distance for pair in further]))
            if further[best].distance >= nearest.distance - 1e-4 * self._extent:
                return None
            s, nearest, reach = tried[best], further[best], reach / 2
        return None if nearest.gap > self.reach else s

    def _spread(self, cell: _Cell, support: Array, weights: Array) -> int:
        """Returns the joint in which the points that no plane separates lie farthest apart."""
        q = np.where(self._area.scene.revolute, 2 * np.arctan(support), support / self._extent)
        mean = weights @ q / weights.sum()
        spread = weights @ (q - mean) ** 2
        wide = self._turn(cell) > NARROW / 2
        return max(self.joints, key=lambda j: float(spread[j]) if wide[j] else -1.0)

    def _inside(self, cell: _Cell, C: Array, d: Array) -> Array | None:
        """Returns a point of the polytope in the cell; None, after the node was settled, where there is none."""
        n = len(cell.lower)
        norms = np.linalg.norm(C, axis=1)
        found = linprog(np.append(np.zeros(n), -1.0), A_ub=np.column_stack([C, norms]), b_ub=d, bounds=(None, None), method="highs")
        if found.status != 0:
            raise np.linalg.LinAlgError(f"no point of a cell was found: {found.message}")
        if found.x[-1] > -1e-9:
            return np.asarray(found.x[:-1])
        y = np.maximum(-found.ineqlin.marginals[: len(d) - 2 * n], 0.0)
        faces = np.flatnonzero(y > 1e-9 * y.max())
        values = (y[faces] / y.max()).astype(np.float32)
        slope = values @ C[faces]
        if slope @ cell.mid - np.abs(slope) @ cell.half - values @ d[faces] > 1e-9 * (values @ np.abs(d[faces]) + 1):
            streams = Streams(np.zeros(0, np.int8), np.array([len(faces)], np.int16), faces.astype(np.int16), values)
            cell.node.kind, cell.node.streams = EMPTY, streams
            return None
        return np.asarray(found.x[:-1])

    def _in_s(self, cell: _Cell, z: Array) -> Array:
        """Returns a plane in the frame, metres and s from one in the coordinates of the search, (4, 1 + k)."""
        plane = z.reshape(4, -1).copy()
        plane[:3] /= self._extent
        plane[3] -= self._middle @ plane[:3]
        plane[:, 1:] *= self._calm / cell.half[self.joints]
        plane[:, 0] -= plane[:, 1:] @ cell.mid[self.joints]
        return plane / np.abs(plane[:3]).max()

    def _prove(self, cell: _Cell, plane: Array, C: Array, d: Array) -> Streams | Array | int:
        cutting = np.flatnonzero(d - C @ cell.mid - np.abs(C) @ cell.half < 0)
        found = []
        for side in self._sides:
            self._last = side
            result = side.prove(plane, cell.lower, cell.upper, C[cutting], d[cutting], cutting, self._pieces)
            if not isinstance(result, Streams):
                return result
            found.append(result)
        return joined(found)

    def _bounded(self, cell: _Cell, plane: Array) -> Array:
        """Returns the plane with a bound of its normal's length below, (5, 1 + k), which is affine in s and holds on the cell.

        The length is convex, so a bound of it at the corners is enough. Its slopes are the mean differences between the corners.
        """
        bound = np.zeros(plane.shape[1])
        if max(self._radii) > 0:
            J = self.joints
            corners = np.array(list(itertools.product((-1.0, 1.0), repeat=len(J)))).reshape(-1, len(J))
            s = cell.mid[J] + corners * cell.half[J]
            lengths = np.linalg.norm(plane[:3, :1] + plane[:3, 1:] @ s.T, axis=0) * (1 + 1e-9)
            slopes = lengths @ corners / len(corners)
            bound[1:] = slopes / cell.half[J]
            bound[0] = (lengths - s @ bound[1:]).max() + 1e-12 * (lengths.max() + np.abs(s @ bound[1:]).max())
        return np.vstack([plane, bound])

    def _descend(self, plane: Array, C: Array, d: Array, cell: _Cell, start: Array, rng: np.random.Generator) -> Array:
        """Returns points of the polytope and the cell that lie ever farther on the wrong side, beginning at one that does."""
        n = len(start)
        found, least = [start], np.inf
        for _ in range(DESCENT):
            ways = np.concatenate([np.diag(cell.half), -np.diag(cell.half), rng.normal(size=(12, n)) * cell.half])
            ends = kernels.chords(C, d, found[-1], found[-1] + 2 * ways, 0, 0)
            X = np.concatenate([ends, (ends + found[-1]) / 2])
            normals = np.einsum("ie,ne->ni", plane[:4], np.column_stack([np.ones(len(X)), X[:, self.joints]]))
            volume = self._last.volume
            points = self._area.kinematics.points(self.frame, volume.body, volume.vertices, X)
            values = self._last.sign * (np.einsum("nvc,nc->nv", points, normals[:, :3]) + normals[:, 3, None])
            reach = self._last.radius * np.linalg.norm(normals[:, :3], axis=1)
            worst = values.min(axis=1) - reach
            if not worst.min() < least:
                break
            least = float(worst.min())
            found.append(X[worst.argmin()])
        return np.array(found)

    def vertices(self, X: Array) -> tuple[Array, Array]:
        """Returns where the vertices are at points (N, n), in the frame, in metres."""
        a, b = (self._area.kinematics.points(self.frame, volume.body, volume.vertices, X) for volume in self._volumes)
        return a, b

    def _points(self, X: Array) -> tuple[Array, Array]:
        a, b = ((points - self._middle) / self._extent for points in self.vertices(X))
        return np.ascontiguousarray(a), np.ascontiguousarray(b)
