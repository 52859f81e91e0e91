"""These models describe the request for a trajectory, and the answer."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from api.schemas.planning import REGION, Answer, Distance, Near, Piece, Q, RegionId, Uncovered
from certifier.outcome import Guarantee
from jobs.fields import Request, SceneName

SPEED, ACCELERATION = 1.0, 2.0
"""Limits of every joint where a request gives none, in rad/s and rad/s² (or m/s and m/s²)."""

Positive = Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False)]
Positives = Annotated[list[Positive], Field(min_length=1, max_length=64)]
Configuration = Annotated[list[Annotated[float, Field(allow_inf_nan=False)]], Field(min_length=1, max_length=64)]
RegionPrefix = Annotated[str, Field(min_length=4, max_length=64, description="Id of a region, or its first characters.")]
End = Configuration | RegionPrefix


class PlanRequest(Request):
    """Asks for a trajectory from rest to rest through the certified regions of a scene."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"scene": "planar-2dof", "start": [0, 0], "goal": [0.35, -0.2]}]})

    scene: SceneName
    start: End = Field(
        description="Where the motion begins: (n,), joint positions in radians or metres, or the id of a region, for any point of it.",
        examples=[[0.0, 0.0]],
    )
    goal: End = Field(description="Where the motion ends, like `start`.", examples=[[0.35, -0.2], REGION])
    speed: Positive | Positives = Field(
        SPEED, description="Largest speed, in rad/s or m/s, 1e-6 to 1e6: one for all joints, or (n,), one for each.", examples=[1.0]
    )
    acceleration: Positive | Positives = Field(
        ACCELERATION,
        description="Largest acceleration, in rad/s² or m/s², 1e-6 to 1e6: one for all joints, or (n,), one for each.",
        examples=[2.0],
    )


class Reason(StrEnum):
    """Says why there is no trajectory."""

    START_UNCOVERED = "start_uncovered"
    """No region contains the start; `nearest` is the region that is nearest to it."""
    GOAL_UNCOVERED = "goal_uncovered"
    """No region contains the goal; `nearest` is the region that is nearest to it."""
    DISCONNECTED = "disconnected"
    """Both are in regions, but no overlaps lead from one to the other; `gap` says where to seed a region."""
    NOT_PROVED = "not_proved"
    """Regions lead from one to the other, but no trajectory was found that is proved to be covered; `uncovered` is about the last one."""


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
    """Holds a trajectory, straight in q between its configurations and proved to be in certified regions; or why there is none.

    Where there is none, its lists are empty, and its numbers null.
    """

    found: bool = Field(description="Whether there is a trajectory. It is proved to be covered, for the numbers of the answer.")
    complete: bool = Field(
        description="Whether every pair of regions has been compared. Where it is false, ask again: more pairs are compared every time."
    )
    q: list[Q] = Field(default_factory=list, description="(k, n), the configurations, joined by straight lines in q.")
    t: list[float] = Field(
        default_factory=list, description="(k,), when the robot is there, in seconds from 0 on.", examples=[[0.0, 0.1, 0.2]]
    )
    pieces: list[Piece] = Field(
        default_factory=list, description="The regions that contain the trajectory, in order, with begin and end in seconds."
    )
    length: float | None = Field(default=None, description="Length in q, in radians (and metres).", examples=[0.41])
    duration: float | None = Field(default=None, description="Seconds that the trajectory takes.", examples=[1.2])
    guarantee: Guarantee | None = Field(default=None, description="What the weakest of the regions' certificates is worth.")
    reason: Reason | None = Field(
        default=None,
        description="Why there is no trajectory: `start_uncovered` or `goal_uncovered` (see `nearest`), `disconnected` (see `gap`), or "
        "`not_proved` (see `uncovered`); null where there is one.",
    )
    nearest: Near | None = Field(default=None, description="The region that is nearest to the end that is not covered.")
    gap: PlanGap | None = Field(default=None, description="Where the regions of the two ends come nearest to each other.")
    uncovered: Uncovered | None = Field(default=None, description="Where the last trajectory that was tried is not proved to be covered.")
