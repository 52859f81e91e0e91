"""Geoms and meshes of MJCF are checked here."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import PurePosixPath

from certifier.errors import close_matches
from certifier.scene.formats.mjcf_names import ORIENTATIONS
from certifier.scene.formats.mjcf_tree import MEND, Node, refuse
from certifier.scene.formats.ranges import RANGE_HINT, SIZE

_SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
_LONG = {"capsule", "cylinder"}
_KINDS = (*_SIZES, "plane", "mesh")
_BITS = re.compile(r"[+-]?[0-9]{1,9}")
_SHORT = 1e-6
"""MuJoCo takes the ends of a fromto for the same point if they are nearer to each other than something less than this, in metres."""


@dataclass(frozen=True)
class Geom:
    """A geom, with its own attributes and those of its class."""

    node: Node
    attributes: dict[str, str]

    @property
    def kind(self) -> str:
        return self.attributes.get("type", "sphere")

    @property
    def collides(self) -> bool:
        """Says whether it may collide: whether one of its bits is not 0. If all are 0, it is only drawn."""
        return any(int(self.attributes.get(key, "1")) for key in ("contype", "conaffinity"))

    def check(self) -> None:
        """Checks the geom, except for its mesh.

        Raises:
            SceneError: ``scene_model`` with file and line.
        """
        attributes, node = self.attributes, self.node
        for key in ("contype", "conaffinity"):
            if not _BITS.fullmatch(attributes.get(key, "1").strip()):
                refuse(node, f"{key} of <geom> is {attributes[key][:80]!a} instead of a whole number of at most 9 digits")
        if self.kind not in _KINDS:
            hint = close_matches(self.kind, list(_KINDS)) or f"types that are read: {', '.join(_KINDS)}"
            refuse(node, f"a geom of the type {self.kind[:80]!a} is not read", hint=hint)
        if "fromto" in attributes:
            self._check_ends()
        if self.kind != "mesh" and "mesh" in attributes:
            refuse(node, f"a {self.kind} with a mesh is not read: MuJoCo fits it to the mesh", hint="remove mesh, and write the size")
        if self.kind == "plane":
            self._check_plane()
        elif self.kind in _SIZES:
            self._check_size(1 if "fromto" in attributes else _SIZES[self.kind])

    def _check_ends(self) -> None:
        if self.kind not in _LONG:
            refuse(self.node, f"fromto of a {self.kind} is not read", hint="write pos, an orientation and size")
        if placed := [key for key in ("pos", *ORIENTATIONS) if key in self.attributes]:
            refuse(self.node, f"<geom> has fromto and {placed[0]}, and MuJoCo accepts only one of them")
        ends = [float(word) for word in self.attributes["fromto"].split()]
        if not math.dist(ends[:3], ends[3:]) >= _SHORT:
            refuse(self.node, f"the ends of fromto must be at least {_SHORT:g} m from each other")

    def _check_size(self, count: int) -> None:
        size = [float(word) for word in self.attributes.get("size", "").split()]
        if len(size) < count:
            refuse(self.node, f"size of a {self.kind} has too few numbers: {len(size)} instead of {count}")
        if min(size[:count]) <= 0:
            refuse(self.node, f"size of a {self.kind} must be positive, and {min(size[:count]):g} is in it")
        if (wrong := SIZE.outside(size[:count])) is not None:
            refuse(self.node, f"size of a {self.kind} has {wrong:g} in it, and must be {SIZE}", hint=RANGE_HINT)

    def _check_plane(self) -> None:
        size = [float(word) for word in self.attributes.get("size", "").split()]
        if len(size) < 3 or min(size) < 0 or size[2] == 0:
            refuse(self.node, "a plane needs 3 numbers in size: two that are not negative, and one that is positive")
        if any(body.under("joint", "freejoint") for body in self.node.around()):
            refuse(self.node, "a plane is only read on a body that does not move", hint="use a box")


class Meshes:
    """Knows the meshes of a model by their names.

    Raises:
        SceneError: ``scene_model`` with file and line, for two meshes of one name.
    """

    def __init__(self, nodes: list[Node]) -> None:
        self._nodes: dict[str, Node] = {}
        for node in nodes:
            name = node.attributes.get("name", PurePosixPath(node.attributes.get("file", "")).stem)
            if name in self._nodes:
                refuse(node, f"a second mesh is called {name[:80]!a}")
            self._nodes[name] = node

    def of(self, geom: Geom) -> Node:
        """Returns the mesh of a geom.

        Raises:
            SceneError: ``scene_model`` with file and line, where there is none, or none with a file.
        """
        name = geom.attributes.get("mesh", "")
        node = self._nodes.get(name)
        if node is None:
            refuse(geom.node, f"the mesh {name[:80]!a} of <geom> is not known", hint=close_matches(name, list(self._nodes)) or MEND)
        if "file" not in node.attributes:
            refuse(node, "the <mesh> has no file, and Drake reads meshes only from files")
        return node
