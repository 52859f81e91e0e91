"""SDFormat is read as written here."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

from certifier.scene.formats.model_file import COLLISION, SHAPES, Element, ModelFile, Reference


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
    ONCE = SHAPES.union(
        ["pose", "geometry", "axis", "limit", "uri", "parent", "child"],
        [name for _, name in _COUNTS],
        [name for shape in _DIMENSIONS.values() for name in shape],
    )
    UNREAD = frozenset(["plugin", "sensor", "gui"])

    def __init__(self, path: Path, name: str) -> None:
        self._limits: dict[str, float] = {}
        super().__init__(path, name)

    def _check(self, element: Element, parent: str) -> None:
        dimensions = self._DIMENSIONS.get(parent, {}) if COLLISION in element.around else {}
        if element.name in dimensions:
            if min(self._text(element, (dimensions[element.name],))) <= 0:
                self.refuse(element, f"<{element.name}> must be positive, and Drake would read another number")
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
        elif element.name == "uri" and parent == "mesh" and COLLISION in element.around:
            self.meshes.append(Reference(self._whole(element), element.line))
        elif element.name in self._DIMENSIONS and parent == "geometry" and COLLISION in element.around:
            for missing in self._DIMENSIONS[element.name].keys() - element.children:
                self.refuse(element, f"<{element.name}> has no <{missing}>, and Drake would make one up")
        elif element.name == "drake:mimic":
            for key in ("multiplier", "offset"):
                if key in element.attributes:
                    self._numbers(element, f"{key} of <drake:mimic>", element.attributes[key], (1,))
        self._check_geometry(element)

    def _whole(self, element: Element) -> str:
        if element.interrupted:
            self.refuse(element, f"<{element.name}> holds more than text, and Drake would read a part of it")
        return element.text.strip()

    def _text(self, element: Element, counts: tuple[int, ...]) -> list[float]:
        return self._numbers(element, f"<{element.name}>", self._whole(element), counts)
