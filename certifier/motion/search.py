"""A motion is searched here pair by pair, for planes that prove it or for the first contact."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import Array, Geometry, Pair, Scene
from certifier.motion.approach import approach, proved_of
from certifier.motion.chains import Side, chain, side
from certifier.motion.intervals import CONTACT, DONE, MANY, acceleration, clearance, divide, positions
from certifier.outcome import Outcome
from certifier.proof import limits
from certifier.proof.motion import Motion, MotionProof, Space

FIRST = 1 << 10
"""At first there is room for at most this many intervals of a pair."""
OUTCOMES = {CONTACT: Outcome.REFUTED, MANY: Outcome.INCONCLUSIVE}
ROUNDED = 2.0**-41
"""The planes leave this part of the bodies' sizes, for every joint and two more, for what the verifier rounds."""


INEXACT = 2.0**-44
"""Bounds of a polynomial's derivatives leave this part of its control points, more for higher degrees, for what the verifier rounds."""


@dataclass(frozen=True)
class Approach:
    """Names a place on a motion, and a pair with its distance there.

    Attributes:
        piece, time: the piece of the motion and the time of it.
        distance: of the padded bodies there, metres; 0 or less where they overlap, by an amount that it does not say.
    """

    pair: Pair
    piece: int
    time: float
    distance: float


@dataclass(frozen=True)
class Stop(Approach):
    """Says where a motion first could not be certified any further: there the pair touches, or comes nearer than it may.

    Attributes:
        outcome: REFUTED for a contact, TOO_CLOSE, or INCONCLUSIVE for too many intervals.
    """

    outcome: Outcome


@dataclass(frozen=True)
class Found:
    """Holds the result of a search.

    Attributes:
        proof: of the motion, not yet verified, or of its beginning where there is a stop; None where a pair touches at once.
        stop: None where all of the motion is proved.
        nearest: where the padded bodies come closest, if the proof shows nearly this distance, less what its tube takes of it; otherwise
            None.
    """

    proof: MotionProof | None
    stop: Stop | None
    nearest: Approach | None = None


def search(scene: Scene, motion: Motion, tube: bool = False, padding: float = 0.0, clearance: bool = False) -> Found:
    """Returns a proof of a motion, or where it first touches and a proof of the motion up to there.

    Args:
        motion: that certifier.motion.given has accepted.
        tube: whether to look for the largest tube, to about 2 % of what the bound of the bodies' displacement allows. The beginning of a
            motion that touches is proved without one.
        padding: metres that are added around every body, beyond the scene's padding.
        clearance: whether to look for a proof that shows nearly the least distance, as certifier.motion.approach.proved_of has it. Where
            that takes too many intervals, the proof is the one that is found without.
    """
    searched, kept = _Search(scene, motion), 2 * padding
    found = searched.run(kept, searched.widest(kept) if tube else 0.0)
    if found.stop:
        return searched.run(kept) if tube else found
    return searched.tightened(found, kept) if clearance else found


class _Part(NamedTuple):
    """Holds the result for a pair: how :func:`divide` ends, and its ends, normals and counts of intervals."""

    how: int
    piece: int
    t0: float
    t1: float
    distance: float
    rho: float
    ends: Array
    normals: Array
    counts: np.ndarray


class _Search:
    """Keeps what the pairs share."""

    def __init__(self, scene: Scene, motion: Motion) -> None:
        self._scene, self._motion, self._kinematics = scene, motion, Kinematics.of(scene)
        in_s = motion.space is Space.S
        self._turns = scene.revolute & in_s
        self._q_star = scene.q_star if in_s else np.zeros(scene.n)
        self._controls = np.ascontiguousarray(motion.bezier)
        self._farthest = np.abs(self._controls + self._q_star).max(axis=1)  # of joints that slide, to whose positions alone it matters
        self._inexact = [INEXACT * motion.degree * (motion.degree - 1) ** k * float(np.abs(motion.controls).max()) for k in (1, 2, 3)]
        self._hulls = self._bounds()
        self._curve = self._controls, self._hulls, (self._inexact[0], self._inexact[1])
        self._sides: dict[tuple[str, str], Side] = {}
        self._frames: dict[tuple[str, str], str] = {}

    def run(self, kept: float, rho: float = 0.0, shrinks: bool = True) -> Found:
        """Returns the result of the search.

        Args:
            kept: how far apart the padded bodies have to be, metres.
            rho: the width of the tube at first, radians or metres.
            shrinks: whether the tube becomes smaller where it has to.
        """
        scene, parts, stop = self._scene, [], None
        self._sides.clear()
        until, certified = (self._motion.pieces - 1, 1.0), (self._motion.pieces - 1, 1.0)
        left = limits.INTERVALS - self._motion.pieces * len(scene.pairs)
        for pair, a, b, frame in self._pairs():
            sides = self._side(frame, a, rho), self._side(frame, b, rho)
            part = self._divide(sides, self._reach(a, b) + kept, rho, shrinks and rho > 0, until, left)
            parts.append(part)
            rho = part.rho
            left -= max(0, len(part.ends) - self._motion.pieces)
            if part.how != DONE:
                time = part.t1 if part.how == CONTACT else part.t0
                certified = min(certified, (part.piece, part.t0))
                if stop is None or (part.piece, time) < (stop.piece, stop.time):
                    until = part.piece, part.t1
                    stop = Stop(pair, part.piece, time, part.distance + kept, OUTCOMES.get(part.how, Outcome.TOO_CLOSE))
        return Found(self._proof(parts, certified, rho), stop)

    def tightened(self, found: Found, kept: float) -> Found:
        """Returns a proof that shows nearly the least distance, with the same tube, and where the bodies come closest.

        Args:
            found: a proof of all of the motion.
            kept: the distance that it has to show at least, metres.
        """
        rho = found.proof.rho if found.proof else 0.0
        nearest, least = self._nearest(rho)
        tight = self.run(max(kept, proved_of(least), 0.0), rho, shrinks=False)
        return found if tight.stop else Found(tight.proof, None, nearest)

    def _nearest(self, rho: float) -> tuple[Approach | None, float]:
        """Returns where the padded bodies come closest, and how close, in metres, less what a tube takes of it."""
        start = self._start()
        sides = {pair: (self._side(frame, a, rho), self._side(frame, b, rho)) for pair, a, b, frame in self._pairs()}
        reaches = {pair: self._reach(a, b) for pair, a, b, _ in self._pairs()}
        first = {pair: clearance(*two, start) - reaches[pair] for pair, two in sides.items()}
        nearest, least = None, np.inf
        for pair in sorted(first, key=first.__getitem__):
            a, b = sides[pair]
            found, piece, time = approach(a, b, *self._curve, self._turns, self._q_star, reaches[pair], rho, least)
            if piece >= 0:
                taken = rho * float(a.levers[piece].sum() + b.levers[piece].sum())
                nearest, least = Approach(pair, piece, time, found + taken), found
        return nearest, least

    def _reach(self, a: Geometry, b: Geometry) -> float:
        """Returns the radii and the scene's paddings of two bodies, metres."""
        return a.radius + b.radius + 2 * self._scene.padding

    def _start(self) -> Array:
        """Returns the joint positions at the beginning of the motion, (n,)."""
        q = np.empty(self._scene.n)
        positions(self._motion.controls[0], self._turns, self._q_star, q)
        return q

    def _proof(self, parts: list[_Part], certified: tuple[int, float], rho: float) -> MotionProof | None:
        """Returns the proof of the motion up to a piece and a time of it, to which all parts reach; None for no time at all."""
        piece, end = certified if certified[1] > 0 else (certified[0] - 1, 1.0)
        if piece < 0:
            return None
        number = {body: i for i, body in enumerate(self._scene.bodies)}
        frames = np.array([number[frame] for *_, frame in self._pairs()], dtype=np.int32)
        counts = np.array([part.counts[: piece + 1] for part in parts], dtype=np.int32)
        kept = []
        for part, row in zip(parts, counts, strict=True):
            before = int(row[:piece].sum())
            row[piece] = 1 + np.searchsorted(part.ends[before : before + row[piece]], end)
            kept.append(before + int(row[piece]))
        ends = np.concatenate([part.ends[:k] for part, k in zip(parts, kept, strict=True)])
        normals = np.concatenate([part.normals[:k] for part, k in zip(parts, kept, strict=True)])
        return MotionProof(self._scene, self._motion.beginning(piece + 1), end, rho, frames, counts, ends, normals)

    def _pairs(self) -> Iterator[tuple[Pair, Geometry, Geometry, str]]:
        """Yields every pair with its geometries and the body in whose frame its planes are constant."""
        for pair in self._scene.pairs:
            a, b = self._scene.geometry(pair.a), self._scene.geometry(pair.b)
            if (a.body, b.body) not in self._frames:
                self._frames[a.body, b.body] = self._frame(a, b)
            yield pair, a, b, self._frames[a.body, b.body]

    def _frame(self, a: Geometry, b: Geometry) -> str:
        """Returns the body between two others from which their accelerations look least."""
        farthest = self._farthest.max(axis=0, keepdims=True)
        rates, changes = self._hulls[:, :2].max(axis=0) * np.where(self._turns, 2.0, 1.0)
        moving = dict.fromkeys(self._kinematics.rigid_root(body) for body in self._kinematics.bodies_between(a.body, b.body))

        def bent(frame: str) -> float:
            sides = (side(chain(self._kinematics, frame, geometry.body), geometry, farthest) for geometry in (a, b))
            return sum(acceleration(side, side.levers[0], rates, changes) for side in sides)

        return min(moving, key=bent)

    def _side(self, frame: str, geometry: Geometry, rho: float) -> Side:
        """Returns a side whose levers hold in a tube of rho, or of a larger one that was asked about before."""
        key = frame, geometry.name
        if key not in self._sides:
            self._sides[key] = side(chain(self._kinematics, frame, geometry.body), geometry, self._farthest + rho)
        return self._sides[key]

    def _bounds(self) -> Array:
        """Returns bounds of the first four derivatives of the coordinates on every piece, (P, 4, n), as much larger as the verifier's."""
        steps, bounds = self._controls, []
        for k in range(4):
            steps = (self._motion.degree - k) * np.diff(steps, axis=1)
            bounds.append(np.abs(steps).max(axis=1, initial=0.0) + (self._inexact[k - 1] if k else 0.0))
        return np.ascontiguousarray(np.stack(bounds, axis=1))

    def widest(self, kept: float) -> float:
        """Returns a tube beyond which the bodies' distances at the beginning do not let any be, radians or metres.

        Args:
            kept: how far apart the padded bodies have to be, metres.
        """
        q, widest = self._start(), np.inf
        for _, a, b, frame in self._pairs():
            sides = self._side(frame, a, 0.0), self._side(frame, b, 0.0)
            levers = sum(side.levers[0].sum() for side in sides)
            gap = clearance(*sides, q) - self._reach(a, b) - kept
            if levers > 0:
                widest = min(widest, gap / levers)
        return float(np.clip(widest, 0.0, np.pi))

    def _divide(self, sides: tuple[Side, Side], reach: float, rho: float, shrinks: bool, until: tuple[int, float], most: int) -> _Part:
        """Divides the motion for a pair, as :func:`divide` does, with ``most`` more intervals than there are pieces at most."""
        a, b = sides
        joints = len(a.chain.joints) + len(b.chain.joints)
        slack = ROUNDED * (reach + (joints + 2) * (a.size + b.size) * (1 + float(np.abs(self._controls).max())))
        most += self._motion.pieces
        room = min(FIRST, most)
        while True:
            ends, normals, counts = np.empty(room), np.empty((room, 3)), np.zeros(self._motion.pieces, dtype=np.int32)
            how, piece, t0, t1, distance, left = divide(
                a, b, *self._curve, self._turns, self._q_star, reach, slack, rho, shrinks, until, ends, normals, counts
            )
            if how != MANY or room == most:
                total = counts.sum()
                return _Part(how, piece, t0, t1, distance, left, ends[:total], normals[:total], counts)
            room = min(room * 16, most)
