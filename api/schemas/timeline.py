"""These models say what was done for a job over time: by which process, when, and how fast."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

MOST_BARS = 1500
"""A timeline shows up to this many pieces of work one by one."""
MOST_PROCESSES = 60
"""A timeline shows at most this many processes, those that worked longest."""
BINS = 120
"""Where there are more pieces, a timeline sums them up in this many parts of the time."""

_LEFT: dict[str, Any] = {"iteration": 3, "seconds": 8.1, "error": 1.2, "settled": 30, "left": 14}
_PROCESS = "solver-1.2f9a01c3:4711:8812734"


class Bar(BaseModel):
    """Describes a piece of work that a process did, or several of them in a part of the time."""

    process: int = Field(description="Number of the process in `processes`.")
    begin: float = Field(description="When it began, in seconds since the job's start.")
    end: float = Field(description="When it ended, in seconds since the job's start.")
    seconds: float = Field(description="How long the process worked in this time; less than from `begin` to `end` where it also waited.")
    work: str = Field(
        description="`pairs` for a pair or a part of one; else the kind of the step, or `lost` where the process lost its work."
    )
    state: str = Field(description="How it ended; of several pieces, how those ended that took longest.")
    pieces: int = Field(description="How many pieces it stands for.")
    iteration: int | None = Field(description="The iteration of a single pair; else null.")
    pair: int | None = Field(description="The index of a single pair; else null.")


class Rate(BaseModel):
    """Says how much was settled in a part of the time."""

    begin: float = Field(description="Where this part begins, in seconds since the job's start.")
    end: float = Field(description="Where it ends.")
    pieces: float = Field(description="Pairs, and parts of pairs, settled per second.")
    cells: float | None = Field(
        description="Cells looked at per second, for the map or for the pairs; null where the job does not tell how many there were.",
        examples=[4200.0],
    )


class TimeLeft(BaseModel):
    """Estimates how long an iteration will last.

    It counts the pieces that are not settled at the pace of those that are. A failure may end the iteration earlier, and what the job does
    after it is not counted.
    """

    model_config = ConfigDict(json_schema_extra={"examples": [_LEFT]})

    iteration: int = Field(description="The iteration.", examples=[_LEFT["iteration"]])
    seconds: float = Field(description="Seconds until all of its pieces are settled.", examples=[_LEFT["seconds"]])
    error: float = Field(
        description="Standard error of this, as far as the pieces that are left are like those that are settled.", examples=[_LEFT["error"]]
    )
    settled: int = Field(
        description="Number of its pieces that are settled; a piece is a pair or a part of one.", examples=[_LEFT["settled"]]
    )
    left: int = Field(description="Number of its pieces that are not.", examples=[_LEFT["left"]])


class Timeline(BaseModel):
    """Tells what processes have done for a job in a part of its time, and how fast."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "seconds": 12.4,
                    "begin": 0.0,
                    "end": 12.4,
                    "processes": [_PROCESS],
                    "others": 0,
                    "bars": [
                        {
                            "process": 0,
                            "begin": 1.5,
                            "end": 2.1,
                            "seconds": 0.6,
                            "work": "pairs",
                            "state": "certified",
                            "pieces": 1,
                            "iteration": 0,
                            "pair": 4,
                        }
                    ],
                    "together": False,
                    "rates": [{"begin": 0.0, "end": 12.4, "pieces": 0.0, "cells": 4200.0}],
                    "left": _LEFT,
                }
            ]
        }
    )

    seconds: float = Field(description="Seconds from the job's start to its end, or until now.")
    begin: float = Field(description="Where the time that it shows begins, in seconds since the job's start.")
    end: float = Field(description="Where it ends.")
    processes: list[str] = Field(
        description="The processes that worked in this time: host, process number and start. The name is empty for work of which an "
        "earlier version has not kept who did it."
    )
    others: int = Field(description=f"Number of further processes, which worked less and are left out; it shows at most {MOST_PROCESSES}.")
    bars: list[Bar] = Field(description="What they did, by process and time.")
    together: bool = Field(
        description=f"Whether the bars stand for several pieces each, in {BINS} parts of the time, because there are more than {MOST_BARS}."
    )
    rates: list[Rate] = Field(description="How fast the work went, in parts of the time; empty where no process reported a pair or a cell.")
    left: TimeLeft | None = Field(
        description="How long the iteration that runs will last; null where none runs, and before 20 of its pieces are settled.",
        examples=[_LEFT],
    )
