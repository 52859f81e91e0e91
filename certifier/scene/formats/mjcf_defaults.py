"""The attributes of an element of MJCF come from the element itself and from its class of defaults. Both are put together here.

MuJoCo and Drake differ here: in MuJoCo a class has everything that the classes around it have. In Drake, the chain ends at the first class
without an element of the kind: a geom of a class without <geom> gets nothing from the classes around it. What differs is refused.
"""

from __future__ import annotations

from certifier.errors import close_matches
from certifier.names import escaped
from certifier.scene.formats.mjcf_names import ELEMENTS, ORIENTATIONS
from certifier.scene.formats.mjcf_tree import MEND, Node, refuse

MAIN = "main"


class Defaults:
    """Knows the classes of a model.

    Raises:
        SceneError: ``scene_model`` with file and line, for classes that MuJoCo refuses or Drake reads otherwise.
    """

    def __init__(self, root: Node) -> None:
        self._around: dict[str, str | None] = {MAIN: None}
        self._elements: dict[tuple[str, str], Node] = {}
        waiting = root.under("default")
        for node in waiting:
            self._add(node)
            waiting += node.under("default")

    def attributes(self, node: Node) -> dict[str, str]:
        """Returns what a geom, a joint or a mesh has for attributes, its own and those of its class.

        Raises:
            SceneError: ``scene_model`` with file and line, where Drake would find others.
        """
        cls = self._class(node)
        chain = [cls]
        while (around := self._around[chain[-1]]) is not None:
            chain.append(around)
        found, drakes, reached = dict(node.attributes), dict(node.attributes), True
        for name in chain:
            default = self._elements.get((name, node.name))
            if default is not None:
                found = _merged(found, default.attributes)
            reached = reached and default is not None
            if reached and default is not None:
                drakes = _merged(drakes, default.attributes)
        for key in sorted(ELEMENTS[node.name].read):
            if found.get(key) != drakes.get(key):
                empty = next(name for name in chain if (name, node.name) not in self._elements)
                hint = f'write <{node.name}/> into <default class="{escaped(empty[:80])}">'
                refuse(
                    node,
                    f"{key} comes from a class around {empty[:80]!a}, which has no <{node.name}>: Drake does not look there",
                    hint=hint,
                )
        return found

    def _add(self, node: Node) -> None:
        assert node.parent is not None
        name = node.attributes.get("class")
        if node.parent.name != "default":
            if name not in (None, MAIN):
                refuse(
                    node, f"the class of the outer <default> is {name[:80]!a}, and MuJoCo calls it main", hint="put a <default> around it"
                )
            name = MAIN
        else:
            if not name or name in self._around:
                refuse(node, f"a <default> in another one must have a class of its own, and {(name or '')[:80]!a} is none")
            self._around[name] = node.parent.attributes.get("class", MAIN)
        for element in node.under("geom", "joint", "mesh"):
            if (name, element.name) in self._elements:
                refuse(element, f"the class {name[:80]!a} has a second <{element.name}>, and Drake would read only this one")
            self._elements[name, element.name] = element

    def _class(self, node: Node) -> str:
        around = None if node.name == "mesh" else node.childclass
        cls = node.attributes.get("class", MAIN if around is None else around)
        if cls not in self._around:
            refuse(node, f"the class {cls[:80]!a} is not known", hint=close_matches(cls, list(self._around)) or MEND)
        return cls


def _merged(near: dict[str, str], far: dict[str, str]) -> dict[str, str]:
    """Returns the attributes of both. The nearer ones count; of orientations, whichever way they are written."""
    turned = any(key in near for key in ORIENTATIONS)
    return {**{key: value for key, value in far.items() if not (turned and key in ORIENTATIONS)}, **near}
