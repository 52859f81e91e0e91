"""This module holds what requests and responses have in common."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import Path, Query
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticKnownError

from api.schemas import patterns

MAX_INT = 2**31 - 1
"""The largest integer that the databases can store in a column."""


def _integer(value: object) -> object:
    """Refuses texts and truth for a whole number. Pydantic's own strictness would refuse 7.0 too, which is one in JSON."""
    if isinstance(value, bool | str):
        raise PydanticKnownError("int_type")
    return value


Whole = Annotated[int, BeforeValidator(_integer)]
"""A whole number. No text and no truth value stands for one."""
Real = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Vector = Annotated[list[Real], Field(min_length=1, max_length=64)]
LabelName = Annotated[str, Field(min_length=1, max_length=64, pattern=patterns.LABEL_NAME)]
LabelValue = Annotated[str, Field(max_length=200, pattern=patterns.ANY)]
Labels = Annotated[dict[LabelName, LabelValue], Field(max_length=20)]
SceneName = Annotated[str, Field(min_length=1, max_length=255, pattern=patterns.SOMETHING, description="The id or the name of a scene.")]
Document = dict[str, Any]

Rows = Annotated[list[Vector], Field(max_length=2000)]
Cursor = Annotated[
    str | None, Query(max_length=200, description="The value of `next` from the page before; leave it out for the first page.")
]
Listed = Annotated[int, Query(ge=1, le=1000, description="Return at most this many.")]
SceneGiven = Annotated[str, Path(description="A scene: its id, its first characters, or a name of it.", examples=["planar-2dof"])]
JobGiven = Annotated[str, Path(description="The id of a job, or its first characters, four at least.", examples=["1f9b2a7c"])]
RegionGiven = Annotated[str, Path(description="The id of a region, or its first characters, four at least.", examples=["5d0c1e42"])]
WorkerGiven = Annotated[str, Path(description="The id of a worker, or its first characters, four at least.", examples=["7c3e91d0"])]
PairGiven = Annotated[int, Path(description="Index of a pair among the scene's, from 0.", examples=[0])]
OfScene = Annotated[
    str | None, Query(min_length=1, max_length=255, description="List only what belongs to this scene: its id or a name of it.")
]
OfIteration = Annotated[int | None, Query(ge=0, le=MAX_INT, description="The number of an iteration, from 0.")]
WithDependents = Annotated[
    Literal["keep", "delete"],
    Query(description="`delete` deletes what depends on it, too; otherwise the request is refused where something does."),
]
Offsets = Annotated[list[Real], Field(max_length=2000)]


class Request(BaseModel):
    """All requests derive from this model: it refuses unknown fields and numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Page(BaseModel):
    """All lists that come in pages derive from this model."""

    next: str | None = Field(description="Pass this as `after` to get the next page; null on the last page.")
