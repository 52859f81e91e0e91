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
from certifier.scene.formats.places import Place, element_at, text_at, value_at
from certifier.scene.formats.ranges import DIRECTION, RANGE_HINT, Range
from certifier.scene.xml import parse_xml

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
COLLISION = "collision"
SHAPES = frozenset(["box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "mesh", "drake:capsule", "drake:ellipsoid", "empty"])


def decimals(text: str, counts: tuple[int, ...]) -> list[float] | None:
    """Returns the numbers in a text, or None where it is anything but finite decimal numbers, as many as one of ``counts``."""
    words = text.split()
    numbers = [float(word) for word in words if _NUMBER.fullmatch(word)]
    plain = text.isascii() and len(numbers) == len(words) and len(numbers) in counts
    return numbers if plain and all(map(math.isfinite, numbers)) else None


def wanted(counts: tuple[int, ...]) -> str:
    """Returns what :func:`decimals` takes, for people."""
    return "1 finite decimal number" if counts == (1,) else f"{' or '.join(map(str, counts))} finite decimal numbers"


@dataclass(frozen=True)
class Reference:
    """A reference is the name of another file or of a geometry, as written, and the line where it stands."""

    file: str
    line: int


@dataclass(frozen=True)
class FileReference(Reference):
    """A file reference is a reference to a file; ``source`` is the file that has it, at a place."""

    source: Path
    place: Place


@dataclass(frozen=True)
class MeshReference(FileReference):
    """A mesh reference is one to a mesh file, and the scale of the mesh along x, y and z."""

    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass
class Element:
    name: str
    line: int
    attributes: dict[str, str]
    around: frozenset[str]
    """The names of the elements that this one is in."""
    children: set[str] = field(default_factory=set)
    names: set[tuple[str, str]] = field(default_factory=set)
    """The names that its children have: the child's element, and its name."""
    text: str = ""
    start: int = 0
    """The byte at which its start tag begins, and below that of its end tag."""
    end_tag: int = 0
    interrupted: bool = False
    """Whether something else interrupts the element's text. Drake reads the text only up to there."""


class ModelFile:
    """Reads and checks one model file; each format has a subclass.

    Attributes:
        sources: the content of the file, and of those that are part of it, by their paths.
        includes: model files that this one includes.
        meshes: files of collision geometry.
        drawn: files of what is only drawn, which Drake looks for.
        left_out: the elements that Drake need not read: the name of each, its file and its place.
        mesh_directories: directories of the meshes, relative to the model.
        collisions: the collision geometries of this file, each by its name or else its shape.

    Raises:
        SceneError: ``scene_model`` or ``unsupported_joint`` with the file and the line, when the file is not accepted.
    """

    ONCE: ClassVar[frozenset[str]]
    """These elements may stand only once in their parent, because Drake reads the first one."""
    UNREAD: ClassVar[frozenset[str]] = frozenset()
    """Drake does not look into these elements."""

    def __init__(self, path: Path, name: str, data: bytes) -> None:
        self.name = name
        self.sources = {path: data}
        self.includes: list[FileReference] = []
        self.meshes: list[MeshReference] = []
        self.drawn: list[FileReference] = []
        self.left_out: list[tuple[str, Path, Place]] = []
        self.mesh_directories = ["."]
        self.collisions: list[Reference] = []
        self._open: list[Element] = []
        self._path, self._data = path, data
        self._read()

    def _read(self) -> None:
        parse_xml(self._data, self.name, "scene_model", self._install)

    def _begin(self, element: Element, parent: str) -> None:
        """Checks an element where it begins, before anything in it."""

    def _check(self, element: Element, parent: str) -> None:
        """Checks an element where it ends."""
        raise NotImplementedError

    def _skip(self, element: Element) -> None:
        """Takes what Drake reads of an element in which nobody looks for bodies, where it ends."""

    def _in_attribute(self, element: Element, key: str) -> FileReference:
        return FileReference(element.attributes[key], element.line, self._path, value_at(self._data, element.start, key))

    def _in_text(self, element: Element) -> FileReference:
        place = text_at(self._data, element.start, element.end_tag)
        return FileReference(element.text.strip(), element.line, self._path, place)

    def _leave_out(self, element: Element) -> None:
        self.left_out.append((element.name, self._path, element_at(self._data, element.start, element.end_tag)))

    def refuse(self, element: Element, what: str, hint: str = "mend the model there", code: str = "scene_model") -> NoReturn:
        raise SceneError(code, f"{self.name}:{element.line}: {what}", field="directives", hint=hint)

    def _check_order(self, element: Element, lower: float, upper: float) -> None:
        if lower > upper:
            self.refuse(element, f"the limits of a joint are {lower:.9g} and {upper:.9g}; the lower one must not be greater")

    def _numbers(self, element: Element, what: str, text: str, counts: tuple[int, ...]) -> list[float]:
        if (numbers := decimals(text, counts)) is None:
            self.refuse(element, f"{what} is {text[:80]!a} instead of {wanted(counts)}")
        return numbers

    def _check_range(self, element: Element, what: str, numbers: list[float], allowed: Range) -> None:
        if (wrong := allowed.outside(numbers)) is not None:
            self.refuse(element, f"{what} has {wrong:g} in it, and its magnitude must be {allowed}", RANGE_HINT)

    def _check_length(self, element: Element, what: str, vector: list[float]) -> None:
        if (length := DIRECTION.outside([math.hypot(*vector)])) is not None:
            self.refuse(element, f"{what} has the length {length:g}; it must be {DIRECTION}, best 1")

    def _check_geometry(self, element: Element) -> None:
        if element.name == "geometry" and COLLISION in element.around and len(element.children & SHAPES) > 1:
            self.refuse(element, "<geometry> has more than one shape, and Drake would read one")

    def _install(self, parser: expat.XMLParserType) -> None:
        def start(name: str, attributes: dict[str, str]) -> None:
            element = Element(name, parser.CurrentLineNumber, attributes, frozenset(), start=parser.CurrentByteIndex)
            if self._open:
                parent = self._open[-1]
                element.around = parent.around | {parent.name}
                if name in parent.children and name in self.ONCE and not element.around & self.UNREAD:
                    self.refuse(element, f"<{parent.name}> has a second <{name}>, and Drake would read the first")
                parent.children.add(name)
                parent.interrupted = True
            self._begin(element, self._open[-1].name if self._open else "")
            self._open.append(element)

        def end(_: str) -> None:
            element = self._open.pop()
            element.end_tag = parser.CurrentByteIndex
            if element.around & self.UNREAD:
                self._skip(element)
            else:
                self._check(element, self._open[-1].name if self._open else "")

        def text(data: str) -> None:
            self._open[-1].text += data

        def interrupt(*_: object) -> None:
            if self._open:
                self._open[-1].interrupted = True

        parser.buffer_text = True
        parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, text
        parser.CommentHandler = parser.ProcessingInstructionHandler = parser.StartCdataSectionHandler = interrupt
