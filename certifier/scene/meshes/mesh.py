"""What every reader of mesh files gives, and how it refuses a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from certifier.errors import SceneError
from certifier.model import Array

EXPORT = "export the mesh again"


@dataclass(frozen=True)
class Mesh:
    """A mesh as its file has it.

    Attributes:
        points: (k, 3) every vertex, in the units of the file; those of DAE in metres. Those that no face uses are among them.
        triangles: (t, 3) the numbers of the points of every triangle, from 0. A face of more points is a fan of triangles.
        up: which axis the file says is up, if that is not z; it is not applied.
    """

    points: Array
    triangles: NDArray[np.int64]
    up: str = ""

    def obj(self) -> str:
        """Returns the text of an OBJ file with these points and triangles, in which every number is the same double."""
        points = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in self.points.tolist())
        return points + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in self.triangles.tolist())


def refuse(where: str, what: str, hint: str = EXPORT) -> NoReturn:
    """Refuses a mesh file.

    Args:
        where: the file's name for people, with the line if there is one.

    Raises:
        SceneError: ``scene_model``, always.
    """
    raise SceneError("scene_model", f"{where}: {what}", field="directives", hint=hint)
