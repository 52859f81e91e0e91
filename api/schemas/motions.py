"""This module holds the bodies of requests about motions and of the answers."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from certifier.outcome import Guarantee, Outcome
from jobs.certify_path import GivenMotion
from jobs.fields import Flag, SceneName
from planner.motion.space import Space


class MotionRequest(GivenMotion):
    """Asks for a proof of a motion: straight between waypoints `q` or `s`, or along Bezier pieces or a B-spline."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"scene": "iiwa-shelf", "q": [[0, 0.3, 0, -1.8, 0, 0.9, 0], [0.4, 0.5, 0, -1.5, 0, 0.9, 0]], "clearance": True}]
        }
    )

    scene: SceneName
    prove: Flag = Field(False, description="Whether to answer with the proof file as well.")


class SceneReference(BaseModel):
    """Names a scene, and its content by its hash."""

    name: str = Field(description="What the scene is called.")
    hash: str = Field(description="SHA-256 of the scene's content.")


class Place(BaseModel):
    """Names a place on a motion."""

    piece: int = Field(description="The polynomial piece, or that from waypoint `piece` to the next one; they count from 0.")
    time: float = Field(description="Which part of the piece is behind, from 0 to 1.")
    q: list[float] = Field(description="Joint positions there, in radians or metres.")


class Approach(Place):
    """Names a place on a motion, and a pair of bodies with its distance there."""

    a: str = Field(description="The first geometry of the pair.")
    b: str = Field(description="The second geometry of the pair.")
    distance: float = Field(
        description="How far the bodies, with the scene's padding, are apart there, in metres, in floating point; 0 where they overlap. "
        "It has no unit where the pair stands for a `cone` or a `range` of angles."
    )


class MotionVerdict(BaseModel):
    """Says what has become of a motion. The proof has passed the verifier."""

    scene: SceneReference = Field(description="The scene that the motion is certified in.")
    space: Space = Field(description="In which coordinates the motion is straight, or polynomial.")
    degree: int = Field(description="The degree of the polynomial pieces; 1 for a motion that is straight between waypoints.")
    waypoints: int = Field(description="Number of waypoints; of polynomial pieces, the number of places where they begin or end.")
    outcome: Outcome = Field(description="`certified`, `refuted` (a contact), `too_close`, or `inconclusive` (too many intervals).")
    guarantee: Guarantee = Field(description="`exact` for a motion that is certified, otherwise `none`.")
    certified_to: Place | None = Field(description="Up to where every pair is proved to be apart; null where nothing is proved.")
    padding: float = Field(description="Metres that were added around every body, beyond the scene's padding.")
    proved_distance: float | None = Field(
        description="The distance of the padded bodies that the proof happens to show up to there, and in the tube, in metres. They may be "
        "many times as far apart; `clearance` says how far."
    )
    margin: float | None = Field(description="The same as `proved_distance`.", deprecated=True)
    clearance: float | None = Field(
        description="A proved lower bound in metres of the distance of the padded bodies, all along the motion and in the tube. Without a "
        "tube, that of `nearest` is larger by at most 0.1 mm and by at most 10 %, or by 0.4 micrometres. Null where it was not asked for, "
        "for a motion that is not certified, and where it takes more than a million intervals."
    )
    nearest: Approach | None = Field(description="Where the padded bodies come closest, as `clearance` is about; null where that is null.")
    tube: float | None = Field(description="Joint positions that are off by this much, in radians or metres, are proved as well.")
    stop: Approach | None = Field(
        description="The first contact, or where bodies first come nearer than `padding` allows, or too close to tell; null for a motion "
        "that is certified."
    )
    not_covered_summary: str | None = Field(
        description="Which pairs of geometries the proof is not about, in a sentence; `not_covered` of the scene lists them. Null in a "
        "verdict that an earlier version stored."
    )
    intervals: int = Field(description="How many planes the proof has.")
    seconds: float = Field(description="How long the search and the verification took together.")
    verify_seconds: float = Field(description="How long the verification took.")


class MotionResponse(MotionVerdict):
    """Says what has become of a motion, and gives the proof."""

    proof: str | None = Field(description="The proof file in base 64, of the motion or of its beginning; null where it was not asked for.")


class JobMotion(MotionVerdict):
    """Says what has become of the motion of a job, and names the proof."""

    @model_validator(mode="before")
    @classmethod
    def _of_an_earlier_version(cls, stored: dict[str, Any]) -> dict[str, Any]:
        """Fills in what the verdict of an earlier version lacks."""
        later = dict.fromkeys(("clearance", "nearest", "not_covered_summary"))
        return {"padding": 0.0, "proved_distance": stored.get("margin"), **later, **stored}

    proof: str | None = Field(description="SHA-256 of the proof file, of the motion or of its beginning; null where nothing is proved.")
