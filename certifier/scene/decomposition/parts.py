"""The convex parts of the meshes that a scene file has decomposed are asked for here, in a child process (:mod:`.child`)."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from certifier.errors import CirisError, SceneError, close_matches
from certifier.isolation.child import run_in_child
from certifier.model import Array
from certifier.scene.file import SceneFile
from certifier.scene.known import PART
from certifier.scene.load import DECOMPOSE_S
from certifier.scene.names import Register
from certifier.scene.shapes import Body

MEMORY_BYTES = 2 * 2**30
_CHEAPER = "write a larger threshold, or use a mesh of fewer triangles"
_CHILD = "certifier.scene.decomposition.child:decompose"


class Decomposition:
    """Decomposes the meshes that a scene file names."""

    def __init__(self, scene_file: SceneFile, names: Register) -> None:
        """Takes the names that bodies and geometries have; the parts get theirs there."""
        self._thresholds, self._max_vertices, self._names = scene_file.decompose, scene_file.max_vertices, names
        self._done: set[str] = set()

    def wanted(self, name: str) -> bool:
        """Says whether the scene file has a geometry decomposed."""
        return name in self._thresholds

    def parts(self, name: str, said: dict[str, Any], points: Array, triangles: NDArray[np.int64]) -> dict[str, Body]:
        """Returns the parts of a mesh by their names.

        Args:
            said: what the models say of the mesh.
            points, triangles: (k, 3) metres, and (t, 3) numbers of points.

        Raises:
            SceneError: ``decompose``.
        """
        self._done.add(name)
        threshold = self._thresholds[name]
        mesh = {"points": points, "triangles": triangles, "threshold": threshold, "max_vertices": self._max_vertices}
        try:
            made = run_in_child(_CHILD, mesh, timeout_s=DECOMPOSE_S, memory_bytes=MEMORY_BYTES)["parts"]
        except CirisError as error:
            hint = error.hint if isinstance(error, SceneError) else _CHEAPER
            raise SceneError("decompose", f"{name}: {error.message}", field=f"decompose.{name}", hint=hint) from None
        shape = {**said, "kind": PART, "of": name, "threshold": threshold}
        substitution = f"mesh -> {len(made)} convex parts"
        bodies = [Body(part["vertices"], 0.0, shape, substitution, part["inflation"], part["beyond"]) for part in made]
        return {self._name(name, k): body for k, body in enumerate(bodies, 1)}

    def check(self, geometries: Collection[str]) -> None:
        """Checks that every mesh that the scene file names was decomposed.

        Args:
            geometries: the names of all geometries.

        Raises:
            SceneError: ``unknown_name`` or ``decompose``.
        """
        for name in self._thresholds:
            if name not in geometries:
                hint = close_matches(name, list(geometries)) or "`ciris scene check` lists the geometries"
                raise SceneError("unknown_name", f"the scene has no geometry {name!r}", field=f"decompose.{name}", hint=hint)
            if name not in self._done:
                message = f"{name} is no mesh, and only meshes are decomposed"
                raise SceneError("decompose", message, field=f"decompose.{name}", hint="leave it out")

    def _name(self, mesh: str, number: int) -> str:
        return self._names.give(self._names.unused(f"{mesh}/part{number}"), "part", f"part {number} of {mesh}")
