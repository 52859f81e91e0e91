"""The names that a scene file may call bodies and geometries by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from certifier.errors import SceneError, close_matches

if TYPE_CHECKING:  # The command reads scene files without numpy, which the model needs.
    from certifier.model import Geometry

PART = "part"
"""The kind of shape of a part of a mesh. Its ``of`` is the name of the mesh geometry."""


def names_of(geometry: Geometry) -> list[str]:
    """Returns the names that mean a geometry: its own, that of the mesh that it is a part of, and that of its body."""
    mesh = [geometry.shape["of"]] if geometry.shape["kind"] == PART else []
    return [geometry.name, *mesh, geometry.body]


def check_known(name: str, known: Sequence[str], where: str) -> None:
    """Refuses a name that is neither a body nor a geometry.

    Raises:
        SceneError: ``unknown_name``.
    """
    if name not in known:
        message, hint = f"{name!r} is neither a body nor a geometry of the scene", "`ciris scene show` and `scene check` list them"
        raise SceneError("unknown_name", message, field=where, hint=close_matches(name, list(dict.fromkeys(known))) or hint)
