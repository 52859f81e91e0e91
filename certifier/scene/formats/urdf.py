"""URDF is read as written here. Names are checked as strictly as numbers: what is not known is refused (:mod:`.urdf_names`)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

from certifier.errors import close_matches
from certifier.scene.formats.model_file import SHAPES, Element, MeshReference, ModelFile, Reference
from certifier.scene.formats.ranges import POSITION, SCALE, SIZE, Range
from certifier.scene.formats.urdf_names import (
    DRAKE,
    EXPAND,
    HARMLESS,
    LEFT_OUT,
    MAY_HOLD,
    MOVING,
    NAMES,
    OPAQUE,
    READ,
    REFUSED,
    TYPES,
    UNREAD_FILES,
    UNREAD_GROUP,
    UNSUPPORTED,
    Known,
    is_macro,
    nearest_attribute,
    nearest_element,
)

_VISUAL = "visual"
_WORLD = "world"
"""A link of this name is Drake's world, which is there without being written."""


class Urdf(ModelFile):
    """Reads URDF, where numbers are attributes.

    Attributes:
        unlimited: the continuous joints that have limits, which do not count in URDF.
        followers: the names of the joints that mimic another one.
    """

    ONCE = SHAPES | {"origin", "axis", "limit", "geometry", "parent", "child", "mimic"}
    UNREAD = OPAQUE - {_VISUAL}
    """Of what is drawn, Drake reads the shapes, and refuses some of them without a line."""
    _COUNTS: ClassVar[dict[str, tuple[int, ...]]] = {
        **dict.fromkeys(("xyz", "rpy", "size"), (3,)),
        **dict.fromkeys(("radius", "length", "lower", "upper", "a", "b", "c", "multiplier", "offset"), (1,)),
        "scale": (1, 3),
    }
    _SIZES = frozenset(["size", "radius", "length", "a", "b", "c"])
    _RANGES: ClassVar[dict[str, Range]] = {
        **dict.fromkeys(("xyz", "rpy", "multiplier", "offset"), POSITION),
        **dict.fromkeys(_SIZES, SIZE),
        "scale": SCALE,
    }

    def __init__(self, path: Path, name: str, data: bytes) -> None:
        self.unlimited: list[Reference] = []
        self.followers: list[str] = []
        self._opaque = set(OPAQUE)
        """Elements that are not looked into."""
        self._prefixes: list[str] = []
        """Other prefixes of Drake's namespace than ``drake``."""
        self._named: dict[tuple[str, str], Element] = {}
        """Links and joints, by ``link`` or ``joint`` and their names."""
        self._uses: list[tuple[Element, str, str]] = []
        """What names a link or a joint: the element, ``link`` or ``joint``, and the name."""
        self._held: dict[str, Element] = {}
        """The joints by their children."""
        self._materials: list[tuple[Element, tuple[str, ...]]] = []
        """What is drawn in a colour or texture, and which."""
        self._colour: tuple[str, ...] = ()
        self._parts: dict[str, Element] = {}
        """The elements of the joint or the collision that is being read."""
        super().__init__(path, name, data)

    def _begin(self, element: Element, parent: str) -> None:
        if is_macro(parent, element.name):
            self.refuse(element, f"<{element.name}> is a macro that was not expanded", hint=EXPAND)
        for key, value in element.attributes.items():
            if ("${" in value or "$(" in value) and "gazebo" not in element.around:
                self.refuse(element, f"{key} of <{element.name}> is {value[:80]!a}, which was not expanded", hint=EXPAND)
        if element.name == "texture" or (element.name == "mesh" and _VISUAL in element.around):
            self._draw(element)
        self._prefixes += [key.removeprefix("xmlns:") for key, uri in element.attributes.items() if uri == DRAKE]
        if element.around & self._opaque:
            if element.name in NAMES and not any(element.name in MAY_HOLD.get(place, ()) for place in element.around):
                self.refuse(element, f"<{element.name}> in <{parent}> is not read", hint=nearest_element(parent, element.name))
            return
        if (parent, element.name) in REFUSED:
            why, hint = REFUSED[parent, element.name]
            self.refuse(element, f"<{element.name}>: {why}", hint=hint)
        if (parent, element.name) == ("robot", "drake:joint"):
            self._check_type(element)
        if (known := READ.get((parent, element.name))) is not None:
            self._check_attributes(element, known)
        elif (parent, self._drakes(element.name)) == UNREAD_GROUP or self._drakes(element.name) in HARMLESS.get(parent, ()):
            self._opaque.add(element.name)
        else:
            where = f"in <{parent}>" if parent else "as the root of a URDF file"
            self.refuse(element, f"<{element.name}> is not known {where}", hint=nearest_element(parent, element.name))
        if element.name in ("joint", "collision"):
            self._parts = {}

    def _draw(self, element: Element) -> None:
        if "filename" in element.attributes and not element.around & UNREAD_FILES:
            self.drawn.append(self._in_attribute(element, "filename"))

    def _check_attributes(self, element: Element, known: Known) -> None:
        for key in element.attributes:
            if (element.name, f"@{key}") in REFUSED:
                why, hint = REFUSED[element.name, f"@{key}"]
                self.refuse(element, f"{key} of <{element.name}>: {why}", hint=hint)
            if self._drakes(key) not in known.attributes and key.partition(":")[0] != "xmlns":
                self.refuse(element, f"{key} is not known in <{element.name}>", hint=nearest_attribute(known, key))
        self._check_needed(element, known)

    def _drakes(self, name: str) -> str:
        """Returns a name with Drake's own prefix in the place of another that the file gives Drake's namespace."""
        prefix, colon, rest = name.partition(":")
        return f"drake:{rest}" if colon and prefix in self._prefixes else name

    def _check_needed(self, element: Element, known: Known) -> None:
        for key in known.needed:
            if not element.attributes.get(key):
                self.refuse(element, f"<{element.name}> has no {key}")

    def _check(self, element: Element, parent: str) -> None:
        if element.name in LEFT_OUT.get(parent, ()) and not element.around & self._opaque:
            self._leave_out(element)
        if element.name == "material" and element.around <= {"robot", "link", _VISUAL}:
            self._materials.append((element, self._colour))
            self._colour = ()
        if element.name == "robot" and not parent:
            self._check_materials()
        drawn = _VISUAL in element.around
        known = READ.get(("collision" if parent == _VISUAL else parent, element.name))
        if known is None or (element.around & self._opaque and not drawn):
            return
        if not drawn and element.text.strip():
            self.refuse(element, f"<{element.name}> holds the text {element.text.strip()[:80]!a}, which is not read")
        self._check_numbers(element, known)
        if parent == "geometry":
            self._check_needed(element, known)
        self._check_geometry(element)
        if not drawn:
            self._parts[element.name] = element
            self._check_read(element, parent, known)

    def _skip(self, element: Element) -> None:
        if "material" in element.around:
            self._colour += tuple(word for key in ("rgba", "filename") for word in element.attributes.get(key, "").split())

    def _check_materials(self) -> None:
        """Leaves out all materials where Drake would stop at one that is not defined, or is defined twice in different ways."""
        known: dict[str, tuple[str, ...]] = {}
        for material, colour in sorted(self._materials, key=lambda found: len(found[0].around)):
            name = material.attributes.get("name", "")
            if known.setdefault(name, colour) != (colour or known[name]) or not known[name]:
                for found, _ in self._materials:
                    self._leave_out(found)
                return

    def _check_numbers(self, element: Element, known: Known) -> None:
        for key in (key for key in known.attributes if key in self._COUNTS and key in element.attributes):
            what = f"{key} of <{element.name}>"
            numbers = self._numbers(element, what, element.attributes[key], self._COUNTS[key])
            if key in self._SIZES and min(numbers) <= 0:
                self.refuse(element, f"{what} must be positive, and is {element.attributes[key]}")
            if key in self._RANGES and element.name != "axis" and (key == "scale" or _VISUAL not in element.around):
                self._check_range(element, what, numbers, self._RANGES[key])
            if element.name == "origin" and element.around == {"robot", "link"} and any(numbers):
                self.refuse(element, "<origin> in <link> is not read", hint=nearest_element("link", "origin"))

    def _check_read(self, element: Element, parent: str, known: Known) -> None:
        for name in known.holds:
            if name not in element.children:
                self.refuse(element, f"<{element.name}> has no <{name}>")
        match element.name:
            case "robot":
                self._check_uses()
            case "link" | "joint" if parent == "robot":
                self._add(element)
                if element.name == "joint":
                    self._check_joint(element)
            case "geometry" if not element.children & SHAPES:
                self.refuse(element, "<geometry> has no shape", hint=f"shapes: {', '.join(sorted(SHAPES & {name for _, name in READ}))}")
            case "mesh":
                x, y, z = (list(map(float, element.attributes.get("scale", "1").split())) * 3)[:3]
                self.meshes.append(MeshReference(**vars(self._in_attribute(element, "filename")), scale=(x, y, z)))
            case "collision":
                if element.attributes.get("name") == "":
                    self.refuse(element, "the name of <collision> is empty", hint="give it a name of its own, or leave name out")
                shape = next(name for name in self._parts if name in SHAPES)
                self.collisions.append(Reference(element.attributes.get("name", shape), element.line))
            case "frame" | "parent" | "child":
                self._uses.append((element, "link", element.attributes["link"]))
            case "mimic":
                self._uses.append((element, "joint", element.attributes["joint"]))

    def _add(self, element: Element) -> None:
        key = element.name, element.attributes["name"]
        if (first := self._named.setdefault(key, element)) is not element:
            self.refuse(element, f"a second {key[0]} is called {key[1]!a}; the first is in line {first.line}", hint="rename one of them")

    def _check_type(self, joint: Element) -> None:
        kind = joint.attributes.get("type", "")
        if kind not in TYPES:
            hint = UNSUPPORTED.get(kind) or close_matches(kind.lower(), list(TYPES)) or f"supported: {', '.join(TYPES)}"
            message = f"joint {joint.attributes.get('name', '')[:80]!a} is a {kind[:80]!a} joint; {', '.join(TYPES)} are supported"
            self.refuse(joint, message, hint=hint, code="unsupported_joint")

    def _check_joint(self, joint: Element) -> None:
        self._check_type(joint)
        kind, child = joint.attributes["type"], self._parts["child"]
        name, limit, axis = child.attributes["link"], self._parts.get("limit"), self._parts.get("axis")
        if (first := self._held.setdefault(name, joint)) is not joint:
            self.refuse(child, f"link {name!a} is the child of another joint too, in line {first.line}", hint="only trees are supported")
        if "mimic" in self._parts:
            if kind == "fixed":
                self._leave_out(self._parts["mimic"])
            else:
                self.followers.append(joint.attributes["name"])
        if kind in MOVING:
            if axis is not None:
                self._check_length(axis, "xyz of <axis>", list(map(float, axis.attributes["xyz"].split())))
            self._check_limit(joint, limit, kind)

    def _check_limit(self, joint: Element, limit: Element | None, kind: str) -> None:
        """Checks the limits of a joint that moves. URDF takes a missing one for 0, and Drake for none.

        A slide needs limits that are finite, so for one whose limits are missing the scene file has to give some.
        """
        given = {} if limit is None else {key: limit.attributes[key] for key in ("lower", "upper") if key in limit.attributes}
        if kind == "continuous" and given and limit is not None:
            self.unlimited.append(Reference(joint.attributes["name"], limit.line))
        if kind == "revolute":
            for key in ("lower", "upper"):
                if key not in given:
                    hint = "write lower and upper in radians, or make the joint continuous"
                    self.refuse(limit or joint, f"the <limit> of a revolute joint has no {key}", hint=hint)
        if limit is not None:
            self._check_order(limit, float(given.get("lower", -math.inf)), float(given.get("upper", math.inf)))

    def _check_uses(self) -> None:
        for element, what, name in self._uses:
            if (what, name) not in self._named and (what, name) != ("link", _WORLD):
                known = [known for kind, known in self._named if kind == what]
                hint = close_matches(name, known) or f"the file has {len(known)} {what}s"
                self.refuse(element, f"<{element.name}> names the {what} {name[:80]!a}, which is not in the file", hint=hint)
