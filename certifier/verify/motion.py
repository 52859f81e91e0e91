"""The verifier checks here that a motion is free of collisions, and a tube about it (docs/algorithm.md, 11).

In an interval of time from t0 to t1, of length h, a point p moves on a curve that stays within h^2/8 times the largest |p''| of the chord
from p(t0) to p(t1). A plane is constant in the frame that the proof names. If it has all vertices of a on one side and all of b on the
other at t0 and at t1, with room for these bulges, for the radii and paddings, for the tube and for what doubles are wrong by, it keeps the
bodies apart in all of the interval. The bounds of |p''| and of the tube are computed here, from the scene and the control points alone.

Doubles and de Casteljau's algorithm evaluate a piece, a polynomial of degree m whose control points are at most M in magnitude. With
u = 2^-53, a step from a to b, a + t (b - a), is wrong by less than 8 u M, and what was wrong in a and b is averaged. So after m steps a
coordinate is wrong by less than 8 m u M, and what is a tangent's counts twice in its angle. A k-th derivative is k + 1 of the values
before the last k steps, differenced k times and multiplied by m (m - 1) ... (m - k + 1): for k of 1 and 2 it is wrong by less than
2^5 u m (m - 1)^k M. The same differences of the control points, whose hull bounds it, are wrong by less than 2^8 u m (m - 1)^(k - 1) M for
k of 2 to 4. A first difference of two doubles is wrong by a part of itself, which rounding upwards makes good.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from certifier.errors import ProofError
from certifier.model import Array, Geometry, Scene
from certifier.proof import limits
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.verify.angles import cosines_and_sines
from certifier.verify.chains import UP, Chain
from certifier.verify.decimals import exactly, rounded_down
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.scene import check_scene
from certifier.verify.uncovered import not_covered

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
        start, end = (", ".join(map(exactly, motion.controls[i])) for i in (0, -1))
        names = ", ".join(f"'{joint.name}'" for joint in scene.moving)
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
            f"  from {motion.space.value} = {start}",
            f"  to {motion.space.value} = {end}",
            f"  SHA-256 of the {points} as doubles: {digest}",
            f"{part} the padded bodies of each of the scene's {len(scene.pairs)} pairs are at least {rounded_down(self.gap)} m apart",
            *([f"and {tube}, beyond the limits as well"] if self.rho else []),
            *not_covered(scene),
        ]


def verify_motion(proof: MotionProof) -> MotionStatement:
    """Checks a proof about a motion and returns what it proves.

    Raises:
        ProofError: the proof does not hold.
    """
    scene = proof.scene
    check_scene(scene)
    proof.check_shapes()
    _check_motion(proof)
    _check_intervals(proof)
    check = _Check(proof)
    gap = min(check.gaps(), default=np.inf)
    if not 0 < gap < np.inf:
        raise ProofError("proof_motion", "the scene has no pair to keep apart")
    return MotionStatement(scene, proof.motion, proof.end, proof.rho, float(gap))


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


@dataclass(frozen=True)
class _Poses:
    """Holds where a body is in a frame at N times.

    Attributes:
        R, p: (N, 3, 3) and (N, 3).
    """

    R: Array
    p: Array

    def along(self, normals: Array, at: np.ndarray, vertices: Array) -> Array:
        """Returns n'(R v + p), (I, V), for normals (I, 3) and the poses' numbers (I,)."""
        rows = np.einsum("ijk,ij->ik", self.R[at], normals)
        return rows @ vertices.T + np.einsum("ij,ij->i", self.p[at], normals)[:, None]


class _Side:
    """Holds the geometries of one of two bodies, and what is known of them on every piece.

    Attributes:
        geometries: every one once.
        number: (P,) which of them belongs to each pair of the group.
    """

    def __init__(self, chain: Chain, geometries: list[Geometry], slid: Array) -> None:
        self.chain = chain
        self.geometries = list({geometry.name: geometry for geometry in geometries}.values())
        numbers = {geometry.name: i for i, geometry in enumerate(self.geometries)}
        self.number = np.array([numbers[geometry.name] for geometry in geometries])
        # Without a prismatic joint, one row of levers holds for every piece.
        self._slid = slid[:, chain.joints] if chain.slides.any() else slid[:1, chain.joints]
        self._known: dict[str, tuple[Array, Array]] = {}

    def levers(self, geometry: Geometry, piece: np.ndarray) -> tuple[Array, Array]:
        """Returns the levers and the sizes of a geometry on pieces, (I, m) and (I,)."""
        if geometry.name not in self._known:
            both = (self.chain.levers(geometry.vertices, self._slid), self.chain.sizes(geometry.vertices, self._slid))
            self._known[geometry.name] = both
        row = piece if len(self._slid) > 1 else np.zeros_like(piece)
        levers, sizes = self._known[geometry.name]
        return levers[row], sizes[row]


class _Check:
    """Checks the intervals of all pairs; those of the same two bodies in the same frame share the poses."""

    def __init__(self, proof: MotionProof) -> None:
        self._proof, self._scene, self._motion = proof, proof.scene, proof.motion
        self._kinematics = ExactKinematics.by_joint(proof.scene)
        self._starts = _starts(proof)
        per_pair = proof.counts.sum(axis=1, dtype=np.int64)
        self._first = np.cumsum(per_pair) - per_pair
        self._count = per_pair
        self._piece = (
            np.concatenate([np.repeat(np.arange(proof.motion.pieces), row) for row in proof.counts]) if len(per_pair) else per_pair
        )
        self._turns = self._scene.revolute & (self._motion.space is Space.S)
        self._base = self._scene.q_star if self._motion.space is Space.S else np.zeros(self._scene.n)
        self._bezier = np.moveaxis(self._motion.bezier, 1, 0)
        self._degree = degree = self._motion.degree
        largest, base = float(np.abs(self._motion.controls).max()), float(np.abs(self._base).max(initial=0.0))
        # A coordinate of a tangent counts twice in its angle, and one of a slide is added to q*.
        self._inexact = 2.0**-49 * (degree + 1) * (largest + base)
        self._wrong = [2.0**-45 * degree * (degree - 1) ** k * largest for k in range(1, 4)]
        farthest = replace(self._motion, controls=np.abs(self._motion.controls + self._base)).bezier.max(axis=1)
        self._slid = farthest * UP + self._inexact + proof.rho
        self._hulls = self._bounds()

    def gaps(self) -> Iterator[float]:
        """Yields, for some intervals at a time, how far the padded bodies are apart in them at least, in metres.

        Raises:
            ProofError: one of the planes does not keep them apart, or it takes too long to see whether they do.
        """
        groups: dict[tuple[str, str, str], list[int]] = defaultdict(list)
        for i, pair in enumerate(self._scene.pairs):
            frame = self._scene.bodies[self._proof.frames[i]]
            groups[frame, self._scene.geometry(pair.a).body, self._scene.geometry(pair.b).body].append(i)
        self._check_cost(groups)
        chains: dict[tuple[str, str], Chain] = {}
        for (frame, *bodies), pairs in groups.items():
            for body in bodies:
                if (frame, body) not in chains:
                    chains[frame, body] = Chain.between(self._scene, self._kinematics, frame, body)
            yield from self._group([chains[frame, body] for body in bodies], pairs)

    def _check_cost(self, groups: dict[tuple[str, str, str], list[int]]) -> None:
        cost = 0
        for (frame, *bodies), pairs in groups.items():
            joints = sum(len(self._kinematics.path(frame, body)) for body in bodies)
            for i in pairs:
                vertices = sum(len(self._scene.geometry(name).vertices) for name in (self._scene.pairs[i].a, self._scene.pairs[i].b))
                cost += int(self._count[i]) * (vertices + limits.JOINT_COST * joints + self._scene.n * self._degree**2)
        if cost > limits.SWEPT:
            raise ProofError("proof_too_large", "the intervals have more vertices, behind more joints, than are checked")

    def _group(self, chains: list[Chain], pairs: list[int]) -> Iterator[float]:
        """Yields the gaps of pairs of the same two bodies, some intervals at a time."""
        both = [[self._scene.geometry(name) for name in (self._scene.pairs[i].a, self._scene.pairs[i].b)] for i in pairs]
        most = max(1, min(BLOCK // self._degree, PRODUCTS // max(len(geometry.vertices) for two in both for geometry in two)))
        rows = np.concatenate([np.arange(self._first[i], self._first[i] + self._count[i]) for i in pairs])
        owner = np.repeat(np.arange(len(pairs)), self._count[pairs])
        sides = [_Side(chain, [two[k] for two in both], self._slid) for k, chain in enumerate(chains)]
        for first in range(0, len(rows), most):
            yield self._gap(sides, rows[first : first + most], owner[first : first + most])

    def _gap(self, sides: list[_Side], rows: np.ndarray, owner: np.ndarray) -> float:
        """Returns how far the padded bodies are apart at least in some intervals, whose pairs' numbers in the group are ``owner``."""
        proof = self._proof
        normals, piece, t0, t1 = proof.normals[rows], self._piece[rows], self._starts[rows], proof.ends[rows]
        # A number with a piece as its real and a time as its imaginary part, as numbers of this kind are sorted and compared exactly.
        times, at = np.unique(piece + 1j * np.array([t0, t1]), return_inverse=True)
        poses = self._poses([side.chain for side in sides], times.real.astype(np.int64), times.imag)
        rates, changes = self._rates(piece, t0, t1)
        needed = np.full(len(rows), 2 * self._scene.padding)
        ends = np.empty((2, len(rows)))
        for k, (side, pose, sign) in enumerate(zip(sides, poses, (1.0, -1.0), strict=True)):
            for number, geometry in enumerate(side.geometries):
                own = np.flatnonzero(side.number[owner] == number)
                if not own.size:
                    continue
                levers, size = side.levers(geometry, piece[own])
                bent = _acceleration(side.chain, levers, rates[own], changes[own])
                needed[own] += geometry.radius + (t1 - t0)[own] ** 2 / 8 * bent + proof.rho * levers.sum(axis=1)
                needed[own] += side.chain.error(size, self._inexact)
                reached = [pose.along(sign * normals[own], at.reshape(2, -1)[end, own], geometry.vertices).min(axis=1) for end in (0, 1)]
                ends[k, own] = np.minimum(*reached)
        gaps = ends.sum(axis=0) / (np.linalg.norm(normals, axis=1) * UP) - needed * UP
        worst = int(gaps.argmin())
        if not gaps[worst] > 0:
            a, b = (side.geometries[side.number[owner[worst]]].name for side in sides)
            problem = f"piece {piece[worst]}, time {t0[worst]:.6g} to {t1[worst]:.6g}: the plane does not keep {a} and {b} apart"
            raise ProofError("proof_motion", problem)
        return float(gaps[worst] / UP)

    def _poses(self, chains: list[Chain], piece: np.ndarray, time: Array) -> list[_Poses]:
        """Returns the poses of both bodies at times of pieces, (N,) each."""
        x, _, _ = self._at(piece, time)
        if self._motion.space is Space.Q:
            cosines, sines = cosines_and_sines(np.where(self._scene.revolute, x, 0.0))
        else:
            c, s = cosines_and_sines(self._base)
            square = x * x
            cosine, sine = (1.0 - square) / (1.0 + square), 2.0 * x / (1.0 + square)
            cosines, sines = c * cosine - s * sine, s * cosine + c * sine
        return [_Poses(*chain.poses(x + self._base, cosines, sines)) for chain in chains]

    def _at(self, piece: np.ndarray, time: Array) -> tuple[Array, Array, Array]:
        """Returns the coordinates, their rates and the rates' changes at times of pieces, (N, n) each."""
        m, points = self._degree, self._bezier[:, piece]
        rates = changes = np.zeros(points.shape[1:])
        while len(points) > 1:
            steps = points[1:] - points[:-1]
            if len(steps) == 2:
                changes = m * (m - 1) * (steps[1] - steps[0])
            rates = m * steps[0]
            points = points[:-1] + time[:, None] * steps
        return points[0], rates, changes

    def _bounds(self) -> list[Array]:
        """Returns bounds of the first four derivatives of the coordinates on every piece, (P, n) each, from their control points."""
        m, steps, bounds = self._degree, self._bezier, []
        for k in range(4):
            steps = (m - k) * (steps[1:] - steps[:-1])
            wrong = self._wrong[k - 1] if k else 0.0
            bounds.append(np.abs(steps).max(axis=0) + wrong if len(steps) else np.broadcast_to(0.0, steps.shape[1:]))
        return bounds

    def _rates(self, piece: np.ndarray, t0: Array, t1: Array) -> tuple[Array, Array]:
        """Returns bounds of |dq/dt| and |d2q/dt2| in intervals of pieces, (I, n) each, rounded upwards.

        A function is at most what it is at the ends of an interval and h^2/8 of its second derivative's bound. For a tangent of half an
        angle, q = q* + 2 atan(x), the bounds are 2 |x'|/(1 + x^2) and 2 |x''|/(1 + x^2) + 4 |x'|^2 |x|/(1 + x^2)^2.
        """
        (x0, rate0, change0), (x1, rate1, change1) = self._at(piece, t0), self._at(piece, t1)
        first, second, third, fourth = (bound[piece] for bound in self._hulls)
        bulge = ((t1 - t0) ** 2 / 8)[:, None]
        rates = np.minimum(first, np.maximum(np.abs(rate0), np.abs(rate1)) + bulge * third + self._wrong[0])
        changes = np.minimum(second, np.maximum(np.abs(change0), np.abs(change1)) + bulge * fourth + self._wrong[1])
        if self._motion.space is Space.Q:
            return rates * UP, changes * UP
        off = self._inexact + bulge * changes * UP
        least = np.where(x0 * x1 > 0, np.minimum(np.abs(x0), np.abs(x1)) - off, 0.0).clip(0.0)
        most = np.maximum(np.abs(x0), np.abs(x1)) + off
        norm = 1 + least**2
        turning, bending = 2 * rates / norm, 2 * changes / norm + 4 * rates**2 * most / norm**2
        return np.where(self._turns, turning, rates) * UP, np.where(self._turns, bending, changes) * UP


def _acceleration(chain: Chain, levers: Array, rates: Array, changes: Array) -> Array:
    """Returns a bound of the acceleration of every vertex, (I,), from levers (I, m), rates and their changes (I, n), rounded upwards.

    Joints i and then k on the path contribute twice the product of their rates times the lever of k, where i is revolute, and nothing where
    it is prismatic; a revolute joint alone contributes its lever times the square of its rate, and every joint its lever times its change.
    """
    total, turning = np.zeros(len(levers)), np.zeros(len(levers))
    for k, j in enumerate(chain.joints):
        total += 2 * turning * rates[:, j] * levers[:, k]
        if chain.slides[k]:
            total += changes[:, j]
        else:
            total += levers[:, k] * (rates[:, j] ** 2 + changes[:, j])
            turning += rates[:, j]
    return total * UP
