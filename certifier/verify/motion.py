"""The verifier checks here that a motion is free of collisions, and a tube about it (docs/algorithm.md, 11).

In an interval of time from t0 to t1, of length h, a point p moves on a curve that stays within h^2/8 times the largest |p''| of the chord
from p(t0) to p(t1). A plane is constant in the frame that the proof names. If it has all vertices of a on one side and all of b on the
other at t0 and at t1, with room for these bulges, for the radii and paddings, for the tube and for what doubles are wrong by, it keeps the
bodies apart in all of the interval. The bounds of |p''| and of the tube are computed here, from the scene and the control points alone.

What a plane leaves is computed as follows. Its normal n is a double and exact, of a length from 0.5 to 2. The projections n'(R v + p) of
the vertices are wrong by at most |n| times the bound of certifier.verify.chains. So their sum over |n| is wrong by both bodies' bounds,
which are part of what is needed. |n| is wrong by a part of itself, as each quotient, sum and difference here is, whose parts UP makes good:
a sum that is divided by too much is positive, or else the plane fails; what is needed is a sum of numbers that are not negative; and the
last difference is divided by UP. A comparison with NaN fails, so no NaN passes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from certifier.errors import ProofError
from certifier.model import Array, Scene
from certifier.proof import limits
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.verify.chains import UP, poses
from certifier.verify.conditions import conditions
from certifier.verify.decimals import exactly, rounded_down
from certifier.verify.pieces import Pieces
from certifier.verify.scene import check_scene, following
from certifier.verify.sides import Known, Sides
from certifier.verify.uncovered import not_covered
from certifier.words import with_units

BLOCK = 1 << 14
"""At most this many intervals are looked at together."""
PRODUCTS = 1 << 20
"""At most this many vertices, each at one time, are looked at together."""


@dataclass(frozen=True)
class MotionStatement:
    """States what a valid proof proves.

    Attributes:
        end: the time of the motion's last piece up to which it is proved; 1 for all of it.
        rho: the tube, radians or metres; 0 where the motion itself is all that is proved.
        gap: a lower bound in metres of the distance between the two padded bodies of every pair, all along the motion and in the tube.
    """

    scene: Scene
    motion: Motion
    end: float
    rho: float
    gap: float

    def lines(self) -> list[str]:
        """Returns the statement in plain words, without the scene."""
        motion, scene = self.motion, self.scene
        start, end = (_place(scene, motion, i) for i in (0, -1))
        names = ", ".join(f"'{joint.name}'" for joint in scene.moving)
        pairs = len(scene.body_pairs)
        every = "the scene's one pair" if pairs == 1 else f"each of the scene's {pairs} pairs"
        digest = hashlib.sha256(np.ascontiguousarray(motion.controls).tobytes()).hexdigest()
        part = "all along it" if self.end == 1.0 else f"from its beginning to the part {exactly(self.end)} of its last piece"
        tube = f"at every configuration whose joints are within {exactly(self.rho)} rad or m of this at a time, all one number"
        if motion.degree == 1:
            points, what = "waypoints", f"through {len(motion.controls)} waypoints, straight in {motion.space.value} from each to the next"
        else:
            points, what = "control points", f"of {motion.pieces} polynomial pieces of degree {motion.degree} in {motion.space.value}"
        return [
            f"a motion {what}:",
            f"  joints {names}, all {points} within their limits",
            *following(scene),
            f"  from {start}",
            f"  to {end}",
            f"  SHA-256 of the {points} as doubles: {digest}",
            f"{part} the padded bodies of {every} are at least {rounded_down(self.gap)} m apart",
            *([f"and {tube}, beyond the limits as well"] if self.rho else []),
            *conditions(scene, beyond_limits=self.rho > 0),
            *not_covered(scene),
        ]


def _place(scene: Scene, motion: Motion, index: int) -> str:
    """Returns a control point in words. Of coordinates s, those of joints that turn have no unit, so it gives none."""
    texts = [exactly(x) for x in motion.controls[index]]
    return f"q = {with_units(texts, scene.units)}" if motion.space is Space.Q else f"s = {', '.join(texts)}"


class MotionVerifier:
    """Checks proofs about motions in one scene. What it computes about the scene is kept for the next proof.

    Args:
        scene: it must not change.

    Raises:
        ProofError: the model makes no sense.
    """

    def __init__(self, scene: Scene) -> None:
        check_scene(scene)
        self._scene, self._known = scene, Known(scene)

    def verify(self, proof: MotionProof) -> MotionStatement:
        """Checks a proof about a motion in the scene and returns what it proves.

        Raises:
            ProofError: the proof does not hold.
        """
        if proof.scene is not self._scene:
            raise ProofError("proof_motion", "the proof is about another scene")
        proof.check_shapes()
        _check_motion(proof)
        _check_intervals(proof)
        gap = min(_Check(proof, self._known).gaps(), default=np.inf)
        if not 0 < gap < np.inf:
            raise ProofError("proof_motion", "the scene has no pair to keep apart")
        return MotionStatement(self._scene, proof.motion, proof.end, proof.rho, float(gap))


def verify_motion(proof: MotionProof) -> MotionStatement:
    """Checks a proof about a motion and returns what it proves.

    Raises:
        ProofError: the proof does not hold.
    """
    return MotionVerifier(proof.scene).verify(proof)


def _check_motion(proof: MotionProof) -> None:
    """Checks that the control points are within the joint limits, as then all of the motion is, and that the tube is one."""
    scene, controls = proof.scene, proof.motion.controls
    if not (np.isfinite(controls).all() and np.abs(controls).max(initial=0.0) <= limits.MAGNITUDE):
        raise ProofError("proof_motion", f"a control point has a number larger than {limits.MAGNITUDE:g}")
    lower, upper = proof.motion.space.limits(scene)
    if not ((lower <= controls) & (controls <= upper)).all():
        raise ProofError("proof_motion", "a control point is not within the joint limits")
    if not 0 <= proof.rho <= limits.MAGNITUDE:
        raise ProofError("proof_motion", "the tube has no width")


def _check_intervals(proof: MotionProof) -> None:
    """Checks that intervals cover the motion up to its end, within limits, that frames are bodies, and normals nearly unit vectors."""
    scene, total = proof.scene, len(proof.ends)
    if total > limits.INTERVALS:
        raise ProofError("proof_too_large", f"the proof has {total} intervals; at most {limits.INTERVALS} are checked")
    if proof.frames.size and not (proof.frames.min() >= 0 and proof.frames.max() < len(scene.bodies)):
        raise ProofError("proof_motion", "a plane is in the frame of a body that is not there")
    counts = proof.counts.reshape(-1)
    last = proof.ends[np.cumsum(counts, dtype=np.int64) - 1].reshape(proof.counts.shape)
    covered = (last[:, :-1] == 1.0).all() and (last[:, -1] >= proof.end).all()
    if not (covered and 0 < proof.end <= 1 and (_starts(proof) < proof.ends).all() and (proof.ends <= 1.0).all()):
        raise ProofError("proof_motion", "the intervals do not cover the time of a piece from 0 to 1, one after the other")
    lengths = np.linalg.norm(proof.normals, axis=1)
    if not ((lengths > 0.5) & (lengths < 2.0)).all():
        raise ProofError("proof_motion", "a plane's normal is no unit vector")


def _starts(proof: MotionProof) -> Array:
    """Returns when each interval begins, (I,)."""
    starts = np.concatenate([[0.0], proof.ends[:-1]])
    counts = proof.counts.reshape(-1)
    starts[np.cumsum(counts, dtype=np.int64) - counts] = 0.0
    return starts


class _Check:
    """Checks the intervals of all pairs, some at a time. Those that need the same chain at the same time share its pose."""

    def __init__(self, proof: MotionProof, known: Known) -> None:
        self._proof, self._scene, self._known = proof, proof.scene, known
        self._pieces = Pieces(proof.scene, proof.motion, proof.rho)
        self._pairs, self._paddings = known.pairs, np.array([proof.scene.padding_of(pair) for pair in proof.scene.pairs])
        self._frames = proof.frames.astype(np.int64)
        self._starts = _starts(proof)
        self._count = proof.counts.sum(axis=1, dtype=np.int64)
        self._pair = np.repeat(np.arange(len(self._count)), self._count)
        self._piece = np.repeat(np.tile(np.arange(proof.motion.pieces), len(self._count)), proof.counts.reshape(-1))

    def gaps(self) -> Iterator[float]:
        """Yields, for some intervals at a time, how far the padded bodies are apart in them at least, in metres.

        Raises:
            ProofError: one of the planes does not keep them apart, or it takes too long to see whether they do.
        """
        if not len(self._count):
            return
        self._check_cost()
        sides, of = self._known.sides(np.tile(self._frames, 2), self._pairs.reshape(-1))
        of = of.reshape(2, -1)
        rank = np.empty(len(self._count), dtype=np.int64)
        rank[np.lexsort(sides.ways[of])] = np.arange(len(rank))
        order = np.argsort(rank[self._pair], kind="stable")  # intervals of pairs that are seen alike follow each other
        most = max(1, BLOCK // self._proof.motion.degree)
        for i in range(0, len(order), most):
            rows = order[i : i + most]
            yield self._gap(sides, of[:, self._pair[rows]], rows)

    def _check_cost(self) -> None:
        scene, proof = self._scene, self._proof
        joints = self._known.joints(np.tile(self._frames, 2), self._pairs.reshape(-1)).reshape(2, -1).sum(axis=0)
        cost = self._count * (self._known.vertices + limits.JOINT_COST * joints + scene.n * proof.motion.degree**2)
        if float(cost.sum(dtype=float)) > limits.SWEPT:
            raise ProofError("proof_too_large", "the intervals have more vertices, behind more joints, than are checked")

    def _gap(self, sides: Sides, of: np.ndarray, rows: np.ndarray) -> float:
        """Returns how far the padded bodies are apart at least in I intervals.

        Args:
            of: (2, I) the sides of a and of b.
            rows: (I,) the numbers of the intervals in the proof.
        """
        proof = self._proof
        normals, piece, t0, t1 = proof.normals[rows], self._piece[rows], self._starts[rows], proof.ends[rows]
        own = sides.of(of.reshape(-1))
        slid = own.slid(np.tile(self._pieces.slid[piece], (2, 1)))
        levers, error = own.levers(slid), own.errors(own.sizes(slid), self._pieces.inexact)
        rates, changes = (np.tile(bounds, (2, 1)) for bounds in self._pieces.rates(piece, t0, t1))
        bent = np.tile((t1 - t0) ** 2 / 8, 2) * own.accelerations(levers, rates, changes)
        needed = (own.radii + bent + proof.rho * levers.sum(axis=1) + error).reshape(2, -1)
        needs = 2 * self._paddings[self._pair[rows]] + needed.sum(axis=0)
        ends = self._ends(sides, of, piece, np.array([t0, t1]), normals)
        gaps = ends.sum(axis=0) / (np.linalg.norm(normals, axis=1) * UP) - needs * UP
        worst = int(gaps.argmin())
        if not gaps[worst] > 0:
            pair = self._scene.pairs[self._pair[rows[worst]]]
            where = f"piece {piece[worst]}, time {t0[worst]:.6g} to {t1[worst]:.6g}"
            raise ProofError("proof_motion", f"{where}: the plane does not keep {pair.a} and {pair.b} apart")
        return float(gaps[worst] / UP)

    def _ends(self, sides: Sides, of: np.ndarray, piece: np.ndarray, times: Array, normals: Array) -> Array:
        """Returns the least of n'(R v + p) over the vertices v of both bodies, with n reversed for the second one, (2, I), at both times.

        Args:
            times: (2, I).
        """
        # A number with a piece as its real and a time as its imaginary part, as numbers of this kind are sorted and compared exactly.
        moments, at = np.unique(piece + 1j * times, return_inverse=True)
        ways = np.unique(sides.ways[of])
        ways = ways[np.argsort([-len(self._known.chains[way].joints) for way in ways], kind="stable")]
        number = np.empty(len(self._known.chains), dtype=np.int64)
        number[ways] = np.arange(len(ways))
        asked, own = np.unique(number[sides.ways[of]][:, None] * len(moments) + at.reshape(times.shape), return_inverse=True)
        positions = self._pieces.positions(moments.real.astype(np.int64), moments.imag)
        R, p = poses([self._known.chains[way] for way in ways], asked // len(moments), asked % len(moments), *positions)
        own = own.reshape(2, *times.shape)
        signed = np.array([normals, -normals])[:, None]
        turned = np.einsum("seijk,seij->seik", R[own], np.broadcast_to(signed, (2, *times.shape, 3))).swapaxes(1, 2).reshape(-1, 2, 3)
        moved = (p[own] * signed).sum(axis=-1).swapaxes(1, 2).reshape(-1, 2)
        geometry, found = sides.geometries[of].reshape(-1), np.empty(of.size)
        order = np.argsort(geometry, kind="stable")
        for some in np.split(order, np.flatnonzero(np.diff(geometry[order])) + 1):
            found[some] = _least(turned[some], moved[some], self._scene.geometries[geometry[some[0]]].vertices)
        return found.reshape(of.shape)


def _least(rows: Array, at: Array, vertices: Array) -> Array:
    """Returns the least of n'(R v + p), (K,), at both ends of intervals, for R'n (K, 2, 3), n'p (K, 2) and vertices (V, 3)."""
    most = max(1, PRODUCTS // (2 * len(vertices)))
    parts = [(rows[i : i + most] @ vertices.T).min(axis=2) for i in range(0, len(rows), most)]
    found: Array = (np.concatenate(parts) + at).min(axis=1)
    return found
