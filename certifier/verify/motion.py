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
from typing import NamedTuple

import numpy as np

from certifier.errors import ProofError
from certifier.model import Array, Scene
from certifier.proof import limits
from certifier.proof.motion import Motion, MotionProof
from certifier.verify.chains import UP, Chain, Reach, poses
from certifier.verify.decimals import exactly, rounded_down
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.pieces import Pieces
from certifier.verify.places import Places
from certifier.verify.scene import check_scene
from certifier.verify.uncovered import not_covered

BLOCK = 1 << 14
"""At most this many intervals are looked at together."""
PRODUCTS = 1 << 20
"""At most this many vertices, each at one time, are looked at together."""
RUNS = 1 << 10
"""At most this many pairs are looked at together, each with its chains."""

Way = tuple[str, str]
"""A frame and a body, from which and to which a chain leads."""
_Side = tuple[str, str, str]
"""A frame, a body, and a geometry of the body."""


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


class _Run(NamedTuple):
    """Holds intervals of one pair that follow each other in the file, from one number up to another."""

    pair: int
    first: int
    last: int


class _Check:
    """Checks the intervals of all pairs, some at a time. Those that need the same chain at the same time share its pose."""

    def __init__(self, proof: MotionProof) -> None:
        self._proof, self._scene = proof, proof.scene
        self._places, self._pieces = Places(proof.scene), Pieces(proof.scene, proof.motion, proof.rho)
        self._known: dict[_Side, tuple[Reach, tuple[Array, Array]]] = {}
        self._starts = _starts(proof)
        per_pair = proof.counts.sum(axis=1, dtype=np.int64)
        self._first = np.cumsum(per_pair) - per_pair
        self._count = per_pair
        self._piece = np.repeat(np.tile(np.arange(proof.motion.pieces), len(per_pair)), proof.counts.reshape(-1))
        self._bodies = [
            (scene_frame, self._scene.geometry(pair.a).body, self._scene.geometry(pair.b).body)
            for scene_frame, pair in zip((self._scene.bodies[i] for i in proof.frames), self._scene.pairs, strict=True)
        ]

    def gaps(self) -> Iterator[float]:
        """Yields, for some intervals at a time, how far the padded bodies are apart in them at least, in metres.

        Raises:
            ProofError: one of the planes does not keep them apart, or it takes too long to see whether they do.
        """
        self._check_cost()
        for runs in self._blocks():
            yield self._gap(runs)

    def _check_cost(self) -> None:
        kinematics, joints, cost = ExactKinematics.by_joint(self._scene), dict[tuple[str, ...], int](), 0
        for i, (pair, bodies) in enumerate(zip(self._scene.pairs, self._bodies, strict=True)):
            if bodies not in joints:
                joints[bodies] = sum(len(kinematics.path(bodies[0], body)) for body in bodies[1:])
            vertices = sum(len(self._scene.geometry(name).vertices) for name in (pair.a, pair.b))
            cost += int(self._count[i]) * (vertices + limits.JOINT_COST * joints[bodies] + self._scene.n * self._proof.motion.degree**2)
        if cost > limits.SWEPT:
            raise ProofError("proof_too_large", "the intervals have more vertices, behind more joints, than are checked")

    def _blocks(self) -> Iterator[list[_Run]]:
        """Yields all intervals, some at a time; those of pairs with the same bodies follow each other."""
        most = max(1, BLOCK // self._proof.motion.degree)
        runs, room = list[_Run](), most
        for i in sorted(range(len(self._bodies)), key=lambda i: self._bodies[i]):
            first, last = int(self._first[i]), int(self._first[i] + self._count[i])
            while first < last:
                then = min(last, first + room)
                runs.append(_Run(i, first, then))
                first, room = then, room - (then - first)
                if not room or len(runs) == RUNS:
                    yield runs
                    runs, room = [], most
        if runs:
            yield runs

    def _gap(self, runs: list[_Run]) -> float:
        """Returns how far the padded bodies are apart at least in some intervals."""
        proof = self._proof
        rows = np.concatenate([np.arange(run.first, run.last) for run in runs])
        normals, piece, t0, t1 = proof.normals[rows], self._piece[rows], self._starts[rows], proof.ends[rows]
        ways = [[(frame, body) for body in bodies] for frame, *bodies in (self._bodies[run.pair] for run in runs)]
        chains = {way: self._places.chain(*way) for two in ways for way in two}
        turned, at = self._reached(runs, ways, chains, piece, np.array([t0, t1]), normals)
        rates, changes = self._pieces.rates(piece, t0, t1)
        needed, ends = np.empty((2, len(rows))), np.empty((2, len(rows)))
        for (*way, name), k, own in self._sides(runs, ways):
            geometry, chain = self._scene.geometry(name), chains[way[0], way[1]]
            levers, error = self._moved(chain, (way[0], way[1], name), piece[own])
            ends[k, own] = _least(turned[k, :, own].swapaxes(0, 1), at[k, :, own].T, geometry.vertices)
            bent = _acceleration(chain, levers, rates[own], changes[own])
            needed[k, own] = geometry.radius + (t1 - t0)[own] ** 2 / 8 * bent + proof.rho * levers.sum(axis=1) + error
        needs = 2 * self._scene.padding + needed.sum(axis=0)
        gaps = ends.sum(axis=0) / (np.linalg.norm(normals, axis=1) * UP) - needs * UP
        worst = int(gaps.argmin())
        if not gaps[worst] > 0:
            a, b = self._names(runs[int(np.searchsorted(np.cumsum([run.last - run.first for run in runs]), worst, side="right"))])
            problem = f"piece {piece[worst]}, time {t0[worst]:.6g} to {t1[worst]:.6g}: the plane does not keep {a} and {b} apart"
            raise ProofError("proof_motion", problem)
        return float(gaps[worst] / UP)

    def _sides(self, runs: list[_Run], ways: list[list[Way]]) -> Iterator[tuple[_Side, np.ndarray, np.ndarray]]:
        """Yields every geometry that intervals have on a side, as a frame sees it, with these sides, (K,) 0 or 1, and intervals, (K,)."""
        number: dict[_Side, int] = {}
        which = [
            [number.setdefault((*way, name), len(number)) for way, name in zip(two, self._names(run), strict=True)]
            for run, two in zip(runs, ways, strict=True)
        ]
        of_intervals = np.repeat(np.array(which).T, [run.last - run.first for run in runs], axis=1)
        order = np.argsort(of_intervals.ravel(), kind="stable")
        last = np.cumsum(np.bincount(of_intervals.ravel(), minlength=len(number)))
        for side, places in zip(number, np.split(order, last[:-1]), strict=True):
            yield side, *np.divmod(places, of_intervals.shape[1])

    def _moved(self, chain: Chain, side: _Side, piece: np.ndarray) -> tuple[Array, Array]:
        """Returns the levers and the bound of what is rounded of a side on pieces, (K, m) and (K,), or one row for all of them."""
        if side not in self._known:
            reach = chain.reach(self._scene.geometry(side[2]).vertices)
            self._known[side] = reach, self._bounds(chain, reach, self._pieces.slid[:1])
        reach, bounds = self._known[side]
        return self._bounds(chain, reach, self._pieces.slid[piece]) if chain.slides.any() else bounds

    def _bounds(self, chain: Chain, reach: Reach, slid: Array) -> tuple[Array, Array]:
        """Returns the levers, (K, m), and the bound of what is rounded, (K,) metres, for slides (K, n)."""
        own = slid[:, chain.joints]
        return chain.levers(reach, own), chain.error(chain.sizes(reach, own), self._pieces.inexact)

    def _names(self, run: _Run) -> tuple[str, str]:
        pair = self._scene.pairs[run.pair]
        return pair.a, pair.b

    def _reached(
        self, runs: list[_Run], ways: list[list[Way]], chains: dict[Way, Chain], piece: np.ndarray, times: Array, normals: Array
    ) -> tuple[Array, Array]:
        """Returns R'n and n'p of both bodies, (2, 2, I, 3) and (2, 2, I), at both times of I intervals, with n reversed for the second one.

        Args:
            ways: of each run, the frame and the body of either side.
            times: (2, I).
        """
        # A number with a piece as its real and a time as its imaginary part, as numbers of this kind are sorted and compared exactly.
        moments, at = np.unique(piece + 1j * times, return_inverse=True)
        known = sorted(chains, key=lambda way: -len(chains[way].joints))
        number = {way: i for i, way in enumerate(known)}
        lengths = [run.last - run.first for run in runs]
        which = np.repeat(np.array([[number[two[k]] for two in ways] for k in (0, 1)]), lengths, axis=1)
        rows, own = np.unique(which[:, None] * len(moments) + at.reshape(times.shape), return_inverse=True)
        positions = self._pieces.positions(moments.real.astype(np.int64), moments.imag)
        R, p = poses([chains[way] for way in known], rows // len(moments), rows % len(moments), *positions)
        own = own.reshape(2, *times.shape)
        signed = np.array([normals, -normals])[:, None]
        return np.einsum("seijk,seij->seik", R[own], np.broadcast_to(signed, (2, *times.shape, 3))), (p[own] * signed).sum(axis=-1)


def _least(rows: Array, at: Array, vertices: Array) -> Array:
    """Returns the least of n'(R v + p), (I,), at both ends of intervals, for R'n (2, I, 3), n'p (2, I) and vertices (V, 3)."""
    most = max(1, PRODUCTS // (2 * len(vertices)))
    parts = [(rows[:, i : i + most] @ vertices.T).min(axis=2) for i in range(0, rows.shape[1], most)]
    return (np.concatenate(parts, axis=1) + at).min(axis=0)


def _acceleration(chain: Chain, levers: Array, rates: Array, changes: Array) -> Array:
    """Returns a bound of the acceleration of every vertex, (I,), from levers (I, m) or (1, m), rates and changes (I, n), rounded upwards.

    Joints i and then k on the path contribute twice the product of their rates times the lever of k, where i is revolute, and nothing where
    it is prismatic; a revolute joint alone contributes its lever times the square of its rate, and every joint its lever times its change.
    Nothing here is negative, so what is rounded is a part of it that UP makes good.
    """
    rates, changes = rates[:, chain.joints], changes[:, chain.joints]
    turning = np.zeros_like(rates)  # of the revolute joints before each one
    np.cumsum(np.where(chain.slides, 0.0, rates)[:, :-1], axis=1, out=turning[:, 1:])
    total = levers * (2 * turning * rates + np.where(chain.slides, 0.0, rates**2) + changes)
    return total.sum(axis=1) * UP
