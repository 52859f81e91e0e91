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

If F(alpha) >= t D(alpha) for all alpha and t >= 0, the same argument gives f >= t on the piece. The volumes are (t_A + t_B)/max |a| apart
then.
"""

from __future__ import annotations

from collections.abc import Iterator

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

TOGETHER = 1 << 18
"""About so many control values are computed at once."""
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

    def prepared(self, proof: PartitionProof) -> CellCheck:
        """Checks what a proof says before its first cell, and returns what checks its cells.

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
        return CellCheck(scene, self._ground, Box.of(self._lower, self._upper), self._lower, self._upper, proof)


class CellCheck:
    """Checks the cells of one proof, in any order.

    Raises:
        ProofError: the streams of the proof make no sense, or are too large.
    """

    def __init__(self, scene: Scene, ground: Ground, box: Box, lower: Array, upper: Array, proof: PartitionProof) -> None:
        kinematics = ExactKinematics.by_joint(scene)
        chains = [[joint.index for joint, _ in kinematics.path(proof.frame, v.body) if joint.index is not None] for v in proof.all_volumes]
        self._play = sorted(set().union(*chains))
        if max(map(len, chains)) > limits.CHAIN or len(self._play) > limits.PLAY:
            most = f"{limits.CHAIN} between the frame and a body, {limits.PLAY} in all"
            raise ProofError("proof_too_large", f"{proof.title}: {list(map(len, chains))} joints in play; at most {most} are checked")
        self._proof, self._box, self._lower, self._upper = proof, box, lower, upper
        self._cuts = Cuts(proof, self._play)
        self._pieces = Pieces(proof, len(self._play))
        self._multipliers = Multipliers(proof, ground)

        # Volumes that no cell chooses cost nothing here, however many vertices a stranger gives them.
        used = {choice: proof.chosen[choice] for choice in np.unique(proof.choices).tolist()}
        wanted = {id(volume) for volumes in used.values() for volume in volumes}
        positive, negative = (
            {
                id(volume): Side(kinematics, proof.frame, volume, _not_less(volume.radius, scene.padding), sign, self._play)
                for volume in (own, *coarse)
                if id(volume) in wanted
            }
            for own, coarse, sign in zip(proof.volumes, proof.coarse, (1.0, -1.0), strict=True)
        )
        self._sides = {choice: (positive[id(first)], negative[id(second)]) for choice, (first, second) in used.items()}
        self._rounded = {choice: scene.padding > 0 or first.radius > 0 or second.radius > 0 for choice, (first, second) in used.items()}

    def cells(self, most: int) -> Iterator[Cells]:
        """Yields all cells, at most ``most`` at a time, which :meth:`gap` checks.

        Raises:
            ProofError: the cuts do not divide the box.
        """
        return self._cuts.cells(self._lower[self._play], self._upper[self._play], most)

    def gap(self, cells: Cells) -> float:
        """Checks some cells and returns a lower bound in metres of the bodies' distance in them; infinity where they all miss the polytope.

        Raises:
            ProofError: the proof does not hold in one of them.
        """
        self._check_empty(cells)
        least, with_plane = np.inf, np.flatnonzero(~cells.empty)
        choices = self._proof.choices[cells.plane[with_plane]]
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused
            for choice, sides in self._sides.items():
                same = with_plane[choices == choice]
                together = max(1, TOGETHER // max(*(side.vertices * side.entries for side in sides), 2 ** len(self._play)))
                for first in range(0, len(same), together):
                    least = min(least, self._gap(cells, same[first : first + together], choice))
        return least

    def _check_empty(self, cells: Cells) -> None:
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
            step = max(1, TOGETHER // side.entries)
            margin = np.full(len(some), np.inf)
            for first in range(0, side.vertices, step):
                part = slice(first, first + step)
                control = side.control(lower, upper, Z, part)
                margin = np.minimum(margin, self._side_margins(side, name, control, number, start[:, part], first))
            margins += margin
        return float((margins / norms).min() * _DOWN)

    def _side_margins(self, side: Side, name: str, control: Control, number: np.ndarray, start: np.ndarray, vertex: int) -> Array:
        """Checks some vertices of a volume in B cells and returns, (B,), t with f >= t, infinite where a cell misses the polytope.

        Args:
            name: what the volume stands for, for errors.
            number: (B,) of the cells.
            start: (B, V) where the vertices' trees begin.
            vertex: number of the first one.
        """
        divided = self._pieces.kind(start) >= 0
        margins = self._margins(side, name, control, number, np.where(divided, -1, start), vertex)
        for box in np.flatnonzero(divided.any(axis=1)).tolist():
            vertices = np.flatnonzero(divided[box])
            parts: dict[int, int] = {}
            for at in start[box, vertices]:
                parts |= self._pieces.upper_parts(int(at))
            pending = [(0, control.part(box, vertices), start[box, vertices], vertices)]
            while pending:
                depth, piece, at, which = pending.pop()
                kind = self._pieces.kind(at)
                ends = np.flatnonzero(kind < 0)
                if ends.size:
                    found = self._margins(side, name, piece.part(0, ends), number[box : box + 1], at[None, ends], vertex + which[ends])
                    margins[box] = min(margins[box], found[0])
                for axis in np.unique(kind[kind >= 0]).tolist():
                    if depth == limits.PIECE_DEPTH:
                        most = limits.PIECE_DEPTH
                        raise ProofError("proof_too_large", f"{self._proof.title}: a piece is halved more than {most} times")
                    same = np.flatnonzero(kind == axis)
                    low, high = piece.part(0, same).halves(axis)
                    upper = np.array([parts[int(x)] for x in at[same]])
                    pending += [(depth + 1, high, upper, which[same]), (depth + 1, low, at[same] + 1, which[same])]
        return margins

    def _margins(self, side: Side, name: str, control: Control, number: np.ndarray, at: np.ndarray, vertex: int | np.ndarray) -> Array:
        """Checks pieces, (B, V), given by their places in the stream, -1 where there is none; returns the least t of each cell, (B,)."""
        here = at >= 0
        z0 = here & (self._pieces.kind(at) == PLANE)
        sums = self._multipliers.of_pieces(number[:, None], np.where(here, self._pieces.rank(at), -1))
        F, bound = side.values(control, z0.astype(float), sums, self._box)
        F -= bound[..., None]
        proved = ~here | ((F > 0).all(axis=-1) & np.isfinite(F).all(axis=-1))
        for box, v in np.argwhere(~proved):
            which = vertex[v] if isinstance(vertex, np.ndarray) else vertex + v
            what = "the multipliers do not prove that it is on its side of the plane there, or that the piece misses the polytope"
            raise self._refused(f"cell {number[box]}, vertex {which} of {name}, piece {self._pieces.rank(at[box, v])}", what)
        D = control.dt[:, None, 0]
        D = D + rounding(control.dt_size[:, :1, None], np.zeros(1))
        t = np.where((D > 0) & z0[..., None], F / np.where(D > 0, D, 1.0), np.inf)
        margins: Array = t.min(axis=(1, 2)) * _DOWN
        return margins

    def _refused(self, where: str, why: str) -> ProofError:
        return ProofError("proof_cell", f"{self._proof.title}: {where}: {why}")


def _norms(plane: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Returns of B boxes an upper bound of |a|, at least LEAST, and a lower bound of kappa - |a| over the corners.

    Both |a| and |a| - kappa are convex, so what holds at the corners holds on the box.

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
