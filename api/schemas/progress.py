"""These models say how far a job is: who works on it, and what holds its region back."""

from __future__ import annotations

from datetime import datetime

from pydantic import BaseModel, ConfigDict, Field


class Progress(BaseModel):
    """Says how far a job is."""

    settled: int | None = Field(
        description="Number of pairs that are settled in the job's last iteration, with those whose proofs of earlier ones serve. Null "
        "before the first iteration."
    )
    total: int | None = Field(description="Number of pairs of that iteration, those included.")
    share: float | None = Field(
        description="Share of the proposal that the job's last region keeps, by q-volume, as far as samples say; null without a region."
    )


PAIRS, DECIDE = "pairs", "decide"


class HeldWork(BaseModel):
    """Describes a piece of a job's work that a process holds."""

    job: str = Field(description="The job's id.")
    process: str = Field(description="Name of the process: host, process number, and when it began, with colons between.")
    work: str = Field(
        description="What the process does: `pairs` certifies pairs, `decide` decides what the job does next. Else it is a step of the "
        "job: `seed` looks for the polytope that growing begins with; `step` moves the faces of the last region, all pairs coupled; "
        "`accept` puts the proof of a region together and verifies it; `scout` looks how much a cover has covered; `move` looks for "
        "motions between regions; `motion` certifies a motion; `map` chooses which cells of a map to prove, `piece` proves some of them."
    )
    iteration: int | None = Field(description="Iteration of the pairs; null where the work is no pairs.")
    pairs: list[int] = Field(description="Indices of the pairs that it certifies, ascending; those that are done already are left out.")
    since: datetime | None = Field(
        description="When the process took the work; null for work that was taken before a database of revision 0041."
    )
    until: datetime | None = Field(description="Without a sign of life until then, the work is given to another process.")


class JobWorkers(BaseModel):
    """Lists the processes that work for a job at this moment; those that certify pairs come first."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "workers": [
                        {
                            "job": "1f9b2a7c-5b0e-4b58-9c39-2f1d6a3c8e10",
                            "process": "solver-1.2f9a01c3:4711:8812734",
                            "work": "pairs",
                            "iteration": 3,
                            "pairs": [4, 7],
                            "since": "2026-11-23T11:59:48Z",
                            "until": "2026-11-23T12:00:30Z",
                        }
                    ]
                }
            ]
        }
    )

    workers: list[HeldWork] = Field(description="The processes, in no order.")


class Obstacle(BaseModel):
    """Says what a pair of bodies does to a region: it cut it, or it is not certified."""

    pair: int | None = Field(description="Index of the pair; null for an obstacle that no pair is known for, such as a seed that collides.")
    a: str | None = Field(description="Name of the first geometry; null where no pair is to blame.")
    b: str | None = Field(description="Name of the second geometry; null where no pair is to blame.")
    text: str = Field(description="What stands in the way, in a sentence. It says what is proved, and what floating point or samples say.")
    q: list[float] | None = Field(
        description="Joint positions at which the bodies touch, come too close, or could not be proved apart; null where none is known."
    )
    at: str | None = Field(description="The words of `text` that name `q`, in degrees and metres; null where the text does not name it.")
    faces: int | None = Field(
        description="Number of faces of the polytope that were added or moved in for this pair; null where that is not known."
    )
    lost: float | None = Field(
        description="Share of the polytope, by q-volume as far as samples say, that these faces cut off; null where that is not known."
    )


class Obstacles(BaseModel):
    """Lists what holds a job's region back, worst first."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "obstacles": [
                        {
                            "pair": 2,
                            "a": "arm/link2/box",
                            "b": "world/post",
                            "text": "arm/link2/box and world/post touch at q = (23.5, -11.5) deg, as floating point says. 2 faces were "
                            "added or moved in for this pair, and cut off 12 % of the polytope, as samples say.",
                            "q": [0.41, -0.2],
                            "at": "q = (23.5, -11.5) deg",
                            "faces": 2,
                            "lost": 0.12,
                        }
                    ],
                    "total": 1,
                }
            ]
        }
    )

    obstacles: list[Obstacle] = Field(description="The obstacles, the worst first.")
    total: int = Field(description="Number of obstacles, of which the answer has the worst.")
