"""The models of options in requests are made from the tables in which the options are written (certifier.options)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, create_model

from api.schemas.common import Labels, Real, Request, Rows, Vector, Whole
from certifier.options import Option, Takes, table


def model_of(cls: type) -> type[Request]:
    """Returns the model of a request's options, each with its bounds, its default and its text.

    Args:
        cls: the dataclass that has the options.
    """
    fields: dict[str, Any] = {one.name: (_annotated(one), [] if one.default == () else one.default) for one in table(cls)}
    model: type[Request] = create_model(cls.__name__, __base__=Request, __doc__=(cls.__doc__ or "").split("\n")[0], **fields)
    return model


def _annotated(one: Option) -> Any:
    values = _type(one)
    bounds: dict[str, Any] = {}
    if one.takes in (Takes.WHOLE, Takes.REAL):
        bounds = {"ge": one.least, "gt": one.above, "le": one.greatest, "lt": one.below}
    elif one.most is not None:
        bounds = {"max_length": one.most}
    return Annotated[values | None if one.optional else values, Field(description=one.described, **bounds)]


def _type(one: Option) -> Any:
    match one.takes:
        case Takes.CHOICE:
            return Literal[one.choices]
        case Takes.GROUP:
            assert one.cls is not None
            return model_of(one.cls)
        case _:
            lists = {Takes.POINT: Vector, Takes.POINTS: Rows, Takes.PATHS: list[Annotated[list[Vector], Field(min_length=2)]]}
            return {Takes.WHOLE: Whole, Takes.REAL: Real, Takes.FLAG: bool, Takes.LABELS: Labels, **lists}[one.takes]
