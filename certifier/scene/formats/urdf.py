"""URDF is read as written here."""

from __future__ import annotations

import math
from typing import ClassVar

from certifier.scene.formats.model_file import COLLISION, SHAPES, Element, ModelFile, Reference


class Urdf(ModelFile):
    """Reads URDF, where numbers are attributes."""

    ONCE = SHAPES | {"origin", "axis", "limit", "geometry", "parent", "child"}
    UNREAD = frozenset(["gazebo"])
    _COUNTS: ClassVar[dict[str, tuple[int, ...]]] = {
        **dict.fromkeys(("xyz", "rpy", "size"), (3,)),
        **dict.fromkeys(("radius", "length", "lower", "upper", "a", "b", "c", "multiplier", "offset"), (1,)),
        "scale": (1, 3),
    }

    def _check(self, element: Element, parent: str) -> None:
        for key, counts in self._COUNTS.items():
            if key in element.attributes:
                self._numbers(element, f"{key} of <{element.name}>", element.attributes[key], counts)
        if element.name == "limit" and parent == "joint":
            limits = (float(element.attributes.get(key, limit)) for key, limit in (("lower", -math.inf), ("upper", math.inf)))
            self._check_order(element, *limits)
        self._check_geometry(element)
        if COLLISION in element.around and element.name == "mesh" and "filename" in element.attributes:
            self.meshes.append(Reference(element.attributes["filename"], element.line))
