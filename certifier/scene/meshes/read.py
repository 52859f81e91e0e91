"""The suffix of a mesh file says which reader reads it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from certifier.errors import SceneError
from certifier.scene.meshes.dae import read_dae
from certifier.scene.meshes.mesh import Mesh
from certifier.scene.meshes.obj import read_obj
from certifier.scene.meshes.stl import read_stl

DRAKES = ".obj"
"""Drake makes hulls of this kind. Other kinds are written to it."""
_READERS: dict[str, Callable[[bytes, str], Mesh]] = {DRAKES: read_obj, ".stl": read_stl, ".dae": read_dae}
MESHES = tuple(_READERS)
"""The suffixes of the mesh files that are read, in lower case."""


def read_mesh(path: Path, name: str) -> Mesh:
    """Returns the mesh of a file.

    Args:
        path: its suffix is one of ``MESHES``, in any case.
        name: the file's name for people.

    Raises:
        SceneError: ``scene_model``, with the line if the format has lines, when the file is not accepted or cannot be read.
    """
    try:
        data = path.read_bytes()
    except OSError:
        message = f"{name} cannot be read"
        raise SceneError("scene_model", message, field="directives", hint="is it a file, and may you read it?") from None
    return _READERS[path.suffix.lower()](data, name)
