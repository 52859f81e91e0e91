"""Data that a job keeps between two decisions becomes a JSON-able document, and is made from the document again (by cattrs).

Dataclasses travel whole. So a new field of one is written once, where the dataclass is.
"""

from __future__ import annotations

from typing import Any, TypeVar, get_origin

import cattrs
import numpy as np

from certifier.errors import CirisError

Value = TypeVar("Value")
_converter = cattrs.Converter(forbid_extra_keys=True)


def document(value: Any) -> Any:
    """Returns a value of a dataclass, or of lists and mappings of them, as JSON-able data."""
    return _converter.unstructure(value)


def value(cls: type[Value], stored: Any) -> Value:
    """Does the inverse of :func:`document`, for a value of this class.

    Raises:
        CirisError: ``other_version`` when another version of this program stored the document.
    """
    try:
        return _converter.structure(stored, cls)
    except cattrs.BaseValidationError as error:
        message = "this job was begun by another version of ciris and cannot go on"
        raise CirisError("other_version", message, field="job", hint="retry it") from error


def _is_array(kind: Any) -> bool:
    return kind is np.ndarray or get_origin(kind) is np.ndarray


def _array_document(array: np.ndarray) -> Any:
    """Returns nested lists. Those of an empty array do not tell its shape, so it stands beside them."""
    return array.tolist() if array.size or array.ndim == 1 else {"shape": list(array.shape)}


def _array(stored: Any, _: Any) -> np.ndarray:
    return np.zeros(stored["shape"]) if isinstance(stored, dict) else np.array(stored, dtype=float)


_converter.register_unstructure_hook_func(_is_array, _array_document)
_converter.register_structure_hook_func(_is_array, _array)
