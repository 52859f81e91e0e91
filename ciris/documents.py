"""What goes between the client and the service: JSON documents, and the bundles of scenes. All of it works without numpy, so the command,
which has no arrays, starts without it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from numbers import Real
from pathlib import Path
from typing import Any

from certifier.errors import CirisError

Document = dict[str, Any]
SHORT = 8
"""Number of characters of an id that are shown; the service knows a job or a region by them."""


def document(value: Any) -> Any:
    """Returns what json writes of a value: numpy's numbers and arrays as Python's."""
    if isinstance(value, Mapping):
        return {name: document(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [document(one) for one in value]
    return value.tolist() if hasattr(value, "tolist") else value


def given(**values: Any) -> Document:
    """Returns the values that are not None, by name."""
    return {name: value for name, value in values.items() if value is not None}


def named(name: object, field: str, what: str) -> str:
    """Returns the name or the id of something.

    Raises:
        CirisError: argument, for what is no text.
    """
    if isinstance(name, str):
        return name
    raise CirisError("argument", f"{type(name).__name__} is no {field}", field=field, hint=f"give {what}")


def patience(timeout: float) -> float:
    """Returns the seconds that a question may take.

    Raises:
        CirisError: argument, for what is no positive, finite number.
    """
    if isinstance(timeout, Real) and 0 < timeout < math.inf:
        return float(timeout)
    raise CirisError("argument", f"{timeout!r} is no timeout", field="timeout", hint="give seconds, a number above 0")


def bundle(path: str | Path) -> bytes:
    """Packs a scene file. What it takes, PyYAML and python-flint, is loaded here, so that asking needs neither.

    Raises:
        CirisError: argument, for what is no path.
        SceneError: as :func:`certifier.scene.bundle.pack_bundle`.
    """
    from certifier.scene.bundle import pack_bundle

    return pack_bundle(named(os.fspath(path) if isinstance(path, os.PathLike) else path, "path", "the path of a scene file"))


def asked_as(document: Document, given: str | None) -> str:
    """Returns what requests call a scene that the service described.

    Args:
        given: the name or id that was asked for; None for a scene that was added under its name.
    """
    if given is None or given == document["name"]:
        return f"{document['name']}@{document['id']}"
    return given if "@" in given else str(document["id"])
