"""What takes long for a mesh is computed once in a process: a scene that is drafted is read several times."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np

KEPT = 1000
"""A function keeps at most this many of its results. A scene has at most some hundred meshes."""
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def once(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Returns the function as one that gives, for arrays and numbers that it was given before, the result of that time.

    Its results are shared, so nobody may change them.
    """
    known: dict[bytes, Result] = {}

    @wraps(function)
    def kept(*arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
        key = _digest((*arguments, *named, *named.values()))
        if key not in known:
            if len(known) >= KEPT:
                known.pop(next(iter(known)))
            known[key] = function(*arguments, **named)
        return known[key]

    return kept


def _digest(arguments: tuple[Any, ...]) -> bytes:
    found = hashlib.sha256()
    for one in map(np.asarray, arguments):
        found.update(f"{one.dtype} {one.shape};".encode())
        found.update(np.ascontiguousarray(one).tobytes())
    return found.digest()
