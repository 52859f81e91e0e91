"""A motion is certified in this process by a plain call, which verifies what it has found."""

from __future__ import annotations

import base64
import json
import time
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from certifier.errors import ProofError, RegionError
from certifier.model import WORLD, Geometry, Joint, JointKind, Pair, Scene
from certifier.motion.given import motion_of
from certifier.motion.padding import padding_of
from certifier.motion.search import Approach, Stop, search
from certifier.outcome import Guarantee, Outcome
from certifier.proof.container import with_scene
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.verify import uncovered
from certifier.verify.motion import MotionStatement, MotionVerifier


@dataclass(frozen=True)
class MotionVerdict:
    """A verdict says what has become of a motion.

    Attributes:
        statement: what is proved of the motion, or of its beginning; None where nothing is.
        planes: the file that proves it, without the scene; None where there is none.
        stop: where the motion first touches or comes too close; None where all of it is certified.
        nearest: where the padded bodies come closest, where the statement's gap is a tight bound of this; None where nobody asked, where
            there is a stop, and where it takes too many intervals.
        padding: metres that were added around every body, beyond the scene's padding.
        intervals: how many planes the proof holds.
        seconds: how long the search and the verification took together.
        verify_seconds: how long the verification took.
    """

    scene: Scene
    motion: Motion
    statement: MotionStatement | None
    planes: bytes | None
    stop: Stop | None
    nearest: Approach | None
    padding: float
    intervals: int
    seconds: float
    verify_seconds: float

    @property
    def proof(self) -> bytes | None:
        """Returns the file that proves it, with the scene."""
        return None if self.planes is None else with_scene(self.planes, self.scene)

    @property
    def outcome(self) -> Outcome:
        return Outcome.CERTIFIED if self.stop is None else self.stop.outcome

    def document(self) -> dict[str, Any]:
        """Returns the verdict as JSON-able data, whose keys are stable (docs/motions.md)."""
        scene, statement, stop = self.scene, self.statement, self.stop
        return {
            "scene": {"name": scene.name, "hash": scene.hash},
            "space": self.motion.space.value,
            "degree": self.motion.degree,
            "waypoints": len(self.motion.waypoints),
            "padding": self.padding,
            "outcome": self.outcome.value,
            "guarantee": (Guarantee.EXACT if stop is None else Guarantee.NONE).value,
            "certified_to": statement and self._place(statement.motion.pieces - 1, statement.end),
            "proved_distance": statement and statement.gap,
            "margin": statement and statement.gap,
            "clearance": statement.gap if statement and self.nearest else None,
            "nearest": self.nearest and self._approach(self.nearest),
            "tube": statement.rho if statement and statement.rho else None,
            "stop": stop and self._approach(stop),
            "not_covered_summary": uncovered.document(scene)["summary"],
            "intervals": self.intervals,
            "seconds": self.seconds,
            "verify_seconds": self.verify_seconds,
        }

    def _approach(self, found: Approach) -> dict[str, Any]:
        """Returns a place on the motion with the pair and its distance there."""
        pair, place = found.pair, self._place(found.piece, found.time)
        return {"a": pair.a, "b": pair.b, **place, "distance": max(0.0, found.distance)}

    def _place(self, piece: int, time: float) -> dict[str, Any]:
        """Returns a place on the motion, with the joint positions there."""
        point = self.motion.at(piece, time)
        q = self.scene.to_q(point) if self.motion.space is Space.S else point
        return {"piece": piece, "time": time, "q": q.tolist()}


def certify(scene: Scene, motion: Motion, tube: bool = False, padding: float = 0.0, clearance: bool = False) -> MotionVerdict:
    """Certifies a motion.

    Args:
        motion: that certifier.motion.given has accepted.
        tube: whether to look for the largest tube about it.
        padding: metres that are added around every body, beyond the scene's padding, so that the bodies of a pair have to be twice as far
            apart. certifier.motion.given.padding_of has accepted it.
        clearance: whether to look for a proof that shows nearly the least distance.

    Raises:
        ProofError: the proof that was found does not hold; nothing is said then.
        RegionError: has_conditions, for padding or a clearance in a scene with conditions.
    """
    if scene.conditions and (padding or clearance):
        field = "padding" if padding else "clearance"
        hint = "leave it out, or ask about the scene without its conditions"
        raise RegionError("has_conditions", f"{field} is about bodies, and this scene has conditions", field=field, hint=hint)
    start = time.perf_counter()
    found = search(scene, motion, tube, padding, clearance)
    searched = time.perf_counter()
    if found.proof is None:
        return MotionVerdict(scene, motion, None, None, found.stop, None, padding, 0, searched - start, 0.0)
    data = found.proof.to_bytes()
    statement = _verifier(scene).verify(MotionProof.from_bytes(data, scene))
    if statement.gap < 2 * padding:
        problem = f"the proof shows that the bodies are {statement.gap} m apart, and the padding of the request asks for {2 * padding} m"
        raise ProofError("proof_motion", problem, field="padding", hint="ask for a little less")
    verified = time.perf_counter()
    seconds = verified - start, verified - searched
    return MotionVerdict(scene, motion, statement, data, found.stop, found.nearest, padding, len(found.proof.ends), *seconds)


@lru_cache(maxsize=4)
def _verifier(scene: Scene) -> MotionVerifier:
    return MotionVerifier(scene)


def keep(text: str) -> Scene:
    """Returns the scene of a document, for all calls about it (certifier.isolation.child)."""
    return Scene.from_document(json.loads(text))


def certify_in_child(payload: dict[str, Any], scene: Scene) -> dict[str, Any]:
    """Returns the document of a verdict, with the ``proof`` in base 64 or None. A child process runs this function.

    Args:
        payload: the motion, as certifier.motion.given.motion_of takes it; ``space`` or None; ``tube``;
            ``padding`` and ``clearance``, or neither; and ``prove``, whether to give the proof.

    Raises:
        RegionError: as certifier.motion.given; the field names the place in the payload.
    """
    motion = motion_of(scene, payload, Space(payload["space"]) if payload["space"] else None)
    padding = padding_of(payload.get("padding", 0.0))
    verdict = certify(scene, motion, payload["tube"], padding, payload.get("clearance", False))
    proof = verdict.proof if payload["prove"] else None
    return {**verdict.document(), "proof": proof and base64.b64encode(proof).decode()}


def swing() -> Scene:
    """Returns a scene in which a ball swings about a post. A motion in it loads the compiled functions that motions need."""
    joint = Joint("arm/turn", JointKind.REVOLUTE, WORLD, "arm/link", np.array([0.0, 0.0, 1.0]), np.eye(4), np.eye(4), 0, -1.0, 1.0)
    balls = [Geometry(f"{body}/ball", body, np.array([[x, 0.0, 0.0]]), 0.1, {}) for body, x in (("arm/link", 1.0), (WORLD, 0.0))]
    pair = Pair(balls[0].name, balls[1].name)
    return Scene("swing", (joint,), (WORLD, "arm/link"), tuple(balls), (pair,), (), np.zeros(1))


def warm_up() -> None:
    """Loads the compiled functions that a motion needs."""
    certify(swing(), Motion(Space.Q, np.array([[0.0], [0.5]])), tube=True, clearance=True)
