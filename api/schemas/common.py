"""What requests have in common."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query
from pydantic import BaseModel, ConfigDict, Field

from certifier.growth.options import WHOLE_NUMBERS

MAX_INT = 2**31 - 1
"""Of the databases' integers."""

Real = Annotated[float, Field(allow_inf_nan=False)]
Vector = Annotated[list[Real], Field(min_length=1, max_length=64)]
RandomSeed = Annotated[
    int, Field(ge=WHOLE_NUMBERS["random_seed"][0], le=WHOLE_NUMBERS["random_seed"][1], description="Seeds every random choice.")
]
SceneName = Annotated[str, Field(min_length=1, max_length=255, pattern=r"^[^\x00]+$", description="A scene's id, or its name.")]
Document = dict[str, Any]

Rows = Annotated[list[Vector], Field(max_length=2000)]
Cursor = Annotated[str | None, Query(max_length=200, description="`next` of the page before.")]
Offsets = Annotated[list[Real], Field(max_length=2000)]


class Request(BaseModel):
    """Base of everything that clients send."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Page(BaseModel):
    """Base of every list that comes in pages."""

    next: str | None = Field(description="Pass as `after` for the next page; null on the last.")
