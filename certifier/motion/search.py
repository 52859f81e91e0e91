"""A motion is searched here pair by pair, for planes that prove it or for the first contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.conditioned import contact_refutes
from certifier.model import Pair, Scene
from certifier.motion.approach import closest, proved_of
from certifier.motion.bodies import bodies_of
from certifier.motion.curve import curve_of, poses_of
from certifier.motion.intervals import CONTACT, MANY, Ground, Planes, choose, divide, widest
from certifier.motion.views import levers_of, views_of
from certifier.outcome import Outcome
from certifier.proof import limits
from certifier.proof.motion import Motion, MotionProof

OUTCOMES = {CONTACT: Outcome.REFUTED, MANY: Outcome.INCONCLUSIVE}


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


class _Search:
    """Keeps what the runs of a search share."""

    def __init__(self, scene: Scene, motion: Motion) -> None:
        self._scene, self._motion = scene, motion
        self._bodies, self._views, self._curve = bodies_of(scene), views_of(scene), curve_of(scene, motion)
        self._poses = poses_of(self._bodies, self._curve)
        self._farthest = np.abs(self._curve.controls + self._curve.q_star).max(axis=(0, 1))  # of slides, to whose levers alone it matters
        rates, changes = self._curve.hulls[:, :2].max(axis=0) * np.where(self._curve.turns, 2.0, 1.0)
        self._chosen = np.empty(len(scene.pairs), dtype=np.int64)
        choose(self._views, levers_of(self._views, self._farthest)[0], rates, changes, self._chosen)

    def run(self, kept: float, rho: float = 0.0, shrinks: bool = True) -> Found:
        """Returns the result of the search.

        Args:
            kept: how far apart the padded bodies have to be, metres.
            rho: the width of the tube at first, radians or metres.
            shrinks: whether the tube becomes smaller where it has to.
        """
        pairs, pieces = self._scene.pairs, self._motion.pieces
        counts = np.zeros((len(pairs), pieces), dtype=np.int32)
        most = limits.INTERVALS - pieces * len(pairs)
        pair, end, certified, rho, planes = divide(self._ground(rho), kept, rho, shrinks and rho > 0, most, counts)
        proof = self._proof(counts, planes, certified, rho)
        if pair < 0:
            return Found(proof, None)
        time = end.t1 if end.how == CONTACT else end.t0
        outcome = OUTCOMES.get(end.how, Outcome.TOO_CLOSE)
        if outcome is Outcome.REFUTED and not contact_refutes(self._scene, pairs[pair]):
            outcome = Outcome.TOO_CLOSE
        return Found(proof, Stop(pairs[pair], end.piece, time, end.distance + kept, outcome))

    def tightened(self, found: Found, kept: float) -> Found:
        """Returns a proof that shows nearly the least distance, with the same tube, and where the bodies come closest.

        Args:
            found: a proof of all of the motion.
            kept: the distance that it has to show at least, metres.
        """
        rho = found.proof.rho if found.proof else 0.0
        least, pair, piece, time, taken = closest(self._ground(rho), rho)
        tight = self.run(max(kept, proved_of(least), 0.0), rho, shrinks=False)
        if tight.stop:
            return found
        return Found(tight.proof, None, Approach(self._scene.pairs[pair], piece, time, least + taken) if piece >= 0 else None)

    def widest(self, kept: float) -> float:
        """Returns a tube beyond which the bodies' distances at the beginning do not let any be, radians or metres.

        Args:
            kept: how far apart the padded bodies have to be, metres.
        """
        return float(np.clip(widest(self._ground(0.0), kept), 0.0, np.pi))

    def _ground(self, rho: float) -> Ground:
        """Returns what the pairs share, with levers that hold in a tube of rho."""
        levers, lengths = levers_of(self._views, self._farthest + rho)
        return Ground(self._bodies, self._views, self._curve, self._poses, levers, lengths, self._chosen)

    def _proof(self, counts: np.ndarray, planes: Planes, certified: tuple[int, float], rho: float) -> MotionProof | None:
        """Returns the proof of the motion up to a piece and a time of it, to which all pairs have planes; None for no time at all.

        Args:
            counts: (pairs, pieces) how many planes there are.
        """
        piece, end = certified if certified[1] > 0 else (certified[0] - 1, 1.0)
        if piece < 0:
            return None
        ends, per_piece = planes.ends, counts.ravel()
        of = np.repeat(np.tile(np.arange(counts.shape[1]), len(counts)), per_piece)
        starts = np.concatenate([[0.0], ends[:-1]])
        first = np.cumsum(per_piece) - per_piece
        starts[first[per_piece > 0]] = 0.0
        kept = (of < piece) | ((of == piece) & (starts < end))
        pair = np.repeat(np.arange(len(counts)), counts.sum(axis=1))
        counts = np.zeros((len(counts), piece + 1), dtype=np.int32)
        np.add.at(counts, (pair[kept], of[kept]), 1)
        frames = self._views.frames[self._chosen]
        normals = np.einsum("ijk,ik->ij", self._bodies.turned[frames[pair[kept]]], planes.normals[kept])
        bodies = self._bodies.roots[frames].astype(np.int32)
        return MotionProof(self._scene, self._motion.beginning(piece + 1), end, rho, bodies, counts, ends[kept], normals)
