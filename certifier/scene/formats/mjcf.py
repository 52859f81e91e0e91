"""MJCF is read as MuJoCo reads it here. What Drake would read otherwise is refused."""

from __future__ import annotations

import re
from pathlib import Path

from certifier.scene.formats.mjcf_bodies import check_body, check_joint, check_numbers
from certifier.scene.formats.mjcf_contacts import check_contacts
from certifier.scene.formats.mjcf_defaults import Defaults
from certifier.scene.formats.mjcf_geoms import Geom, Meshes
from certifier.scene.formats.mjcf_names import check_names
from certifier.scene.formats.mjcf_tree import Node, read_tree, refuse
from certifier.scene.formats.model_file import FileReference, MeshReference, ModelFile, Reference
from certifier.scene.formats.places import value_at

_VALUES = {
    "angle": "degree|radian",
    "eulerseq": "[xyzXYZ]{3}",
    "autolimits": "true|false",
    "coordinate": "local",
    "strippath": "false",
    "alignfree": "false",
}
"""What attributes of <compiler> may be. Drake does not read other values of the last three."""


class Mjcf(ModelFile):
    """Reads an MJCF model with the files that it includes. Its ``collisions`` are the geoms that may collide, by name or else by type.

    Attributes:
        parts: the files that are part of it, each where another one includes it.
    """

    parts: list[tuple[FileReference, Path]]

    def _read(self) -> None:
        tree = read_tree(self._path, self.name, self._data)
        root, self.sources = tree.root, tree.sources
        self.parts = [(self._reference(node), path) for node, path in tree.includes]
        check_names(root)
        autolimits = self._compile(root.under("compiler"))
        defaults = Defaults(root)
        nodes = [node for part in root.under("default", "asset", "worldbody") for node in _read_inside(part)]
        for node in nodes:
            check_numbers(node)
        placed = [node for node in nodes if node.parent is not None and node.parent.name != "default"]
        bodies = _by_name([node for node in placed if node.name == "body"], {"world"})
        _by_name([node for node in placed if node.name in ("joint", "freejoint")], set())
        joints = {id(node): defaults.attributes(node) for node in placed if node.name == "joint"}
        for node in placed:
            if node.name == "joint":
                check_joint(node, joints[id(node)], autolimits)
            elif node.name == "body":
                check_body(node, [joints[id(joint)] for joint in node.under("joint")])
        geoms = [Geom(node, defaults.attributes(node)) for node in placed if node.name == "geom"]
        _by_name([geom.node for geom in geoms], set())
        _check_drakes_names(root)
        meshes = [node for node in placed if node.name == "mesh"]
        scales = {id(node): defaults.attributes(node).get("scale", "1 1 1") for node in meshes}
        self._check_geoms(geoms, meshes, Meshes(meshes), scales)
        check_contacts(root.under("contact"), geoms, bodies)
        _check_constraints(root)

    def _compile(self, compilers: list[Node]) -> bool:
        """Checks what <compiler> says, finds the directory of the meshes, and returns whether a range limits a joint by itself."""
        autolimits = True
        for node in compilers:
            for key, values in _VALUES.items():
                value = node.attributes.get(key)
                if value is not None and not re.fullmatch(values, value):
                    refuse(node, f"{key} of <compiler> is {value[:80]!a}, and must be {values.replace('|', ' or ')}")
            autolimits = node.attributes.get("autolimits", "true" if autolimits else "false") == "true"
            for key in ("assetdir", "meshdir"):
                if key in node.attributes:
                    self.mesh_directories = [node.attributes[key] or "."]
        return autolimits

    def _check_geoms(self, geoms: list[Geom], every: list[Node], meshes: Meshes, scales: dict[int, str]) -> None:
        solid: list[Node] = []
        for geom in geoms:
            geom.check()
            mesh = meshes.of(geom) if geom.kind == "mesh" else None
            if geom.collides:
                self.collisions.append(Reference(geom.node.attributes.get("name", geom.kind), geom.node.line))
                if mesh is not None and not any(mesh is other for other in solid):
                    solid.append(mesh)
        for mesh in solid:
            x, y, z = map(float, scales[id(mesh)].split())
            self.meshes.append(MeshReference(**vars(self._reference(mesh)), scale=(x, y, z)))
        drawn = [mesh for mesh in every if "file" in mesh.attributes and not any(mesh is other for other in solid)]
        self.drawn = [self._reference(mesh) for mesh in drawn]

    def _reference(self, node: Node) -> FileReference:
        place = value_at(self.sources[node.source], node.start, "file")
        return FileReference(node.attributes["file"], node.line, node.source, place)


def _read_inside(part: Node) -> list[Node]:
    """Returns the elements in a part that say where bodies, joints and geoms are; nobody looks into others."""
    found, waiting = [], [part]
    for node in waiting:
        inside = node.under("body", "joint", "freejoint", "geom", "mesh", "default")
        found += [child for child in inside if child.name != "default"]
        waiting += inside
    return found


def _by_name(nodes: list[Node], taken: set[str]) -> dict[str, Node]:
    """Returns the elements that have names by them.

    Raises:
        SceneError: ``scene_model`` with file and line, for an empty name, one of ``taken``, and one that another element has.
    """
    found: dict[str, Node] = {}
    for node in nodes:
        name = node.attributes.get("name")
        if name is not None:
            if not name or name in found or name in taken:
                refuse(node, f"the name {name[:80]!a} of <{node.name}> is empty or taken", hint="give it a name of its own")
            found[name] = node
    return found


def _check_drakes_names(root: Node) -> None:
    """Checks that the names that Drake makes for geoms without one, geom0 and so on, are not those of other geoms of the same body.

    Drake counts anew in every <worldbody>.
    """
    world: set[str] = set()
    for body in [part for top in root.under("worldbody") for part in (top, *top.inside()) if part.name in ("worldbody", "body")]:
        names = world if body.name == "worldbody" else set()
        for k, geom in enumerate(body.under("geom")):
            name = geom.attributes.get("name", f"geom{k}")
            if name in names:
                refuse(geom, f"{name[:80]!a} is what Drake calls another geom of the body as well, which has no name", hint="name both")
            names.add(name)


def _check_constraints(root: Node) -> None:
    """Checks that no constraint couples joints beyond the tree of bodies, because Drake reads none or another one."""
    for node in (child for part in root.under("equality") for child in part.children):
        if node.attributes.get("active", "true") != "false":
            hint = "remove it, or set active to false; a region then holds for joints that move freely, and so for coupled ones"
            refuse(node, f"<{node.name}> in <equality> is refused: only joints that move freely are read", hint=hint)
    tendons = [node for part in root.under("default", "tendon") for node in part.inside()]
    for node in tendons:
        if node.name in ("fixed", "spatial", "tendon") and "range" in node.attributes and node.attributes.get("limited") != "false":
            hint = "remove the range; a region then holds for joints that move freely, and so for limited ones"
            refuse(node, f"range of <{node.name}> is refused: limits of tendons are not read", hint=hint)
    for flag in (node for part in root.under("option") for node in part.under("flag")):
        if flag.attributes.get("filterparent", "enable") != "enable":
            refuse(flag, "filterparent of <flag> is refused: bodies that a joint connects make no pair here", hint="remove it")
