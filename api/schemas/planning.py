"""These models describe the questions that planners ask about the regions of a scene, and the answers."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from certifier.outcome import Guarantee
from jobs.curves import BEZIER, CONTROL_POINTS, KNOTS, Bezier, ControlPoints, Knots, one_curve
from jobs.fields import NamedPoints, Points, Real, Request, SceneName
from planner.motion.space import Space

MAX_POINTS, MAX_NEAREST = 10_000, 1000
MAX_SEGMENTS = MAX_WAYPOINTS = 500

SCENE, REGION = "planar-2dof", "1f0c6d4e-6d0e-4f0e-9a51-0c1f5d0a7b11"
MOTION = "5b8f8d6e-27a5-4f1c-9a83-6a1a2d0f2d6e"
MAP = "0d6f0f5e-52c7-4a3f-8d5c-0b7f7a9f3c21"

POINTS_IN_Q = "(k, n), joint positions in radians or metres, one row a point."
POINTS_IN_S = "(k, n), tangent-space coordinates s, one row a point."
Moment = Annotated[Real, Field(ge=-1e100, le=1e100)]
"""Differences of times do not overflow."""
Ends = Annotated[Points, Field(min_length=2, max_length=2)]
NamedEnds = Annotated[NamedPoints, Field(min_length=2, max_length=2)]
Q = Annotated[list[float], Field(description="(n,), joint positions in radians or metres.", examples=[[0.4, 0.3]])]
S = Annotated[list[float], Field(description="(n,), tangent-space coordinates.", examples=[[0.2027, 0.1511]])]
RegionId = Annotated[str, Field(description="Id of a region.", examples=[REGION])]
MotionId = Annotated[str, Field(description="Id of a proved motion.", examples=[MOTION])]
MapJob = Annotated[str, Field(description="Id of a job that has grown a map.", examples=[MAP])]
Distance = Annotated[float, Field(description="Euclidean distance in s.", examples=[0.05])]


class _Points(Request):
    """Gives points, either as joint positions `q` or as tangent-space coordinates `s`."""

    scene: SceneName
    q: NamedPoints | None = Field(None, min_length=1, max_length=MAX_POINTS, description=POINTS_IN_Q, examples=[[[0.4, 0.3]]])
    s: Points | None = Field(None, min_length=1, max_length=MAX_POINTS, description=POINTS_IN_S, examples=[[[0.2027, 0.1511]]])

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if (self.q is None) == (self.s is None):
            raise ValueError("give either q or s")
        return self


class ContainsRequest(_Points):
    """Asks which regions contain points. The request gives either joint positions `q` or tangent-space coordinates `s`."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"scene": "iiwa-shelf", "q": [[0, 0.3, 0, -1.8, 0, 0.9, 0]]}]})


class NearestRequest(_Points):
    """Asks for the region that is nearest to each point, either joint positions `q` or tangent-space coordinates `s`."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"scene": "iiwa-shelf", "q": [[0, 0.3, 0, -1.8, 0, 0.9, 0]]}]})

    q: NamedPoints | None = Field(None, min_length=1, max_length=MAX_NEAREST, description=POINTS_IN_Q, examples=[[[0.4, 0.3]]])
    s: Points | None = Field(None, min_length=1, max_length=MAX_NEAREST, description=POINTS_IN_S, examples=[[[0.2027, 0.1511]]])


class _Motion(Request):
    """Says in which coordinates a motion is straight."""

    scene: SceneName
    space: Space = Field(
        Space.Q,
        description="Where the motion is straight between waypoints: in joint positions `q`, as a robot's interpolation usually is, or in "
        "tangent-space coordinates `s`. Waypoints that are given as `q` are rounded to `s` first in the latter case; those given as `s` "
        "need the space `s`. Of a curve, the coordinates of its control points.",
        examples=["q"],
    )

    def fits(self, s: object) -> None:
        """Refuses waypoints in s for a motion that is straight in q."""
        if s is not None and self.space is Space.Q:
            raise ValueError("a motion through waypoints in s is straight in s: give space s, or waypoints in q")


class SegmentRequest(_Motion):
    """Asks about straight motions, each of its own, such as the edges of a roadmap."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"scene": "planar-2dof", "q": [[[0.4, 0.3], [0.6, 0.3]], [[0.4, 0.3], [1.5, -2.0]]]}]}
    )

    q: Annotated[list[NamedEnds], Field(fail_fast=True)] | None = Field(
        None,
        min_length=1,
        max_length=MAX_SEGMENTS,
        description="(k, 2, n), begin and end of each motion, joint positions in radians or metres.",
        examples=[[[[0.4, 0.3], [0.6, 0.3]]]],
    )
    s: Annotated[list[Ends], Field(fail_fast=True)] | None = Field(
        None,
        min_length=1,
        max_length=MAX_SEGMENTS,
        description="(k, 2, n), begin and end of each motion, tangent-space coordinates.",
        examples=[[[[0.2, 0.15], [0.3, 0.15]]]],
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if (self.q is None) == (self.s is None):
            raise ValueError("give either q or s")
        self.fits(self.s)
        return self


class PathRequest(_Motion):
    """Asks about a path that is straight between its waypoints, or about a curve; with times, it is a trajectory."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"scene": "planar-2dof", "q": [[0.4, 0.3], [0.6, 0.3], [0.6, 0.5]], "times": [0, 0.5, 1.25]}]}
    )

    q: NamedPoints | None = Field(
        None,
        min_length=2,
        max_length=MAX_WAYPOINTS,
        description="(k, n), waypoints, joint positions in radians or metres.",
        examples=[[[0.4, 0.3], [0.6, 0.3]]],
    )
    s: Points | None = Field(
        None,
        min_length=2,
        max_length=MAX_WAYPOINTS,
        description="(k, n), waypoints, tangent-space coordinates.",
        examples=[[[0.2, 0.15], [0.3, 0.15]]],
    )
    bezier: Bezier | None = Field(None, max_length=MAX_SEGMENTS, description=BEZIER)
    knots: Knots | None = Field(None, description=KNOTS)
    control_points: ControlPoints | None = Field(None, max_length=MAX_SEGMENTS, description=CONTROL_POINTS)
    times: Annotated[list[Moment], Field(fail_fast=True)] | None = Field(
        None,
        min_length=2,
        max_length=MAX_WAYPOINTS + 1,
        description="(k,), ascending: when the path is at each waypoint, or, of `bezier`, when pieces begin and end. The "
        "answer is in these; 0, 1, 2 ... where they are left out. A B-spline has its knots instead.",
        examples=[[0.0, 0.5]],
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        one_curve(self.q, self.s, self.bezier, self.knots, self.control_points)
        self.fits(self.s)
        if self.times is not None and self.knots is not None:
            raise ValueError("the knots are the times of a B-spline: leave times out")
        places = len(self.q or self.s or []) or len(self.bezier or []) + 1
        if self.times is not None and len(self.times) != places:
            raise ValueError(f"there are {len(self.times)} times, where {places} belong")
        if self.times is not None and any(b <= a for a, b in pairwise(self.times)):
            raise ValueError("times must ascend")
        return self


class Answer(BaseModel):
    """All answers say which regions they are about."""

    scene: str = Field(description="Id of the scene.", examples=["5a9e0c7b12de34f0"])
    version: int = Field(
        description="How often a region of the scene had been added or deleted. Answers with the same version are about the same regions.",
        examples=[12],
    )
    regions: int = Field(description="Number of regions of the scene.", examples=[12])


class Hit(BaseModel):
    """Names a region that contains the point."""

    region: RegionId
    margin: float = Field(description="Distance in s from the point to the region's nearest face.", examples=[0.05])
    guarantee: Guarantee = Field(description="What the region's certificate is worth.", examples=["exact"])


class Containment(BaseModel):
    """Answers for one point."""

    inside: bool = Field(
        description="Whether some region, the tube of some motion, or the scene's latest map proves the point free.", examples=[True]
    )
    regions: list[Hit] = Field(description="The regions that contain the point, the one with the largest margin first.")
    margin: float | None = Field(description="The largest margin; null where no region contains the point.", examples=[0.05])
    motions: list[MotionId] = Field(description="The proved motions whose tubes contain the point.")
    map: bool | None = Field(description="Whether the scene's latest map proves the point free; null where the scene has no map.")


class ContainsResponse(Answer):
    """Holds one answer for each point, in order."""

    map: MapJob | None = Field(description="The job that has grown the scene's latest map; null where the scene has none.")

    points: list[Containment] = Field(description="One answer for each point, in order.")


class Near(BaseModel):
    """Names a region near a point, or the map. The nearest point is found in floating point. It lies 1e-9 behind every face, in s."""

    region: RegionId | None = Field(description="The region; null for the map.", examples=[REGION])
    map: MapJob | None = Field(default=None, description="The job that has grown the map; null for a region.", examples=[MAP])
    guarantee: Guarantee = Field(description="What the certificate is worth.", examples=["exact"])
    distance: Distance
    q: Q
    s: S


class NearestPoint(BaseModel):
    """Answers for one point."""

    nearest: Near | None = Field(
        description="The nearest point that a region or the scene's latest map proves free, distance 0 where it is the point itself; null "
        "where nothing was found, or a joint is outside its limits."
    )
    complete: bool = Field(
        description="False where the search in the map ended early, after much work: the map may prove a point that is nearer.",
        examples=[True],
    )


class NearestResponse(Answer):
    """Holds one answer for each point, in order."""

    map: MapJob | None = Field(description="The job that has grown the scene's latest map; null where the scene has none.")
    points: list[NearestPoint] = Field(description="One answer for each point, in order.")


class Piece(BaseModel):
    """Says what proves that the motion is free between two times: a region that contains it, the tube of a proved motion, or a map."""

    begin: float = Field(description="Time at which the piece begins; the doubles nearest to the exact ends are shown.", examples=[0.0])
    end: float = Field(description="Time at which the piece ends, and the next begins.", examples=[0.625])
    region: RegionId | None = Field(
        description="The region that contains the motion here; null where a motion's tube or a map proves it.", examples=[REGION]
    )
    motion: MotionId | None = Field(
        default=None, description="The proved motion whose tube contains the motion here; null for a region or a map.", examples=[MOTION]
    )
    map: MapJob | None = Field(default=None, description="The job whose map proves the motion here; null for the others.")
    guarantee: Guarantee = Field(description="What the certificate is worth.", examples=["exact"])


class Uncovered(BaseModel):
    """Says where a motion stops being covered."""

    time: float = Field(description="The motion is covered up to here, and not proved to be from here on.", examples=[0.625])
    segment: int = Field(description="Number of the segment between two waypoints, from 0 on.", examples=[0])
    q: Q
    s: S | None = Field(description="The same configuration in s; null where a joint is outside its limits.")
    next: Near | None = Field(
        description="The nearest region that does not contain this configuration, and how far it is; null where there is none, or no s."
    )


class Covering(BaseModel):
    """Says whether every point of a motion is proved to be free: by certified regions, proved motions, or the scene's latest map."""

    covered: bool = Field(description="True only if this is proved, for the numbers of the request taken literally.", examples=[True])
    pieces: list[Piece] = Field(description="What covers the motion, in order, as far as it is covered from its start on.")
    uncovered: Uncovered | None = Field(description="Where the motion stops being covered; null where it is covered.")


class SegmentResponse(Answer):
    """Holds one answer for each motion, in order, with times from 0 at its begin to 1 at its end."""

    segments: list[Covering] = Field(description="One answer for each motion, in order.")


class PathResponse(Covering, Answer):
    """Says whether a path is covered."""


class GraphRegion(BaseModel):
    """Names a region and the component that it belongs to."""

    region: RegionId
    guarantee: Guarantee = Field(description="What the region's certificate is worth.", examples=["exact"])
    component: int = Field(description="Number of its component, from 0 on; the component with the most regions is number 0.", examples=[0])


class Edge(BaseModel):
    """Names two regions that overlap. A motion may go from one to the other through the witness."""

    a: RegionId
    b: RegionId
    depth: float = Field(description="Radius of the largest ball inside of both, in s.", examples=[0.1])
    q: Q
    s: S


class Gap(BaseModel):
    """Names the place where a component comes nearest to another. A region that is grown there may join them."""

    a: RegionId
    b: RegionId
    distance: Distance
    q: Annotated[
        list[float] | None,
        Field(
            description="(n,), a seed to try: joint positions midway between a and b, or near there, free of collision and in no region; "
            "null where none was found.",
            examples=[[0.4, 0.3]],
        ),
    ]
    q_a: Annotated[list[float], Field(description="(n,), joint positions of a's point that is nearest to b.", examples=[[0.3, 0.3]])]
    q_b: Annotated[list[float], Field(description="(n,), joint positions of b's point that is nearest to a.", examples=[[0.5, 0.3]])]
    map: bool = Field(
        description="Whether the scene's latest map proves the motion from q_a straight in q to q_b: no region has to be grown for it.",
        examples=[False],
    )


class GraphResponse(Answer):
    """Describes the connected regions of a scene."""

    map: MapJob | None = Field(description="The job that has grown the scene's latest map; null where the scene has none.")
    complete: bool = Field(
        description="Whether every pair of regions has been compared. Pairs are compared once, when this is asked, for a few seconds at a "
        "time: ask again until it is true.",
        examples=[True],
    )
    nodes: list[GraphRegion] = Field(description="All regions of the scene.")
    edges: list[Edge] = Field(description="The pairs of regions that overlap; regions that only touch do not.")
    components: int = Field(description="Number of sets of regions that edges join.", examples=[1])
    gaps: list[Gap] = Field(description="For up to 20 of the largest components, the gap to the nearest other; empty until complete.")
