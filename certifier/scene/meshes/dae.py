"""A DAE (COLLADA) mesh is read strictly here: all geometry that its scene shows, where the scene's nodes place it, in metres.

Coordinates are taken as they stand, whatever <up_axis> says: RViz, MoveIt and Tesseract do so, too.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NoReturn
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array
from certifier.scene.meshes.mesh import EXPORT, Mesh, refuse
from certifier.scene.xml import parse_xml
from certifier.words import counted

_MAX_DEPTH = 50
_MAX_POINTS = 5_000_000
"""A mesh has at most this many points. Nodes that name others can multiply what a file has."""
_DIGITS = frozenset("0123456789+-.eE")
_TRANSFORMS = {"matrix": 16, "translate": 3, "rotate": 4, "scale": 3}
_NOT_SHOWN = frozenset(["asset", "extra", "instance_camera", "instance_light", "evaluate_scene"])
_AROUND = frozenset(["source", "vertices", "extra", "lines", "linestrips"])
"""What a <mesh> holds besides faces. Lines have no points but those of <vertices>."""
_POLYGONS = "export the mesh as plain polygons"
_FACES = frozenset(["triangles", "polylist", "polygons", "tristrips", "trifans"])


@dataclass(eq=False)
class _Element:
    name: str
    line: int
    attributes: dict[str, str]
    children: list[_Element] = field(default_factory=list)
    pieces: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        return "".join(self.pieces)

    def all(self, *names: str) -> list[_Element]:
        return [child for child in self.children if child.name in names]


def read_dae(data: bytes, name: str) -> Mesh:
    """Returns the mesh of a DAE file.

    Args:
        name: the file's name for people.

    Raises:
        SceneError: ``scene_model``, with the line, for what is no COLLADA, for a wrong count, a number that is not finite, a name that
            nothing has, faces whose points do not exist, a shape that is no polygon mesh, and a scene without faces.
    """
    return _Document(data, name).mesh()


class _Document:
    """Reads one document."""

    def __init__(self, data: bytes, name: str) -> None:
        self._name = name
        self._root = self._tree(data)
        self._ids: dict[str, list[_Element]] = {}
        for element in _inside(self._root):
            self._ids.setdefault(element.attributes.get("id", ""), []).append(element)
        self._meshes: dict[int, tuple[Array, NDArray[np.int64]]] = {}
        self._points = 0

    def mesh(self) -> Mesh:
        shown = [visual for scene in self._root.all("scene") for visual in scene.all("instance_visual_scene")]
        if len(shown) != 1:
            self._refuse(self._root, f"the file shows {len(shown)} scenes instead of 1")
        scene = self._named(shown[0], "url", "visual_scene")
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused below
            found = list(self._placed(scene, np.eye(4), ()))
        count = np.cumsum([0, *(len(points) for points, _ in found)])
        triangles = [numbers + first for (_, numbers), first in zip(found, count, strict=False)]
        if not any(map(len, triangles)):
            self._refuse(scene, "the scene has no faces")
        points = np.concatenate([points for points, _ in found]) * self._unit()
        if not np.isfinite(points).all():
            self._refuse(scene, "a transform of the scene makes a coordinate that is not finite")
        return Mesh(points, np.concatenate(triangles), self._up())

    def _tree(self, data: bytes) -> _Element:
        top = _Element("", 1, {})
        opened = [top]

        def install(parser: expat.XMLParserType) -> None:
            def start(name: str, attributes: dict[str, str]) -> None:
                element = _Element(name, parser.CurrentLineNumber, attributes)
                if len(opened) > _MAX_DEPTH:
                    self._refuse(element, f"elements may be nested at most {_MAX_DEPTH} levels deep")
                opened[-1].children.append(element)
                opened.append(element)

            def end(_: str) -> None:
                opened.pop()

            parser.buffer_text = True
            parser.StartElementHandler, parser.EndElementHandler = start, end
            parser.CharacterDataHandler = lambda text: opened[-1].pieces.append(text)

        parse_xml(data, self._name, "scene_model", install)
        root = top.children[0]
        if root.name != "COLLADA":
            self._refuse(root, f"the file begins with <{root.name[:80]}> instead of <COLLADA>", "export the mesh as DAE")
        return root

    def _unit(self) -> float:
        """Returns the length of the file's unit in metres."""
        for unit in (unit for asset in self._root.all("asset") for unit in asset.all("unit")):
            text = unit.attributes.get("meter", "1")
            metres = self._decimals(unit, text)
            if len(metres) != 1 or metres[0] <= 0:
                self._refuse(unit, f"meter of <unit> is {text[:80]!a} instead of a positive number")
            return float(metres[0])
        return 1.0

    def _up(self) -> str:
        said = [axis.text.strip()[:20] for asset in self._root.all("asset") for axis in asset.all("up_axis")]
        return said[0] if said and said[0] != "Z_UP" else ""

    def _placed(self, node: _Element, X: Array, around: tuple[_Element, ...]) -> Iterator[tuple[Array, NDArray[np.int64]]]:
        """Yields the points, in the file's unit, and the triangles of all geometry in a node, or in the scene itself.

        Args:
            X: (4, 4) transform from what is around the node.
            around: the nodes that it is in.
        """
        if node in around or len(around) > _MAX_DEPTH:
            self._refuse(node, "the node is in itself, or too deep", "remove the circle")
        for child in node.children:
            if child.name in _TRANSFORMS:
                X = X @ self._transform(child)
        for child in node.children:
            if child.name == "node":
                yield from self._placed(child, X, (*around, node))
            elif child.name == "instance_node":
                yield from self._placed(self._named(child, "url", "node"), X, (*around, node))
            elif child.name == "instance_geometry":
                points, triangles = self._geometry(self._named(child, "url", "geometry"))
                self._points += len(points)
                if self._points > _MAX_POINTS:
                    self._refuse(child, f"a mesh may have at most {_MAX_POINTS} points", "use a smaller mesh")
                yield points @ X[:3, :3].T + X[:3, 3], triangles
            elif child.name not in _NOT_SHOWN and child.name not in _TRANSFORMS:
                hint = "export the mesh without bones, as plain polygons" if child.name == "instance_controller" else _POLYGONS
                self._refuse(child, f"<{child.name[:80]}> in <{node.name}> is not read", hint)

    def _transform(self, element: _Element) -> Array:
        numbers = self._numbers(element)
        if len(numbers) != _TRANSFORMS[element.name]:
            self._refuse(element, f"<{element.name}> has {counted(len(numbers), 'number')} instead of {_TRANSFORMS[element.name]}")
        X = np.eye(4)
        match element.name:
            case "matrix":
                X = numbers.reshape(4, 4)
                if X[3].tolist() != [0, 0, 0, 1]:
                    self._refuse(element, "the last row of <matrix> must be 0 0 0 1")
            case "translate":
                X[:3, 3] = numbers
            case "scale":
                X[:3, :3] = np.diag(numbers)
            case "rotate":
                length = float(np.linalg.norm(numbers[:3]))
                if not length > 0:
                    self._refuse(element, "the axis of <rotate> has the length 0")
                x, y, z = numbers[:3] / length
                K, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), math.radians(numbers[3])
                X[:3, :3] += math.sin(angle) * K + (1 - math.cos(angle)) * (K @ K)
        return X

    def _geometry(self, geometry: _Element) -> tuple[Array, NDArray[np.int64]]:
        if id(geometry) not in self._meshes:
            shapes = [child for child in geometry.children if child.name not in ("asset", "extra")]
            if len(shapes) != 1 or shapes[0].name != "mesh":
                what = ", ".join(f"<{shape.name[:80]}>" for shape in shapes) or "nothing"
                self._refuse(geometry, f"the geometry is {what} instead of one <mesh>", _POLYGONS)
            self._meshes[id(geometry)] = self._polygons(shapes[0])
        return self._meshes[id(geometry)]

    def _polygons(self, mesh: _Element) -> tuple[Array, NDArray[np.int64]]:
        """Returns the points of a mesh, all of those that its file has, and its triangles."""
        vertices = mesh.all("vertices")
        if len(vertices) != 1:
            self._refuse(mesh, f"<mesh> has {len(vertices)} <vertices> instead of 1")
        positions = [entry for entry in vertices[0].all("input") if entry.attributes.get("semantic") == "POSITION"]
        if len(positions) != 1:
            self._refuse(vertices[0], f"<vertices> has {counted(len(positions), 'position')} instead of 1")
        points = self._source(self._named(positions[0], "source", "source"))
        triangles: list[tuple[int, int, int]] = []
        for part in mesh.children:
            if part.name in _FACES:
                for corners in self._faces(part, vertices[0], len(points)):
                    triangles += _cut(corners, part.name)
            elif part.name not in _AROUND:
                self._refuse(part, f"<{part.name[:80]}> in <mesh> is not read", _POLYGONS)
        return points, np.array(triangles, dtype=np.int64).reshape(-1, 3)

    def _source(self, source: _Element) -> Array:
        """Returns the points (k, 3) of a source of positions."""
        arrays = source.all("float_array")
        accessors = [accessor for common in source.all("technique_common") for accessor in common.all("accessor")]
        if len(arrays) != 1 or len(accessors) != 1:
            self._refuse(source, "<source> must have one <float_array> and one <accessor>")
        array, accessor = arrays[0], accessors[0]
        if self._named(accessor, "source", "float_array") is not array:
            self._refuse(accessor, "<accessor> names the numbers of another <source>")
        numbers = self._numbers(array)
        if (count := self._count(array, "count")) != len(numbers):
            self._refuse(array, f"<float_array> has {counted(len(numbers), 'number')}, and its count is {count}")
        axes = [param.attributes.get("name", "").upper() for param in accessor.all("param")]
        stride, offset = self._count(accessor, "stride", 1), self._count(accessor, "offset", 0)
        if axes != ["X", "Y", "Z"] or stride != 3:
            self._refuse(accessor, "the params of the positions must be X, Y and Z, with stride 3")
        if offset + 3 * self._count(accessor, "count") != len(numbers):
            self._refuse(accessor, f"<accessor> takes another count than the {len(numbers)} numbers that there are")
        return numbers[offset:].reshape(-1, 3)

    def _faces(self, part: _Element, vertices: _Element, points: int) -> Iterator[list[int]]:
        """Yields the numbers of the corners of each face, or of each strip or fan."""
        inputs = part.all("input")
        named = [entry for entry in inputs if entry.attributes.get("semantic") == "VERTEX"]
        count, lists = self._count(part, "count"), part.all("p")
        if part.all("ph"):
            self._refuse(part, "a polygon with holes is not read", _POLYGONS)
        if not count and not any(entry.text.strip() for entry in lists):
            return
        if len(named) != 1 or self._named(named[0], "source", "vertices") is not vertices:
            self._refuse(part, f"<{part.name}> must have one input VERTEX, which is the <vertices> of its mesh")
        at = self._count(named[0], "offset")
        width = 1 + max(self._count(entry, "offset") for entry in inputs)
        numbers = [self._integers(entry)[at::width] for entry in self._whole(lists, width)]
        if part.name in ("triangles", "polylist"):
            corners = numbers[0] if len(numbers) == 1 else []
            sizes = [3] * count if part.name == "triangles" else [n for entry in part.all("vcount") for n in self._integers(entry)]
            if len(sizes) != count or sum(sizes) != len(corners):
                faces, in_lists = counted(count, "face"), counted(len(numbers), "list")
                self._refuse(part, f"<{part.name}> counts {faces}, and has {counted(len(corners), 'corner')} in {in_lists}")
            following = iter(corners)
            numbers = [list(itertools.islice(following, size)) for size in sizes]
        elif len(numbers) != count:
            self._refuse(part, f"<{part.name}> has {counted(len(numbers), 'face')}, and its count is {count}")
        for face in numbers:
            if len(face) < 3 or min(face) < 0 or max(face) >= points:
                self._refuse(part, f"a face has the corners {', '.join(map(str, face[:8])) or 'none'}, and there are {points} points")
            yield face

    def _whole(self, lists: list[_Element], width: int) -> Iterator[_Element]:
        for entry in lists:
            if len(entry.text.split()) % width:
                self._refuse(entry, f"<p> has {counted(len(entry.text.split()), 'number')}, which is no multiple of {width}")
            yield entry

    def _named(self, element: _Element, key: str, kind: str) -> _Element:
        """Returns the element that an attribute names."""
        name = element.attributes.get(key, "")
        found = self._ids.get(name[1:], []) if name.startswith("#") and len(name) > 1 else []
        if len(found) != 1 or found[0].name != kind:
            self._refuse(element, f"{key} of <{element.name}> is {name[:80]!a}, which is the id of no <{kind}>, or of several elements")
        return found[0]

    def _count(self, element: _Element, key: str, default: int | None = None) -> int:
        text = element.attributes.get(key, "" if default is None else str(default)).strip()
        if not text.isdecimal() or not text.isascii() or len(text) > 9:
            self._refuse(element, f"{key} of <{element.name}> is {text[:80]!a} instead of a whole number")
        return int(text)

    def _integers(self, element: _Element) -> list[int]:
        words = element.text.split()
        if not all(word.isdecimal() and word.isascii() and len(word) < 10 for word in words):
            self._refuse(element, f"<{element.name}> has something else than whole numbers")
        return list(map(int, words))

    def _numbers(self, element: _Element) -> Array:
        if element.children:
            self._refuse(element, f"<{element.name}> must have numbers and nothing else")
        return self._decimals(element, element.text)

    def _decimals(self, element: _Element, text: str) -> Array:
        numbers = []
        for word in text.split():
            try:
                number = math.nan if set(word) - _DIGITS else float(word)
            except ValueError:
                number = math.nan
            if not math.isfinite(number):
                self._refuse(element, f"<{element.name}> has {word[:80]!a} in the place of a finite decimal number")
            numbers.append(number)
        return np.array(numbers)

    def _refuse(self, element: _Element, what: str, hint: str = EXPORT) -> NoReturn:
        refuse(f"{self._name}:{element.line}", what, hint)


def _inside(root: _Element) -> Iterator[_Element]:
    waiting = [root]
    while waiting:
        element = waiting.pop()
        yield element
        waiting += element.children


def _cut(corners: list[int], kind: str) -> list[tuple[int, int, int]]:
    """Returns the triangles of a face, a strip or a fan."""
    if kind == "tristrips":
        return list(zip(corners, corners[1:], corners[2:], strict=False))
    return [(corners[0], a, b) for a, b in itertools.pairwise(corners[1:])]
