"""These models describe covers: jobs that grow regions until a scene is covered, or configurations are connected."""

from __future__ import annotations

from pydantic import BaseModel, Field

from certifier.outcome import Outcome
from db.states import JobState


class Coverage(BaseModel):
    """Says how much of the collision-free configurations is in regions. It is estimated from samples, and proves nothing."""

    value: float = Field(description="Covered part of the collision-free configurations, by volume in joint positions.")
    stderr: float = Field(description="Standard error of the value.")
    samples: int = Field(description="Number of collision-free configurations that were drawn, uniform in joint positions.")


class CoverRegion(BaseModel):
    """Describes a region that a cover has begun."""

    job: str = Field(description="Id of the job that grows it.")
    number: int = Field(description="Number of the region among those that the cover has begun.")
    state: JobState = Field(description="State of the job that grows it.")
    status: str = Field(description="What that job does now, in the words of its `status`.", examples=["working"])
    region: str | None = Field(description="Id of the last certified region of that job.")
    reason: str | None = Field(description="A sentence that says why growing ended.")


class Cover(BaseModel):
    """Describes the results of a cover. What its last look at the scene has found is null before the first look."""

    state: JobState = Field(description="State of the job.")
    outcome: Outcome | None = Field(description="`certified` where all goals are reached; null before the job ends.")
    reason: str | None = Field(description="A sentence that says why the cover ended, and which goals it has not reached.")
    seconds: float | None = Field(description="Seconds from the job's start to its end, or until now.")
    regions: list[str] = Field(description="Ids of the certified regions that the cover has grown.")
    grown: list[CoverRegion] = Field(description="The regions that it has begun.")
    coverage: Coverage | None = Field(description="How much is covered.")
    curve: list[tuple[float, float, int]] = Field(
        description="For each look at the scene seconds since the start, the covered part, and the number of the scene's regions."
    )
    components: list[int] | None = Field(
        description="Number of regions of each connected component of the scene's regions, the component that covers most first."
    )
    largest: float | None = Field(description="Share of what is covered that is in the first component.")
    connected: bool | None = Field(description="Whether all regions of the scene are in one component.")
    connect: list[int | None] | None = Field(
        description="For each configuration to connect the component, from 0 on, whose region contains it; null where none does."
    )
    seeds: list[bool] | None = Field(description="For each given seed whether a region contains it.")
    paths: list[float] | None = Field(description="For each given path which part of it is covered from its start on, from 0 to 1.")
    missing: list[str] | None = Field(description="The goals that are not reached, in words.")
    obstacles: list[str] | None = Field(description="What could not be gone on with, in words.")
