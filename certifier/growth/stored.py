"""The state of a growth is stored as JSON and read again by the types of its fields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

Part = TypeVar("Part")


def document(part: Any, without: str = "") -> dict[str, Any]:
    """Returns a dataclass as JSON-able data.

    Args:
        without: the name of a field to leave out.
    """
    return {field.name: _plain(getattr(part, field.name)) for field in fields(part) if field.name != without}


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return document(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    return list(value) if isinstance(value, tuple) else value


def read(cls: type[Part], stored: Mapping[str, Any], **more: Any) -> Part:
    """Does the inverse of :func:`document`.

    Args:
        more: the field that was left out.

    Raises:
        KeyError: the document has other fields than the class.
    """
    hints = get_type_hints(cls)
    if {*stored, *more} != {*hints}:
        raise KeyError(*({*stored, *more} ^ {*hints}))
    return cls(**{name: _value(hints[name], value) for name, value in stored.items()}, **more)


def _value(hint: Any, value: Any) -> Any:
    if isinstance(hint, UnionType):
        return None if value is None else _value(get_args(hint)[0], value)
    if is_dataclass(hint):
        return read(hint, value)  # type: ignore[arg-type]
    origin = get_origin(hint)
    if origin is dict:
        return {int(pair): _value(get_args(hint)[1], one) for pair, one in value.items()}
    if origin is tuple:
        return tuple(value)
    return np.array(value) if origin is np.ndarray else value
