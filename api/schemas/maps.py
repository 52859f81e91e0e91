"""These models describe maps: what is proved of all of a scene's joint space."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

from certifier.outcome import Outcome
from db.states import JobState


class Proved(BaseModel):
    """Says how much of the collision-free configurations is proved. It is estimated from samples, and proves nothing."""

    value: float = Field(description="Proved part of the collision-free configurations, by volume in joint positions.")
    stderr: float = Field(description="Standard error of the value.")


class Wanted(BaseModel):
    """Says whether a map proves a configuration that it was to cover first."""

    q: list[float] = Field(description="Joint positions, in radians or metres.")
    state: Literal["proved", "open", "in_collision"] = Field(
        description="`proved` free of collision; `open`, where the map has no proof; `in_collision`, where it is not free."
    )


class StoredMap(BaseModel):
    """Describes a map whose proof has passed the verifier."""

    cells: int = Field(description="Number of cells in which pairs of bodies are proved apart.")
    uncovered_pairs: int = Field(
        description="Number of pairs without any cell. As long as there are some, no configuration is proved free."
    )
    at: list[Wanted] = Field(description="The configurations that the map was to cover first.")
    paths: list[float] = Field(
        default=[],
        description="How much of each motion that the map was to cover first is proved: a share of its length.",
        examples=[[1.0]],
    )
    proof: str = Field(description="SHA-256 of the proof file.")
    proof_bytes: int = Field(description="Size of the proof file.")
    free_set: bool = Field(description="Whether there is a free set for lookups: not where a pair has no cell, or the scene no pair.")


class JobMap(BaseModel):
    """Describes the map that a job grows."""

    state: JobState = Field(description="State of the job.")
    outcome: Outcome | None = Field(description="`certified` where the map covers as much as was asked for; null before the job ends.")
    ended: Literal["coverage", "deadline", "nothing_left", "size", "cancelled"] | None = Field(
        description="Why the map ended: it covers as much as was asked for; the deadline; nothing is left that a map could prove; the "
        "verifier would not read a larger map; cancelled. Null before the end, and for a job that has failed."
    )
    reason: str | None = Field(description="A sentence that says why the map ended.")
    seconds: float | None = Field(description="Seconds from the job's start to its end, or until now.")
    coverage: Proved | None = Field(description="How much is proved; null before the first round has ended.")
    cells: int = Field(description="Number of proved cells until now.")
    looked_at: int = Field(description="Number of cells that were looked at until now.")
    given_up: int = Field(description="Number of pieces of work that were given up, because the verifier refused what they found.")
    curve: list[tuple[float, float]] = Field(description="Seconds since the start, and what was proved by then.")
    former: str | None = Field(
        description="Id of the job whose map was taken over, as far as it holds here; null where there was none.",
        examples=["1f9b2a7c-5d3e-4f60-8a91-c2b7d4e6f801"],
    )
    stored: StoredMap | None = Field(description="The map, once its proof is verified and stored; null before.")
