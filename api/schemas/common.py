"""This module holds what requests and responses have in common."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import Path, Query
from pydantic import BaseModel, Field

MAX_INT = 2**31 - 1
"""The largest integer that the databases can store in a column."""

Document = dict[str, Any]

Cursor = Annotated[
    str | None, Query(max_length=200, description="The value of `next` from the page before; leave it out for the first page.")
]
NameCursor = Annotated[
    str | None,
    Query(
        max_length=64, description="List only what comes after this name: the value of `next` from the page before.", examples=["default"]
    ),
]
Listed = Annotated[int, Query(ge=1, le=1000, description="Return at most this many.")]
SceneGiven = Annotated[
    str, Path(description="A scene: its id, its first characters, a name of it, or `NAME@staged`.", examples=["planar-2dof"])
]
JobGiven = Annotated[str, Path(description="The id of a job, or its first characters, four at least.", examples=["1f9b2a7c"])]
RegionGiven = Annotated[str, Path(description="The id of a region, or its first characters, four at least.", examples=["5d0c1e42"])]
WorkerGiven = Annotated[str, Path(description="The id of a worker, or its first characters, four at least.", examples=["7c3e91d0"])]
PairGiven = Annotated[int, Path(description="Index of a pair among the scene's, from 0.", examples=[0])]
OfScene = Annotated[
    str | None,
    Query(min_length=1, max_length=255, description="List only what belongs to this scene: its id, a name of it, or `NAME@staged`."),
]
OfIteration = Annotated[int | None, Query(ge=0, le=MAX_INT, description="The number of an iteration, from 0.")]
WithDependents = Annotated[
    Literal["keep", "delete"],
    Query(description="`delete` deletes what depends on it, too; otherwise the request is refused where something does."),
]


class Page(BaseModel):
    """All lists that come in pages derive from this model."""

    next: str | None = Field(description="Pass this as `after` to get the next page; null on the last page.")
