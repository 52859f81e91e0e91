"""These models describe the request for a motion, and the answer."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from api.schemas.planning import MOTION, REGION, Answer, Distance, MotionId, Near, Piece, Q, RegionId, Uncovered
from certifier.outcome import Guarantee
from jobs.fields import End, Flag, Positions, Real, Request, SceneName
from planner.trajectory.plan import ACCELERATION, SPEED

SECONDS, MOST_SECONDS = 5.0, 50.0
"""How long a motion is searched for where a request does not say, and at most."""
MOST_GOALS = 100

Positive = Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False)]
Positives = Annotated[list[Positive], Field(min_length=1, max_length=64)]
Three = Annotated[list[Real], Field(min_length=3, max_length=3)]


class FramePose(Request):
    """Gives a pose of a frame in the world."""

    frame: str = Field(
        min_length=1,
        max_length=200,
        description="The body whose frame it is, `model/body`; its last part is enough where no other body has it.",
        examples=["iiwa/flange"],
    )
    position: Three = Field(description="(3,), metres.", examples=[[0.55, 0.1, 0.5]])
    rpy: Three | None = Field(
        None,
        description="(3,), roll, pitch and yaw in radians: turns about the world's x, then y, then z. Without it, the frame keeps its "
        "orientation on a line.",
        examples=[[0.0, 1.57, 0.0]],
    )


class Tolerance(Request):
    """Says how far the frame may be from the line, at each part of the way."""

    metres: Real = Field(1e-3, ge=1e-6, le=1.0, description="Of the frame's origin.", examples=[1e-3])
    radians: Real = Field(1e-2, ge=1e-6, le=3.0, description="Of its orientation.", examples=[1e-2])


class PlanRequest(Request):
    """Asks for a motion from rest to rest that is proved to be free of collision."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"scene": "planar-2dof", "start": [0, 0], "goal": [0.35, -0.2]}]})

    scene: SceneName
    start: End = Field(
        description="Where the motion begins: (n,), joint positions in radians or metres, or names of configurations; or the id "
        "of a region, for any point of it.",
        examples=[[0.0, 0.0]],
    )
    goal: End | None = Field(None, description="Where the motion ends, like `start`.", examples=[[0.35, -0.2], REGION])
    goals: list[Positions] | None = Field(
        None,
        min_length=1,
        max_length=MOST_GOALS,
        description="(k, n), instead of `goal`: several configurations. The motion ends in the one to which it is shortest.",
        examples=[[[0.35, -0.2], [-0.4, 0.3]]],
    )
    pose: FramePose | None = Field(
        None,
        description="Instead of `goal`: where a frame of the robot ends.",
        examples=[{"frame": "iiwa/flange", "position": [0.55, 0.1, 0.5], "rpy": [0.0, 1.57, 0.0]}],
    )
    line: Tolerance | None = Field(
        None,
        description="With `pose`: the frame goes there on a straight line, within these tolerances.",
        examples=[{"metres": 0.001, "radians": 0.01}],
    )
    via: list[Positions] = Field(
        default_factory=list,
        max_length=MOST_GOALS,
        description="(m, n), configurations that the motion goes through, in this order.",
        examples=[[[0.2, 0.1]]],
    )
    speed: Positive | Positives = Field(
        SPEED, description="Largest speed, in rad/s or m/s, 1e-6 to 1e6: one for all joints, or (n,), one for each.", examples=[1.0]
    )
    acceleration: Positive | Positives = Field(
        ACCELERATION,
        description="Largest acceleration, in rad/s² or m/s², 1e-6 to 1e6: one for all joints, or (n,), one for each.",
        examples=[2.0],
    )
    regions_only: Flag = Field(False, description="Whether the motion has to lie in certified regions. Nothing else is searched then.")
    seconds: float = Field(SECONDS, ge=0.01, le=MOST_SECONDS, description="How long to search for a motion.", examples=[SECONDS])
    prove: Flag = Field(False, description="Whether to answer with a proof file about the whole motion, `proof`.")

    @model_validator(mode="after")
    def _one_goal(self) -> Self:
        if sum(given is not None for given in (self.goal, self.goals, self.pose)) != 1:
            raise ValueError("give one of goal, goals and pose")
        if self.regions_only and (self.via or self.goal is None):
            raise ValueError("regions_only knows one start and one goal: leave out via, goals and pose, or regions_only")
        if self.line is not None and (self.pose is None or self.via):
            raise ValueError("a line leads from the start to a pose: give pose, and leave out via")
        if self.pose is not None and self.line is None and self.pose.rpy is None:
            raise ValueError("a pose has an orientation, unless the frame goes there on a line: give rpy")
        return self


class Reason(StrEnum):
    """Says why there is no motion."""

    START_OUTSIDE_LIMITS = "start_outside_limits"
    """A joint of the start is outside its limits; `limit` says which."""
    GOAL_OUTSIDE_LIMITS = "goal_outside_limits"
    """A joint of the goal is outside its limits; of several goals, of all of them."""
    VIA_OUTSIDE_LIMITS = "via_outside_limits"
    """A joint of a configuration of `via` is outside its limits."""
    START_IN_COLLISION = "start_in_collision"
    """Bodies touch at the start; `collision` says which, and where it is free near by."""
    GOAL_IN_COLLISION = "goal_in_collision"
    """Bodies touch at the goal, or at all goals."""
    VIA_IN_COLLISION = "via_in_collision"
    """Bodies touch at a configuration of `via`."""
    POSE_UNREACHABLE = "pose_unreachable"
    """No configuration was found at which the frame has the pose; `reached` says how near one comes."""
    POSE_IN_COLLISION = "pose_in_collision"
    """At every configuration found at which the frame has the pose, bodies touch."""
    LINE_LIMIT = "line_limit"
    """A joint is at its limit on the line; `line` says which, and where."""
    LINE_SINGULAR = "line_singular"
    """The arm cannot move the frame on along the line: it is stretched, axes are in line, or it has too few joints."""
    LINE_TOLERANCE = "line_tolerance"
    """The tolerances need segments that are too short."""
    LINE_COLLISION = "line_collision"
    """Bodies touch on the line; `line` says which, and where."""
    NO_MOTION = "no_motion"
    """No motion was found in time. There may be one."""
    NOT_CERTIFIED = "not_certified"
    """A motion was found, but none that could be certified: it passes by something too closely."""
    START_UNCOVERED = "start_uncovered"
    """With `regions_only`: no region contains the start; `nearest` is the region that is nearest to it."""
    GOAL_UNCOVERED = "goal_uncovered"
    """With `regions_only`: no region contains the goal; `nearest` is the region that is nearest to it."""
    DISCONNECTED = "disconnected"
    """With `regions_only`: both are in regions, but no overlaps lead from one to the other; `gap` says where to seed a region."""
    NOT_PROVED = "not_proved"
    """With `regions_only`: no trajectory was found that is proved to be covered; `uncovered` is about the last one."""


class BeyondLimit(BaseModel):
    """Names a joint that is outside its limits."""

    where: str = Field(description="The field of the request, as `start` or `via[0]`.", examples=["start"])
    joint: str = Field(description="Name of the joint.", examples=["arm/elbow"])
    value: float = Field(description="Where the request has it, in radians or metres.", examples=[3.0])
    lower: float | None = Field(description="Its lower limit; null for none.", examples=[-2.6])
    upper: float | None = Field(description="Its upper limit; null for none.", examples=[2.6])


class Collision(BaseModel):
    """Names a pair of bodies that touch, or says which condition is not kept."""

    where: str = Field(description="The field of the request, as `start` or `via[0]`.", examples=["start"])
    a: str = Field(description="The first geometry of the pair.")
    b: str = Field(description="The second geometry of the pair.")
    depth: float = Field(description="How deep the padded bodies are in each other, in metres.")
    free: list[float] | None = Field(description="(n,), free joint positions near by; null where none were found.")
    condition: str | None = Field(
        default=None,
        description="In words, which condition of the scene is not kept; null where two bodies touch.",
        examples=["the condition 'upright' is not kept: the angle is 21.2 degrees, and 15 at most"],
    )


class Reached(BaseModel):
    """Says how near to a pose the frame comes."""

    q: Q
    metres: float = Field(description="How far the frame's origin is from the position there.", examples=[0.12])
    radians: float = Field(description="By how much its orientation is off there.", examples=[0.3])


class LineStop(BaseModel):
    """Says where a motion along a line ends."""

    part: float = Field(description="How much of the line there is a motion for, from 0 to 1.", examples=[0.48])
    joint: str | None = Field(description="The joint that is at its limit; null for other reasons.", examples=["arm/elbow"])
    a: str | None = Field(description="The first geometry that touches; null for other reasons.", examples=["arm/lower/bar"])
    b: str | None = Field(description="The second geometry that touches; null for other reasons.", examples=["world/post"])


class PlanGap(BaseModel):
    """Names the place where the regions connected with the start are nearest to those connected with the goal."""

    start_regions: int = Field(description="Number of the regions that are connected with the start.", examples=[4])
    goal_regions: int = Field(description="Number of the regions that are connected with the goal.", examples=[2])
    start: RegionId
    goal: RegionId
    distance: Distance
    q: Annotated[
        list[float] | None,
        Field(
            description="(n,), a seed to try: joint positions midway between the two, or near there, free of collision and in no region; "
            "null where none was found.",
            examples=[[0.4, 0.3]],
        ),
    ]
    q_start: Annotated[list[float], Field(description="(n,), the point of the region `start` that is nearest.", examples=[[0.3, 0.3]])]
    q_goal: Annotated[list[float], Field(description="(n,), the point of the region `goal` that is nearest.", examples=[[0.5, 0.3]])]


class PlanResponse(Answer):
    """Holds a motion, straight in q between its configurations and proved to be free of collision; or why there is none.

    Where there is none, its lists are empty, and its numbers null.
    """

    found: bool = Field(description="Whether there is a motion. It is proved, for the numbers of the answer.")
    complete: bool = Field(
        description="Whether every pair of regions has been compared. Where it is false, ask again: more pairs are compared every time."
    )
    q: list[Q] = Field(default_factory=list, description="(k, n), the configurations, joined by straight lines in q.")
    t: list[float] = Field(
        default_factory=list, description="(k,), when the robot is there, in seconds from 0 on.", examples=[[0.0, 0.1, 0.2]]
    )
    pieces: list[Piece] = Field(
        default_factory=list, description="What proves the motion, in order, with begin and end in seconds: regions, or a proved motion."
    )
    length: float | None = Field(default=None, description="Length in q, in radians (and metres).", examples=[0.41])
    duration: float | None = Field(default=None, description="Seconds that the motion takes.", examples=[1.2])
    guarantee: Guarantee | None = Field(default=None, description="What the weakest of the certificates is worth.")
    motion: MotionId | None = Field(
        default=None, description="Where a proved motion's tube contains the answer: its id. Null for regions.", examples=[MOTION]
    )
    tube: float | None = Field(default=None, description="Half the width of that tube, in radians or metres.", examples=[0.02])
    proof: str | None = Field(
        default=None, description="The proof file in base 64, about exactly this motion; null where it was not asked for."
    )
    reason: Reason | None = Field(default=None, description="Why there is no motion; null where there is one.")
    limit: BeyondLimit | None = Field(default=None, description="The joint that is outside its limits.")
    collision: Collision | None = Field(default=None, description="The bodies that touch.")
    reached: Reached | None = Field(default=None, description="Where the frame comes nearest to the pose.")
    line: LineStop | None = Field(default=None, description="Where the motion along the line ends.")
    nearest: Near | None = Field(default=None, description="The region that is nearest to the end that is not covered.")
    gap: PlanGap | None = Field(default=None, description="Where the regions of the two ends come nearest to each other.")
    uncovered: Uncovered | None = Field(default=None, description="Where the last trajectory that was tried is not proved to be covered.")
