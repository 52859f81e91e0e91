"""The verifier checks a pair's proof over a partition (certifier.proof.partition) here.

The cells of the cuts cover the box of the ground, which certifier.verify.pair proves to contain the polytope P. So it is enough that
planes separate the volumes on P in every cell. The verifier shows, for every vertex of a volume with radius r and every piece of the cell,

    den (z0 f - sum_j lambda_j g_j)  >  0,   f = +-(a'p + b) - r kappa,   lambda_j >= 0,   g_j = d_j - C_j s >= 0 on P,

by control values that are larger than the bound of their rounding errors (certifier.verify.control_points). With z0 = 1, f > 0 wherever the
piece meets P; with z0 = 0, it does not meet P, because there -sum_j lambda_j g_j <= 0. Halvings cover the cell with pieces, so every vertex
with its ball is on its side of the plane, as kappa >= |a| on the cell: kappa is affine and |a| is convex, so it is enough to compare them
at the corners, where what is computed is rounded in the same manner. A leaf without a plane is a cell that misses P: over its box,
-sum_j lambda_j g_j > 0.

The volumes of a cell are the two of the proof, or coarse ones in their places, which contain the same geometries there at all angles of the
joints that they leave out (certifier.verify.coarse).

The lower part of an oblique cut of a map is such a cell, too, with the cut as its face: P is the half-space there. The upper part is
checked as if the cell had not been cut.

If F(alpha) >= t D(alpha) for all alpha and t >= 0, the same argument gives f >= t on the piece. The volumes are (t_A + t_B)/max |a| apart
then.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from certifier.errors import ProofError
from certifier.model import Array, Scene, Volume
from certifier.proof import limits
from certifier.proof.ground import Ground
from certifier.proof.partition import PLANE, PartitionProof
from certifier.verify.coarse import check_coarse
from certifier.verify.control_points import LEAST, Box, Control, Side, rounding
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.streams import Cells, Cuts, Multipliers, Pieces
from certifier.verify.volume import check_volume

TOGETHER = 1 << 19
"""About this many control values are computed at once, so that NumPy's calls are cheap; up to 2 PIECE_DEPTH times as many may wait."""
CORNERS = 1 << 18
"""About this many corners of cells are looked at at once."""
_BARE, _END = -2, -1
"""Pieces that are halved no more have these axes: those with z0 = 1 and without multipliers, and others."""
_TINY = 2.0**-1000
"""Values of D that are not positive count as this: they bound no distance."""
_DOWN, _UP = 1 - 2.0**-40, 1 + 2.0**-40
"""These factors round a few operations down and up."""


class PartitionCheck:
    """Checks proofs that share one ground, which certifier.verify.pair.check_ground has accepted.

    Args:
        contained: volumes that are known to contain their geometries, by id. The checks of one scene may share it.
        coarse: coarse volumes that are known to contain their geometries, in the same manner.
    """

    def __init__(self, scene: Scene, ground: Ground, contained: dict[int, Volume], coarse: dict[int, Volume]) -> None:
        self._scene, self._ground = scene, ground
        self._contained, self._coarse = contained, coarse
        self._lower = np.nextafter(ground.mid - ground.half, np.inf)
        self._upper = np.nextafter(ground.mid + ground.half, -np.inf)

    def prepared(self, proof: PartitionProof, roots: Sequence[tuple[Array, Array]] | None = None) -> CellCheck:
        """Checks what a proof says before its first cell, and returns what checks its cells.

        Args:
            roots: the cells that the proof has a tree for each, as bounds of all joints, (n,) each; None for the box of the ground.

        Raises:
            ProofError: the proof makes no sense on the ground.
        """
        scene = self._scene
        if proof.scene.hash != scene.hash:
            raise ProofError("proof_scene", "the proof is about another scene")
        if not proof.pairs:
            raise ProofError("proof_pair", f"{proof.title} are not a pair of the scene")
        if proof.frame not in scene.bodies:
            raise ProofError("proof_frame", f"the scene has no body {proof.frame!r}")
        kinematics = ExactKinematics.at(scene, [])
        for volume, coarse in zip(proof.volumes, proof.coarse, strict=True):
            if id(volume) not in self._contained:
                check_volume(scene, kinematics, volume)
                self._contained[id(volume)] = volume
            for other in coarse:
                if other.geometries != volume.geometries:
                    raise ProofError("proof_volume", f"{proof.title}: a coarse volume has other geometries than the one that it stands for")
                if id(other) not in self._coarse:
                    check_coarse(scene, kinematics, other)
                    self._coarse[id(other)] = other
        roots = [(self._lower, self._upper)] if roots is None else roots
        return CellCheck(scene, self._ground, Box.of(self._lower, self._upper), self._lower, self._upper, proof, roots)


class CellCheck:
    """Checks the cells of one proof, in any order.

    Raises:
        ProofError: the streams of the proof make no sense, or are too large.
    """

    def __init__(
        self,
        scene: Scene,
        ground: Ground,
        box: Box,
        lower: Array,
        upper: Array,
        proof: PartitionProof,
        roots: Sequence[tuple[Array, Array]],
    ) -> None:
        kinematics = ExactKinematics.by_joint(scene)
        chains = [kinematics.positions(proof.frame, volume.body) for volume in proof.all_volumes]
        self._play = sorted(set().union(*chains))
        if max(map(len, chains)) > limits.CHAIN or len(self._play) > limits.PLAY:
            most = f"{limits.CHAIN} between the frame and a body, {limits.PLAY} in all"
            raise ProofError("proof_too_large", f"{proof.title}: {list(map(len, chains))} joints in play; at most {most} are checked")
        self._proof, self._box, self._lower, self._upper = proof, box, lower, upper
        self._cuts = Cuts(proof, self._play, len(roots))
        self._roots = [(lower[self._play], upper[self._play]) for lower, upper in roots]
        self._pieces = Pieces(proof, len(self._play))
        self._multipliers = Multipliers(proof, ground, self._pieces)

        # Volumes that no cell chooses cost nothing here, however many vertices a stranger gives them.
        padding = scene.padding_between(proof.volumes)
        used = {choice: proof.chosen[choice] for choice in np.unique(proof.choices).tolist()}
        wanted = {id(volume) for volumes in used.values() for volume in volumes}
        positive, negative = (
            {
                id(volume): Side(kinematics, proof.frame, volume, _not_less(volume.radius, padding), sign, self._play)
                for volume in (own, *coarse)
                if id(volume) in wanted
            }
            for own, coarse, sign in zip(proof.volumes, proof.coarse, (1.0, -1.0), strict=True)
        )
        self._sides = {choice: (positive[id(first)], negative[id(second)]) for choice, (first, second) in used.items()}
        self._rounded = {choice: padding > 0 or first.radius > 0 or second.radius > 0 for choice, (first, second) in used.items()}

    def cells(self, most: int) -> Iterator[Cells]:
        """Yields all cells but those that are open, at most ``most`` at a time, which :meth:`gap` checks.

        Raises:
            ProofError: the cuts do not divide the box.
        """
        return self._cuts.cells(self._roots, most)

    def gap(self, cells: Cells) -> float:
        """Checks some cells and returns a lower bound in metres of the bodies' distance in them; infinity where they all miss the polytope.

        Raises:
            ProofError: the proof does not hold in one of them.
        """
        self._check_empty(cells)
        least, with_plane = np.inf, np.flatnonzero(~cells.empty)
        choices = self._proof.choices[cells.plane[with_plane]]
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused
            for choice in self._sides:
                same = with_plane[choices == choice]
                together = max(1, CORNERS >> len(self._play))
                for first in range(0, len(same), together):
                    least = min(least, self._gap(cells, same[first : first + together], choice))
        return least

    def _check_empty(self, cells: Cells) -> None:
        """Checks that the cells without a plane miss the polytope: on them, -sum_j lambda_j g_j = lambda'C s - lambda'd > 0.

        Its least value over a box is a sum over at most 64 joints of products with one end of each range, less lambda'd. M multipliers make
        M + 1 roundings in C and d, and this sum 66 more: fewer than those that the bound has. It is NaN or infinite where numbers are too
        large, and then compares as false.

        Raises:
            ProofError: they may not.
        """
        empty = np.flatnonzero(cells.empty)
        if not empty.size:
            return
        lower, upper = np.tile(self._lower, (len(empty), 1)), np.tile(self._upper, (len(empty), 1))
        lower[:, self._play], upper[:, self._play] = cells.lower[empty], cells.upper[empty]
        sums = self._multipliers.of_empty(cells.number[empty], self._pieces.before(cells.plane[empty]))
        value = np.minimum(sums.slope * lower, sums.slope * upper).sum(axis=1) - sums.offset
        size = LEAST + sums.offset_size + (sums.slope_size * np.maximum(np.abs(lower), np.abs(upper))).sum(axis=1)
        for i in np.flatnonzero(~(value > rounding(size, sums.count)) | ~np.isfinite(value)):
            raise self._refused(f"cell {cells.number[empty[i]]}", "the multipliers do not prove that it misses the polytope")

    def _gap(self, cells: Cells, some: np.ndarray, choice: int) -> float:
        """Checks some cells with planes, all of this choice, and returns their least gap."""
        lower, upper, number, plane = cells.lower[some], cells.upper[some], cells.number[some], cells.plane[some]
        Z = self._proof.planes[plane]
        norms, room = _norms(Z, lower, upper)
        for cell in np.flatnonzero(~np.isfinite(norms)):
            raise self._refused(f"cell {number[cell]}", "the plane's numbers are too large")
        if self._rounded[choice]:
            for cell in np.flatnonzero(~(room >= 0)):
                raise self._refused(f"cell {number[cell]}", "kappa does not bound the plane's normal")
        margins = np.zeros(len(some))
        for i, side in enumerate(self._sides[choice]):
            start = self._pieces.start(plane, choice, i)
            name = ", ".join(self._proof.volumes[i].geometries)
            margin = np.full(len(some), np.inf)
            step, vertices = max(1, TOGETHER // (side.vertices * side.entries)), max(1, TOGETHER // side.entries)
            for first, vertex in itertools.product(range(0, len(some), step), range(0, side.vertices, vertices)):
                part, these = slice(first, first + step), slice(vertex, vertex + vertices)
                control = side.control(lower[part], upper[part], Z[part], these)
                found = self._side_margins(side, name, control, number[part], start[part, these], vertex)
                margin[part] = np.minimum(margin[part], found)
            margins += margin
        return float((margins / norms).min() * _DOWN)

    def _side_margins(self, side: Side, name: str, control: Control, number: np.ndarray, start: np.ndarray, vertex: int) -> Array:
        """Checks some vertices of a volume in B cells and returns, (B,), t with f >= t, infinite where a cell misses the polytope.

        Pieces that have been halved equally often are halved together, each along its axis.

        Args:
            name: what the volume stands for, for errors.
            number: (B,) of the cells.
            start: (B, V) where the vertices' trees begin.
            vertex: number of the first one.
        """
        margins, together = np.full(len(number), np.inf), max(1, TOGETHER // side.entries)
        cells, vertices = (x.reshape(-1) for x in np.indices(start.shape))
        pending = [(0, self._sorted([control.single()], number, start.reshape(-1), cells, vertices))]
        self._pieces.find_upper_parts(start)
        while pending:
            depth, batch = pending.pop()
            halves: list[tuple[Control, np.ndarray, np.ndarray, np.ndarray]] = []
            for axis in np.unique(batch.axis).tolist():
                part = batch.some(slice(*np.searchsorted(batch.axis, [axis, axis + 1])))
                if axis < 0:
                    np.minimum.at(margins, part.cell, self._margins(side, name, part, number, vertex))
                    continue
                if depth == limits.PIECE_DEPTH:
                    most = limits.PIECE_DEPTH
                    raise ProofError("proof_too_large", f"{self._proof.title}: a piece is halved more than {most} times")
                low, high = part.control.halves(axis)
                halves.append((low, part.at + 1, part.cell, part.vertex))
                halves.append((high, self._pieces.upper_part(part.at), part.cell, part.vertex))
            if halves:
                controls, *rest = zip(*halves, strict=True)
                batch = self._sorted(controls, number, *map(np.concatenate, rest))
                parts = [slice(i, i + together) for i in range(0, len(batch.at), together)]
                pending += [(depth + 1, batch.some(part)) for part in reversed(parts)]  # those that are halved no more come first
        return margins

    def _sorted(self, controls: Sequence[Control], number: np.ndarray, at: np.ndarray, cell: np.ndarray, vertex: np.ndarray) -> _Batch:
        """Returns pieces sorted by what happens to them, so that those to which the same happens are slices of arrays."""
        kind = self._pieces.kind(at)
        bare = (kind == PLANE) & (self._multipliers.count(number[cell], self._pieces.rank(at)) == 0)
        axis = np.where(bare, _BARE, np.where(kind < 0, _END, kind)).astype(int)
        order = np.argsort(axis, kind="stable")
        return _Batch(Control.together(controls, np.argsort(order)), *(x[order] for x in (axis, at, cell, vertex)))

    def _margins(self, side: Side, name: str, batch: _Batch, number: np.ndarray, vertex: int) -> Array:
        """Checks P pieces that are halved no more, and returns of each, (P,), t with f >= t, infinite where it misses the polytope.

        F less its bound is at most what F stands for, and D with its bound is at least what D stands for, but for the rounding of one
        difference and one sum. These are parts of the results, and _DOWN makes them good. So F >= t D where D is positive; where it is
        not, any t > 0 does. F that is NaN or infinite is not below infinity, or not above 0.
        """
        z0, number, rank = self._pieces.kind(batch.at) == PLANE, number[batch.cell], self._pieces.rank(batch.at)
        sums = self._multipliers.of_pieces(number[:, None], rank[:, None])
        F, bound = (x[:, 0] for x in side.values(batch.control, z0[:, None].astype(float), sums, self._box))
        F -= bound[:, None]
        finite = F.max(axis=1) < np.inf
        D = batch.control.den[-1] + rounding(batch.control.dt_size[:, :1], np.zeros(1))
        F /= D if (batch.control.factors > 0).all() else np.maximum(D, _TINY)
        t = F.min(axis=1)
        for i in np.flatnonzero(~((t > 0) & finite)):
            where = f"cell {number[i]}, vertex {vertex + batch.vertex[i]} of {name}, piece {rank[i]}"
            what = "the multipliers do not prove that it is on its side of the plane there, or that the piece misses the polytope"
            raise self._refused(where, what)
        return np.where(z0, t * _DOWN, np.inf)

    def _refused(self, where: str, why: str) -> ProofError:
        return ProofError("proof_cell", f"{self._proof.title}: {where}: {why}")


class _Batch(NamedTuple):
    """Holds P pieces of one vertex each.

    Attributes:
        control: of the pieces.
        axis: (P,) along which each is halved, _BARE or _END; ascending.
        at: (P,) where they are in the stream.
        cell: (P,) number of the cell, among those that are checked together.
        vertex: (P,) number of the vertex, in the same manner.
    """

    control: Control
    axis: np.ndarray
    at: np.ndarray
    cell: np.ndarray
    vertex: np.ndarray

    def some(self, pieces: slice) -> _Batch:
        return _Batch(self.control.some(pieces), self.axis[pieces], self.at[pieces], self.cell[pieces], self.vertex[pieces])


def _norms(plane: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Returns of B boxes an upper bound of |a|, at least LEAST, and a lower bound of kappa - |a| over the corners.

    Both |a| and |a| - kappa are convex, so what holds at the corners holds on the box. A value there is a sum of 1 + PLAY products, with
    fewer than 2^6 roundings. The error has room for more than 2^9 of them, so also for the two differences behind it. It is at least
    2^-83, whose square does not underflow. Squares, their sum and the root are rounded by a part that _UP makes good.

    Args:
        plane: (B, 5, 1 + k), the three rows of a, that of b, and kappa, all affine in s.
    """
    plane = plane[:, [0, 1, 2, 4]]
    moving = np.flatnonzero((plane[:, :, 1:] != 0).any(axis=(0, 1)))
    values, size = plane[:, :, :1], np.abs(plane[:, :, :1])
    for i in moving:
        a = plane[:, :, 1 + i, None]
        l, u = lower[:, None, i, None], upper[:, None, i, None]
        values = np.concatenate([values + a * l, values + a * u], axis=2)
        size = size + np.abs(a) * np.maximum(np.abs(l), np.abs(u))
    error = rounding(size + LEAST, np.zeros(1))
    norms: Array = np.sqrt(((np.abs(values) + error)[:, :3] ** 2).sum(axis=1)) * _UP
    return norms.max(axis=1), (values[:, 3] - error[:, 3] - norms).min(axis=1)


def _not_less(radius: float, padding: float) -> float:
    """Returns a double that is no less than the sum of two that are not negative."""
    total = radius + padding
    return total if exact(total) >= exact(radius) + exact(padding) else float(np.nextafter(total, np.inf))
