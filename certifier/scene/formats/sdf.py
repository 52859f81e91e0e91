"""SDFormat is read as written here."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

from certifier.errors import close_matches
from certifier.scene.formats import sdf_names
from certifier.scene.formats.model_file import Element, FileReference, MeshReference, ModelFile, Reference
from certifier.scene.formats.ranges import POSITION, SCALE, SIZE


class Sdf(ModelFile):
    """Reads SDFormat, where numbers are the text of elements.

    Attributes:
        mimics: the lines of SDFormat's own <mimic>, which Drake does not read.
    """

    _DIMENSIONS: ClassVar[dict[str, dict[str, int]]] = {
        "box": {"size": 3},
        "sphere": {"radius": 1},
        **{name: {"radius": 1, "length": 1} for name in ("cylinder", "capsule", "drake:capsule")},
        "ellipsoid": {"radii": 3},
        "drake:ellipsoid": {"a": 1, "b": 1, "c": 1},
    }
    _COUNTS: ClassVar[dict[tuple[str, str], tuple[int, ...]]] = {
        ("axis", "xyz"): (3,),
        ("axis2", "xyz"): (3,),
        ("limit", "lower"): (1,),
        ("limit", "upper"): (1,),
        ("plane", "normal"): (3,),
        ("mesh", "scale"): (3,),
        ("mimic", "multiplier"): (1,),
        ("mimic", "offset"): (1,),
        ("mimic", "reference"): (1,),
    }
    _TEXTS = frozenset(["parent", "child", "uri", "name", "placement_frame", "drake:member", "drake:member_group"]) | {
        "drake:ignored_collision_filter_group"
    }
    """The text of these elements is a name."""
    _SWITCHES = frozenset(["static", "use_parent_model_frame", "kinematic", "must_be_base_link"])
    _OFF = frozenset(["kinematic", "must_be_base_link"])
    _TRUE, _FALSE = frozenset(["true", "1"]), frozenset(["false", "0"])
    _TWO_AXES = frozenset(["universal", "revolute2", "gearbox"])
    _POSES: ClassVar[dict[str, int]] = {"euler_rpy": 6, "quat_xyzw": 7}
    _UNIT = 1e-7
    """The length of a quaternion may differ from 1 by this."""
    ONCE = frozenset().union(*sdf_names.ONCE.values()).difference(*sdf_names.MANY.values())
    UNREAD = frozenset().union(*sdf_names.HARMLESS.values()) - sdf_names.READ

    def __init__(self, path: Path, name: str, data: bytes) -> None:
        self.mimics: list[int] = []
        self._limits: dict[str, float] = {}
        self._uri: FileReference | None = None
        self._scale = 1.0, 1.0, 1.0
        """The file and the scale of the mesh that is being read."""
        super().__init__(path, name, data)

    def _begin(self, element: Element, parent: str) -> None:
        if sdf_names.local(element.name) in sdf_names.MEANT and not element.around & self.UNREAD:
            for place in filter(sdf_names.is_custom, element.around):
                self.refuse(element, f"<{element.name}> in <{place}> is not read", "write it outside of what SDFormat does not know")

    def _check(self, element: Element, parent: str) -> None:
        if any(map(sdf_names.is_custom, element.around)):
            return
        self._check_name(element, parent)
        self._check_twice(element)
        dimensions = self._DIMENSIONS.get(parent, {})
        if element.name in dimensions:
            sizes = self._text(element, (dimensions[element.name],))
            if min(sizes) <= 0:
                self.refuse(element, f"<{element.name}> must be positive, and Drake would read another number")
            self._check_range(element, f"<{element.name}>", sizes, SIZE)
        elif element.name == "pose":
            self._check_pose(element)
        elif (counts := self._COUNTS.get((parent, element.name))) is not None:
            numbers = self._text(element, counts)
            if parent == "limit":
                self._limits[element.name] = numbers[0]
            elif parent == "mesh":
                self._check_range(element, "<scale>", numbers, SCALE)
                self._scale = numbers[0], numbers[1], numbers[2]
            elif element.name in ("xyz", "normal"):
                self._check_length(element, f"<{element.name}>", numbers)
        elif element.name == "limit":
            self._check_order(element, self._limits.pop("lower", -math.inf), self._limits.pop("upper", math.inf))
        elif element.name == "uri" and parent == "include":
            self._whole(element)
            self.includes.append(self._in_text(element))
        elif element.name == "uri" and parent == "mesh":
            self._whole(element)
            self._uri = self._in_text(element)
        elif element.name == "mesh" and parent == "geometry":
            if self._uri is None:
                self.refuse(element, "<mesh> has no <uri>")
            self.meshes.append(MeshReference(**vars(self._uri), scale=self._scale))
            self._uri, self._scale = None, (1.0, 1.0, 1.0)
        elif element.name in self._DIMENSIONS and parent == "geometry":
            for missing in self._DIMENSIONS[element.name].keys() - element.children:
                self.refuse(element, f"<{element.name}> has no <{missing}>, and Drake would make one up")
        elif element.name in self._TEXTS:
            self._whole(element)
        elif element.name in self._SWITCHES:
            self._check_switch(element, f"<{element.name}>", self._whole(element))
        else:
            self._check_structure(element)

    def _skip(self, element: Element) -> None:
        if element.name in sdf_names.FILES and "visual" in element.around:
            self.drawn.append(self._in_text(element))

    def _check_name(self, element: Element, parent: str) -> None:
        """Refuses an element, or an attribute of it, that is not known where it stands. What an unknown parent has, is left to that."""
        name = element.name
        if parent in sdf_names.READ:
            if (instead := sdf_names.REFUSED.get(parent, {}).get(name)) is not None:
                self.refuse(element, f"<{name}> in <{parent}> is not read", instead)
            custom = sdf_names.is_custom(name) and sdf_names.local(name) not in sdf_names.MEANT and parent != "geometry"
            if name not in (known := sdf_names.known(parent)) and not custom:
                self.refuse(element, f"<{name}> is not known in <{parent}>", _nearest(name, known))
        if name not in sdf_names.READ or name in sdf_names.HARMLESS.get(parent, ()):
            return
        for key in element.attributes:
            known = list(sdf_names.ATTRIBUTES.get(name, ()))
            if key not in known and not (sdf_names.is_custom(key) and sdf_names.local(key) not in known):
                self.refuse(element, f"the attribute {key[:80]!a} of <{name}> is not known", _nearest(key, known))
        if name in sdf_names.CONTAINERS and element.text.strip():
            self.refuse(element, f"<{name}> holds the text {element.text.strip()[:80]!a}, which nobody reads")

    def _check_twice(self, element: Element) -> None:
        """Refuses a name that a sibling of the same kind has."""
        if self._open and "name" in element.attributes:
            name = element.name, element.attributes["name"]
            if name in self._open[-1].names:
                self.refuse(element, f"a second <{element.name}> is called {name[1][:80]!a}", "give each its own name")
            self._open[-1].names.add(name)

    def _check_structure(self, element: Element) -> None:
        match element.name:
            case "sdf":
                self._check_one_of(element, "version", sdf_names.VERSIONS)
            case "include" if "merge" in element.attributes:
                self._check_switch(element, "merge of <include>", element.attributes["merge"])
            case "collision" if "geometry" not in element.children:
                self.refuse(element, "<collision> has no <geometry>")
            case "geometry":
                self._check_geometry(element)
                for shape in element.children:
                    if shape != "empty":
                        self.collisions.append(Reference(shape, element.line))
                if not element.children:
                    self.refuse(element, "<geometry> has no shape; <empty/> would say that there is none")
            case "joint":
                self._check_one_of(element, "type", sdf_names.JOINTS)
                if "axis2" in element.children and element.attributes["type"].lower() not in self._TWO_AXES:
                    self.refuse(element, "<joint> has an <axis2>, which its type does not have")
            case "mimic":
                self.mimics.append(element.line)
            case "drake:mimic":
                for key in {"multiplier", "offset"} & element.attributes.keys():
                    what = f"{key} of <drake:mimic>"
                    self._check_range(element, what, self._numbers(element, what, element.attributes[key], (1,)), POSITION)

    def _check_one_of(self, element: Element, key: str, known: tuple[str, ...]) -> None:
        value = element.attributes.get(key, "")
        if value.lower() not in known:
            message = f"{key} of <{element.name}> is {value[:80]!a}"
            self.refuse(element, message, close_matches(value, list(known)) or f"known: {', '.join(known)}")

    def _check_switch(self, element: Element, what: str, text: str) -> None:
        if text not in self._TRUE | self._FALSE:
            self.refuse(element, f"{what} is {text[:80]!a} instead of true or false")
        if element.name in self._OFF and text in self._TRUE:
            self.refuse(element, f"{what} is true, and Drake does not read it", "say by joints what holds the link")

    def _check_pose(self, element: Element) -> None:
        rotation = element.attributes.get("rotation_format", "euler_rpy")
        if rotation not in self._POSES:
            self.refuse(element, f"rotation_format of <pose> is {rotation[:80]!a}", f"known: {', '.join(self._POSES)}")
        if "frame" in element.attributes and self._open[0].attributes.get("version") not in sdf_names.WITH_POSE_FRAMES:
            self.refuse(element, "SDFormat 1.7 and later have no frame of <pose>", "write relative_to")
        numbers = self._text(element, (0, self._POSES[rotation]))
        if "degrees" in element.attributes:
            self._check_switch(element, "degrees of <pose>", element.attributes["degrees"])
        self._check_range(element, "<pose>", numbers, POSITION)
        if len(numbers) == 7 and not abs(math.hypot(*numbers[3:]) - 1) <= self._UNIT:
            message = f"the quaternion of <pose> has the length {math.hypot(*numbers[3:]):.9g} instead of 1, and Drake would not make it 1"
            self.refuse(element, message, "write more digits, or roll, pitch and yaw with degrees")

    def _whole(self, element: Element) -> str:
        if element.interrupted:
            self.refuse(element, f"<{element.name}> holds more than text, and Drake would read a part of it")
        return element.text.strip()

    def _text(self, element: Element, counts: tuple[int, ...]) -> list[float]:
        return self._numbers(element, f"<{element.name}>", self._whole(element), counts)


def _nearest(name: str, known: list[str]) -> str:
    return close_matches(name, known) or f"known there: {', '.join(known) or 'nothing'}"
