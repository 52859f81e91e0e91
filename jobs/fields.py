"""What requests are made of: numbers and names with their checks, and the models of options (certifier.options)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
    WrapValidator,
    create_model,
    model_validator,
)
from pydantic_core import PydanticCustomError, PydanticKnownError

from certifier.options import Option, Takes, table
from jobs import patterns


def integer(value: object) -> object:
    """Refuses texts and truth for a whole number. Pydantic's own strictness would refuse 7.0 too, which is one in JSON.

    A large one such as 1e19 becomes an int here. Pydantic would say that it cannot parse it, and not how large it may be.
    """
    if isinstance(value, bool | str):
        raise PydanticKnownError("int_type")
    return int(value) if isinstance(value, float) and value.is_integer() else value


def whole(least: float | None, greatest: float | None) -> Any:
    """Returns the type of a whole number within bounds. No text and no truth value stands for one."""
    return Annotated[int, Field(ge=least, le=greatest), BeforeValidator(integer)]


Flag = Annotated[bool, Field(strict=True)]
Real = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Numbers = Annotated[list[Real], Field(fail_fast=True)]
"""Of a list, errors name the first item that is wrong: to name all of a long one takes seconds. So it is with all lists of requests."""
Vector = Annotated[Numbers, Field(min_length=1, max_length=64)]
MAX_NAMES = 2000
"""Names of configurations have at most this many characters together."""


class Named(str):
    """Stands in a request in the place of joint positions: names of configurations of the scene, with commas between them."""


class NamedOrRegion(Named):
    """Is the id of a region where it names no configuration."""


def _or(kind: type[Named]) -> WrapValidator:
    """Returns what takes a text for names. Other values go to the validator of lists, so errors name the same places as without names."""

    def taken(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        if not isinstance(value, str):
            return handler(value)
        if not 0 < len(value) <= MAX_NAMES:
            raise PydanticCustomError("name", "it must have 1 to 2000 characters")
        return kind(value)

    return WrapValidator(taken)


def _said(besides: str = "") -> WithJsonSchema:
    """Returns the schema for clients."""
    numbers = {"type": "array", "items": {"type": "number"}, "minItems": 1, "maxItems": 64}
    names = f"Names of configurations of the scene, with commas between them, as in `left_home,right_home`{besides}."
    return WithJsonSchema({"anyOf": [numbers, {"type": "string", "minLength": 1, "maxLength": MAX_NAMES, "description": names}]})


Positions = Annotated[Vector, _or(Named), _said()]
"""Joint positions, (n,) in radians or metres, or a :class:`Named` until api.named has looked it up."""
End = Annotated[Vector, _or(NamedOrRegion), _said("; or else the id of a region, or its first characters")]
"""The same, or the id of a region."""
LabelName = Annotated[str, Field(min_length=1, max_length=64, pattern=patterns.LABEL_NAME)]
LabelValue = Annotated[str, Field(max_length=200, pattern=patterns.ANY)]
Labels = Annotated[dict[LabelName, LabelValue], Field(max_length=20)]
SceneName = Annotated[
    str,
    Field(
        min_length=1,
        max_length=255,
        pattern=patterns.SOMETHING,
        description="The id or the name of a scene. `NAME@staged` is the scene that is staged as the next version of a name.",
    ),
]
Points = Annotated[list[Vector], Field(fail_fast=True)]
NamedPoints = Annotated[list[Positions], Field(fail_fast=True)]
Rows = Annotated[Points, Field(max_length=2000)]
Offsets = Annotated[Numbers, Field(max_length=2000)]
MOST_FIELDS = 30


class Request(BaseModel):
    """All requests derive from this model: it refuses unknown fields and numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _few_fields(cls, given: Any) -> Any:
        """Refuses what has far more fields than any request, at once: to say of each that there is none takes long."""
        if isinstance(given, dict) and len(given) > MOST_FIELDS:
            raise ValueError(f"there are more than {MOST_FIELDS} fields")
        return given


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
    bounds: dict[str, Any] = {} if one.most is None else {"max_length": one.most}
    return Annotated[values | None if one.optional else values, Field(description=one.described, **bounds)]


def _type(one: Option) -> Any:
    match one.takes:
        case Takes.CHOICE:
            return Literal[one.choices]
        case Takes.GROUP:
            assert one.cls is not None
            return model_of(one.cls)
        case _:
            row, points = (Positions, NamedPoints) if one.positions else (Vector, Points)
            path = Annotated[points, Field(min_length=2, max_length=one.most)]  # type: ignore[valid-type]
            rows = Annotated[points, Field(max_length=2000)]  # type: ignore[valid-type]
            paths = Annotated[list[path], Field(fail_fast=True)]
            lists = {Takes.POINT: row if one.most is None else Numbers, Takes.POINTS: rows, Takes.PATHS: paths}
            numbers = {Takes.WHOLE: whole(one.least, one.greatest), Takes.REAL: Annotated[Real, _bounds(one)]}
            return {**numbers, Takes.FLAG: Flag, Takes.LABELS: Labels, **lists}[one.takes]


def _bounds(one: Option) -> Any:
    return Field(ge=one.least, gt=one.above, le=one.greatest, lt=one.below)
