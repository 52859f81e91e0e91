"""This module makes typed answers of the service's documents: each field of a dataclass is read as its type says."""

from __future__ import annotations

import types
from collections.abc import Collection
from dataclasses import MISSING, fields, is_dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from ciris.space import frozen

T = TypeVar("T")


def read(kind: type[T], document: Any) -> T:
    """Returns the document as a dataclass. Fields that it lacks have their defaults; others of its entries are left out."""
    return kind(**values(kind, document))


def values(kind: type, document: Any, known: Collection[str] = ()) -> dict[str, Any]:
    """Returns the fields of a dataclass from a document, without those that are known already."""
    hints, found = get_type_hints(kind), {}
    for field in fields(kind):
        if field.name not in known and (field.name in document or field.default is MISSING):
            found[field.name] = _value(hints[field.name], document[field.name])
    return found


def _value(kind: Any, value: Any) -> Any:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return None if value is None else _value(next(one for one in arguments if one is not type(None)), value)
    if origin is tuple:
        return tuple(_value(arguments[0], item) for item in value)
    if origin is np.ndarray:
        return frozen(value)
    if kind is datetime:
        return datetime.fromisoformat(value)
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return kind(value)
    return read(kind, value) if is_dataclass(kind) and isinstance(kind, type) else value
