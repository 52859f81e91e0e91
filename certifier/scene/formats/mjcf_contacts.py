"""What MJCF says about single pairs is checked here: <pair> and <exclude> in <contact>."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from certifier.errors import close_matches
from certifier.scene.formats.mjcf_geoms import Geom
from certifier.scene.formats.mjcf_tree import MEND, Node, refuse

T = TypeVar("T")


def check_contacts(contacts: list[Node], geoms: list[Geom], bodies: dict[str, Node]) -> None:
    """Checks that a <pair> adds no pair to those of the geoms' bits, because Drake adds none, and that an <exclude> names two bodies.

    Raises:
        SceneError: ``scene_model`` with file and line.
    """
    by_name = {geom.node.attributes["name"]: geom for geom in geoms if "name" in geom.node.attributes}
    excludes = [node for contact in contacts for node in contact.under("exclude")]
    apart = [{id(_named(node, key, bodies, "body")) for key in ("body1", "body2")} for node in excludes]
    for node in (pair for contact in contacts for pair in contact.under("pair")):
        pair = [_named(node, key, by_name, "geom") for key in ("geom1", "geom2")]
        for geom in pair:
            if not geom.collides:
                message = f"Drake leaves out this <pair>: contype and conaffinity of {geom.node.attributes['name'][:80]!a} are 0"
                refuse(node, message, hint="give its geoms the bits 1, and name pairs that never collide in <exclude>")
        one, other = (geom.node.parent for geom in pair)
        assert one is not None
        assert other is not None
        if {id(one), id(other)} in apart or _neighbours(one, other) or _neighbours(other, one):
            message = f"Drake leaves out this <pair> of {' and '.join(geom.node.attributes['name'][:80] for geom in pair)!a}"
            refuse(node, f"{message}: their bodies are one, neighbours or excluded", hint="remove the <pair>, or the <exclude>")


def _named(node: Node, key: str, known: Mapping[str, T], what: str) -> T:
    name = node.attributes.get(key, "")
    if name not in known:
        refuse(
            node, f"{key} of <{node.name}> is {name[:80]!a}, which is no {what} of the model", hint=close_matches(name, list(known)) or MEND
        )
    return known[name]


def _group(body: Node) -> Node:
    """Returns the body nearest the world that a body is rigidly joined to, or the model where it is joined to the world."""
    while body.parent is not None and not body.under("joint", "freejoint"):
        body = body.parent
    return body


def _neighbours(one: Node, other: Node) -> bool:
    """Says whether two bodies never move against each other, or whether the second hangs on the first by a joint."""
    return _group(one) is _group(other) or (other.parent is one and one.name == "body")
