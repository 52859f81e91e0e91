"""URDF, SDFormat and MJCF files are read as written here. What Drake would read otherwise than it is written is refused.

Drake takes ``1,5`` or ``0x10`` for 1 and 0 in some places and refuses them in others. It makes 1 of a size that is missing or negative,
keeps the first of two elements, and leaves out elements that it does not know (docs/scenes.md has the table).

This module looks only at what joints and collision geometries consist of, and at what a file includes. Drake decides whether that makes
a robot.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, NoReturn
from xml.parsers import expat

from certifier.errors import SceneError
from certifier.scene.xml import parse_xml

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_COLLISION = "collision"
_SHAPES = frozenset(["box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "mesh", "drake:capsule", "drake:ellipsoid"])


@dataclass(frozen=True)
class Reference:
    """A reference is the name of another file, as written, and the line where it stands."""

    file: str
    line: int


@dataclass
class _Element:
    name: str
    line: int
    attributes: dict[str, str]
    around: frozenset[str]
    """The names of the elements that this one is in."""
    children: set[str] = field(default_factory=set)
    text: str = ""
    interrupted: bool = False
    """Whether something else interrupts the element's text. Drake reads the text only up to there."""


class ModelFile:
    """Reads and checks one model file; each format has a subclass.

    Attributes:
        includes: model files that this one includes.
        meshes: files of collision geometry.
        mesh_directories: directories of the meshes, relative to the model.

    Raises:
        SceneError: ``scene_model`` with the file and the line, when the file is not accepted.
    """

    ONCE: ClassVar[frozenset[str]]
    """These elements may stand only once in their parent, because Drake reads the first one."""
    UNREAD: ClassVar[frozenset[str]] = frozenset()
    """Drake does not look into these elements."""

    def __init__(self, path: Path, name: str) -> None:
        self.name = name
        self.includes: list[Reference] = []
        self.meshes: list[Reference] = []
        self.mesh_directories = ["."]
        self._open: list[_Element] = []
        parse_xml(path, name, "scene_model", self._install)

    def _check(self, element: _Element, parent: str) -> None:
        raise NotImplementedError

    def _refuse(self, element: _Element, what: str) -> NoReturn:
        raise SceneError("scene_model", f"{self.name}:{element.line}: {what}", field="directives", hint="mend the model there")

    def _check_order(self, element: _Element, lower: float, upper: float) -> None:
        if lower > upper:
            self._refuse(element, f"the limits of a joint are {lower:g} and {upper:g}; the lower one must not be greater")

    def _numbers(self, element: _Element, what: str, text: str, counts: tuple[int, ...]) -> list[float]:
        words = text.split()
        numbers = [float(word) for word in words if _NUMBER.fullmatch(word)]
        if not text.isascii() or len(numbers) < len(words) or len(numbers) not in counts or not all(map(math.isfinite, numbers)):
            wanted = "1 finite decimal number" if counts == (1,) else f"{' or '.join(map(str, counts))} finite decimal numbers"
            self._refuse(element, f"{what} is {text[:80]!a} instead of {wanted}")
        return numbers

    def _check_geometry(self, element: _Element) -> None:
        if element.name == "geometry" and _COLLISION in element.around and len(element.children & _SHAPES) > 1:
            self._refuse(element, "<geometry> has more than one shape, and Drake would read one")

    def _install(self, parser: expat.XMLParserType) -> None:
        def start(name: str, attributes: dict[str, str]) -> None:
            element = _Element(name, parser.CurrentLineNumber, attributes, frozenset())
            if self._open:
                parent = self._open[-1]
                element.around = parent.around | {parent.name}
                if name in parent.children and name in self.ONCE and not element.around & self.UNREAD:
                    self._refuse(element, f"<{parent.name}> has a second <{name}>, and Drake would read the first")
                parent.children.add(name)
                parent.interrupted = True
            self._open.append(element)

        def end(_: str) -> None:
            element = self._open.pop()
            if not element.around & self.UNREAD:
                self._check(element, self._open[-1].name if self._open else "")

        def text(data: str) -> None:
            self._open[-1].text += data

        def interrupt(*_: object) -> None:
            if self._open:
                self._open[-1].interrupted = True

        parser.buffer_text = True
        parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, text
        parser.CommentHandler = parser.ProcessingInstructionHandler = parser.StartCdataSectionHandler = interrupt


class Urdf(ModelFile):
    """Reads URDF, where numbers are attributes."""

    ONCE = _SHAPES | {"origin", "axis", "limit", "geometry", "parent", "child"}
    UNREAD = frozenset(["gazebo"])
    _COUNTS: ClassVar[dict[str, tuple[int, ...]]] = {
        **dict.fromkeys(("xyz", "rpy", "size"), (3,)),
        **dict.fromkeys(("radius", "length", "lower", "upper", "a", "b", "c", "multiplier", "offset"), (1,)),
        "scale": (1, 3),
    }

    def _check(self, element: _Element, parent: str) -> None:
        for key, counts in self._COUNTS.items():
            if key in element.attributes:
                self._numbers(element, f"{key} of <{element.name}>", element.attributes[key], counts)
        if element.name == "limit" and parent == "joint":
            limits = (float(element.attributes.get(key, limit)) for key, limit in (("lower", -math.inf), ("upper", math.inf)))
            self._check_order(element, *limits)
        self._check_geometry(element)
        if _COLLISION in element.around and element.name == "mesh" and "filename" in element.attributes:
            self.meshes.append(Reference(element.attributes["filename"], element.line))


class Sdf(ModelFile):
    """Reads SDFormat, where numbers are the text of elements."""

    _DIMENSIONS: ClassVar[dict[str, dict[str, int]]] = {
        "box": {"size": 3},
        "sphere": {"radius": 1},
        **{name: {"radius": 1, "length": 1} for name in ("cylinder", "capsule", "drake:capsule")},
        "ellipsoid": {"radii": 3},
        "drake:ellipsoid": {"a": 1, "b": 1, "c": 1},
    }
    _COUNTS: ClassVar[dict[tuple[str, str], tuple[int, ...]]] = {
        ("axis", "xyz"): (3,),
        ("limit", "lower"): (1,),
        ("limit", "upper"): (1,),
        ("plane", "normal"): (3,),
        ("mesh", "scale"): (3,),
        ("mimic", "multiplier"): (1,),
        ("mimic", "offset"): (1,),
        ("mimic", "reference"): (1,),
    }
    ONCE = _SHAPES.union(
        ["pose", "geometry", "axis", "limit", "uri", "parent", "child"],
        [name for _, name in _COUNTS],
        [name for shape in _DIMENSIONS.values() for name in shape],
    )
    UNREAD = frozenset(["plugin", "sensor", "gui"])

    def __init__(self, path: Path, name: str) -> None:
        self._limits: dict[str, float] = {}
        super().__init__(path, name)

    def _check(self, element: _Element, parent: str) -> None:
        dimensions = self._DIMENSIONS.get(parent, {}) if _COLLISION in element.around else {}
        if element.name in dimensions:
            if min(self._text(element, (dimensions[element.name],))) <= 0:
                self._refuse(element, f"<{element.name}> must be positive, and Drake would read another number")
        elif element.name == "pose":
            self._text(element, (0, 6, 7))
        elif (counts := self._COUNTS.get((parent, element.name))) is not None:
            numbers = self._text(element, counts)
            if parent == "limit":
                self._limits[element.name] = numbers[0]
        elif element.name == "limit":
            self._check_order(element, self._limits.pop("lower", -math.inf), self._limits.pop("upper", math.inf))
        elif element.name == "uri" and parent == "include":
            self.includes.append(Reference(self._whole(element), element.line))
        elif element.name == "uri" and parent == "mesh" and _COLLISION in element.around:
            self.meshes.append(Reference(self._whole(element), element.line))
        elif element.name in self._DIMENSIONS and parent == "geometry" and _COLLISION in element.around:
            for missing in self._DIMENSIONS[element.name].keys() - element.children:
                self._refuse(element, f"<{element.name}> has no <{missing}>, and Drake would make one up")
        elif element.name == "drake:mimic":
            for key in ("multiplier", "offset"):
                if key in element.attributes:
                    self._numbers(element, f"{key} of <drake:mimic>", element.attributes[key], (1,))
        self._check_geometry(element)

    def _whole(self, element: _Element) -> str:
        if element.interrupted:
            self._refuse(element, f"<{element.name}> holds more than text, and Drake would read a part of it")
        return element.text.strip()

    def _text(self, element: _Element, counts: tuple[int, ...]) -> list[float]:
        return self._numbers(element, f"<{element.name}>", self._whole(element), counts)


class Mjcf(ModelFile):
    """Reads MJCF, where numbers are attributes, which defaults have as well."""

    ONCE = frozenset()
    _NUMBERED = frozenset(["body", "geom", "joint", "mesh"])
    _COUNTS: ClassVar[dict[str, tuple[int, ...]]] = {
        **dict.fromkeys(("pos", "zaxis", "euler", "axis", "scale"), (3,)),
        **dict.fromkeys(("quat", "axisangle"), (4,)),
        **dict.fromkeys(("xyaxes", "fromto"), (6,)),
        "range": (2,),
        "size": (1, 2, 3),
        "ref": (1,),
    }
    _IN_BODIES = frozenset(["body", "geom", "joint", "freejoint", "inertial", "site", "camera", "light", "plugin", "include"])
    """Drake reads these elements in a body, or they have no collision geometry in them."""
    _MOVED = frozenset(["refpos", "refquat", "fitscale", "mocap"])
    """These attributes change the robot, but Drake does not read them."""

    def _check(self, element: _Element, parent: str) -> None:
        if parent in ("body", "worldbody") and element.name not in self._IN_BODIES:
            self._refuse(element, f"<{element.name}> in a body is not read by Drake")
        if element.name in self._NUMBERED:
            for key, counts in self._COUNTS.items():
                if key in element.attributes:
                    numbers = self._numbers(element, f"{key} of <{element.name}>", element.attributes[key], counts)
                    if (element.name, key) == ("joint", "range"):
                        self._check_order(element, *numbers)
            for key in self._MOVED & element.attributes.keys():
                self._refuse(element, f"{key} of <{element.name}> is not read by Drake")
            if float(element.attributes.get("ref", 0)) != 0:
                self._refuse(element, f"ref of <{element.name}> is not read by Drake: measure the joint's positions from 0")
        if element.name == "mesh" and "file" in element.attributes:
            self.meshes.append(Reference(element.attributes["file"], element.line))
        if element.name == "include" and "file" in element.attributes:
            self.includes.append(Reference(element.attributes["file"], element.line))
        self.mesh_directories += [element.attributes[key] for key in ("meshdir", "assetdir") if key in element.attributes]
