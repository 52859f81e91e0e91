"""MJCF is read as written here."""

from __future__ import annotations

from typing import ClassVar

from certifier.scene.formats.model_file import Element, ModelFile, Reference


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

    def _check(self, element: Element, parent: str) -> None:
        if parent in ("body", "worldbody") and element.name not in self._IN_BODIES:
            self.refuse(element, f"<{element.name}> in a body is not read by Drake")
        if element.name in self._NUMBERED:
            for key, counts in self._COUNTS.items():
                if key in element.attributes:
                    numbers = self._numbers(element, f"{key} of <{element.name}>", element.attributes[key], counts)
                    if (element.name, key) == ("joint", "range"):
                        self._check_order(element, *numbers)
            for key in self._MOVED & element.attributes.keys():
                self.refuse(element, f"{key} of <{element.name}> is not read by Drake")
            if float(element.attributes.get("ref", 0)) != 0:
                self.refuse(element, f"ref of <{element.name}> is not read by Drake: measure the joint's positions from 0")
        if element.name == "mesh" and "file" in element.attributes:
            self.meshes.append(Reference(element.attributes["file"], element.line))
        if element.name == "include" and "file" in element.attributes:
            self.includes.append(Reference(element.attributes["file"], element.line))
        self.mesh_directories += [element.attributes[key] for key in ("meshdir", "assetdir") if key in element.attributes]
