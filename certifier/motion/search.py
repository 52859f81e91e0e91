"""A motion is searched here pair by pair, for planes that prove it or for the first contact."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import Array, Geometry, Pair, Scene
from certifier.motion.chains import Chain, Side, chain, side
from certifier.motion.intervals import CONTACT, DONE, MANY, acceleration, clearance, divide, positions
from certifier.outcome import Outcome
from certifier.proof import limits
from certifier.proof.motion import Motion, MotionProof, Space

FIRST = 1 << 10
"""There is room for so many intervals of a pair at first."""
OUTCOMES = {CONTACT: Outcome.REFUTED, MANY: Outcome.INCONCLUSIVE}
ROUNDED = 2.0**-41
"""The planes leave this part of the bodies' size, for every joint and two more, for what the verifier rounds."""


@dataclass(frozen=True)
class Stop:
    """Says where a motion could not be certified any further.

    Attributes:
        outcome: REFUTED for a contact, TOO_CLOSE, or INCONCLUSIVE for too many intervals.
        piece: number of the piece of the motion.
        certified_to: time of the piece up to which all pairs are apart; the planes up to there are not kept as a proof.
        time: time of the piece of the contact; otherwise the same.
        distance: of the padded bodies at that time, metres; 0 or less where they overlap, by an amount that it does not say.
    """

    outcome: Outcome
    pair: Pair
    piece: int
    certified_to: float
    time: float
    distance: float


def search(scene: Scene, motion: Motion, tube: bool = False) -> MotionProof | Stop:
    """Returns a proof of a motion, not yet verified, or where it first could not be certified.

    Args:
        motion: that certifier.motion.given has accepted.
        tube: whether to look for the largest tube, to about 2 % of what the bound of the bodies' displacement allows.
    """
    return _Search(scene, motion).run(tube)


class _Search:
    """Keeps what the pairs share."""

    def __init__(self, scene: Scene, motion: Motion) -> None:
        self._scene, self._motion, self._kinematics = scene, motion, Kinematics.of(scene)
        in_s = motion.space is Space.S
        self._turns = scene.revolute & in_s
        self._q_star = scene.q_star if in_s else np.zeros(scene.n)
        self._positions = motion.waypoints + self._q_star  # of joints that slide, to whose positions alone it matters
        self._rates = np.abs(np.diff(motion.waypoints, axis=0)).max(axis=0) * np.where(self._turns, 2.0, 1.0)
        self._chains: dict[tuple[str, str], Chain] = {}
        self._sides: dict[tuple[str, str], Side] = {}
        self._frames: dict[tuple[str, str], str] = {}

    def run(self, tube: bool) -> MotionProof | Stop:
        scene = self._scene
        rho = self._widest() if tube else 0.0
        self._sides.clear()
        stop, until, parts = None, np.inf, []
        number = {body: i for i, body in enumerate(scene.bodies)}
        frames = np.empty(len(scene.pairs), dtype=np.int32)
        for i, (pair, a, b, frame) in enumerate(self._pairs()):
            sides = self._side(frame, a, rho), self._side(frame, b, rho)
            how, piece, t0, t1, distance, rho, *part = self._divide(sides, a.radius + b.radius + 2 * scene.padding, rho, until)
            frames[i] = number[frame]
            if how == DONE:
                parts.append(part)
            elif piece + t1 < until:
                until = piece + t1
                stop = Stop(OUTCOMES.get(how, Outcome.TOO_CLOSE), pair, piece, t0, t1 if how == CONTACT else t0, distance)
        if stop is not None:
            return stop
        ends, normals, counts = (np.concatenate([part[k] for part in parts]) for k in range(3))
        return MotionProof(scene, self._motion, rho, frames, counts.reshape(len(parts), -1), ends, normals)

    def _pairs(self) -> Iterator[tuple[Pair, Geometry, Geometry, str]]:
        """Yields every pair with its geometries and the body in whose frame its planes are constant."""
        for pair in self._scene.pairs:
            a, b = self._scene.geometry(pair.a), self._scene.geometry(pair.b)
            if (a.body, b.body) not in self._frames:
                self._frames[a.body, b.body] = self._frame(a, b)
            yield pair, a, b, self._frames[a.body, b.body]

    def _frame(self, a: Geometry, b: Geometry) -> str:
        """Returns the body between two others from which their accelerations look least."""
        moving = dict.fromkeys(self._kinematics.rigid_root(body) for body in self._kinematics.bodies_between(a.body, b.body))

        def bent(frame: str) -> float:
            sides = (side(self._chain(frame, geometry.body), geometry, self._reaches(0.0)) for geometry in (a, b))
            return sum(acceleration(side, side.levers.max(axis=0), self._rates, np.zeros(self._scene.n)) for side in sides)

        return min(moving, key=bent)

    def _chain(self, frame: str, body: str) -> Chain:
        if (frame, body) not in self._chains:
            self._chains[frame, body] = chain(self._kinematics, frame, body)
        return self._chains[frame, body]

    def _side(self, frame: str, geometry: Geometry, rho: float) -> Side:
        """Returns a side whose levers hold in a tube of rho, or of a larger one that was asked about before."""
        key = frame, geometry.name
        if key not in self._sides:
            self._sides[key] = side(self._chain(frame, geometry.body), geometry, self._reaches(rho))
        return self._sides[key]

    def _reaches(self, rho: float) -> Array:
        """Returns, (K - 1, n), how far from 0 the joints' positions are at most in a tube about each piece."""
        size = np.abs(self._positions)
        return np.maximum(size[:-1], size[1:]) + rho

    def _widest(self) -> float:
        """Returns a tube beyond which the bodies' distances at the first waypoint do not let any be, radians or metres."""
        first, widest = self._motion.waypoints[0], np.inf
        q = np.empty(self._scene.n)
        positions(first, first, 0.0, self._turns, self._q_star, q)
        for _, a, b, frame in self._pairs():
            sides = self._side(frame, a, 0.0), self._side(frame, b, 0.0)
            levers = sum(side.levers[0].sum() for side in sides)
            gap = clearance(*sides, q) - a.radius - b.radius - 2 * self._scene.padding
            if levers > 0:
                widest = min(widest, gap / levers)
        return float(np.clip(widest, 0.0, np.pi))

    def _divide(
        self, sides: tuple[Side, Side], reach: float, rho: float, until: float
    ) -> tuple[int, int, float, float, float, float, Array, Array, np.ndarray]:
        """Returns what :func:`divide` does, then the ends, the normals and the counts of the intervals."""
        a, b = sides
        joints = len(a.chain.joints) + len(b.chain.joints)
        slack = ROUNDED * (joints + 2) * (a.size + b.size) * (1 + float(np.abs(self._motion.waypoints).max()))
        room = FIRST
        while True:
            ends, normals, counts = np.empty(room), np.empty((room, 3)), np.zeros(self._motion.pieces, dtype=np.int32)
            waypoints = np.ascontiguousarray(self._motion.waypoints)
            found = divide(a, b, waypoints, self._turns, self._q_star, reach, slack, rho, until, ends, normals, counts)
            if found[0] != MANY or room >= limits.INTERVALS:
                total = counts.sum()
                return (*found, ends[:total], normals[:total], counts)
            room = min(room * 16, limits.INTERVALS)
