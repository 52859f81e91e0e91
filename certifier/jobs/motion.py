"""A motion is certified in this process by a plain call, which verifies what it has found."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from certifier.model import Scene
from certifier.motion.search import Stop, search
from certifier.outcome import Guarantee, Outcome
from certifier.proof.container import with_scene
from certifier.proof.motion import Motion, MotionProof
from certifier.verify.motion import MotionStatement, verify_motion


@dataclass(frozen=True)
class MotionVerdict:
    """A verdict says what has become of a motion.

    Attributes:
        statement: what is proved of the motion, or of its beginning; None where nothing is.
        proof: the file that proves it, with the scene; None where there is none.
        stop: where the motion first touches or comes too close; None where all of it is certified.
        intervals: how many planes the proof holds.
        seconds: how long the search and the verification took together.
        verify_seconds: how long the verification took.
    """

    scene: Scene
    motion: Motion
    statement: MotionStatement | None
    proof: bytes | None
    stop: Stop | None
    intervals: int
    seconds: float
    verify_seconds: float

    @property
    def outcome(self) -> Outcome:
        return Outcome.CERTIFIED if self.stop is None else self.stop.outcome

    def document(self) -> dict[str, Any]:
        """Returns the verdict as JSON-able data, whose keys are stable (docs/motions.md)."""
        scene, statement, stop = self.scene, self.statement, self.stop
        return {
            "scene": {"name": scene.name, "hash": scene.hash},
            "space": self.motion.space.value,
            "waypoints": len(self.motion.waypoints),
            "outcome": self.outcome.value,
            "guarantee": (Guarantee.EXACT if stop is None else Guarantee.NONE).value,
            "certified_to": statement and self._place(statement.motion.pieces - 1, statement.end),
            "margin": statement and statement.gap,
            "tube": statement.rho if statement and statement.rho else None,
            "stop": stop
            and {"a": stop.pair.a, "b": stop.pair.b, **self._place(stop.piece, stop.time), "distance": max(0.0, stop.distance)},
            "intervals": self.intervals,
            "seconds": self.seconds,
            "verify_seconds": self.verify_seconds,
        }

    def _place(self, piece: int, time: float) -> dict[str, Any]:
        """Returns a place on the motion, with the joint positions there."""
        point = self.motion.at(piece, time)
        q = self.scene.to_q(point) if self.motion.space == "s" else point
        return {"piece": piece, "time": time, "q": q.tolist()}


def certify(scene: Scene, motion: Motion, tube: bool = False) -> MotionVerdict:
    """Certifies a motion.

    Args:
        motion: that certifier.motion.given has accepted.
        tube: whether to look for the largest tube about it.

    Raises:
        ProofError: the proof that was found does not hold; nothing is said then.
    """
    start = time.perf_counter()
    found = search(scene, motion, tube)
    searched = time.perf_counter()
    if found.proof is None:
        return MotionVerdict(scene, motion, None, None, found.stop, 0, searched - start, 0.0)
    data = found.proof.to_bytes()
    statement = verify_motion(MotionProof.from_bytes(data, scene))
    verified = time.perf_counter()
    proof, intervals = with_scene(data, scene), len(found.proof.ends)
    return MotionVerdict(scene, motion, statement, proof, found.stop, intervals, verified - start, verified - searched)
