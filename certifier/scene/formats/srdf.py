"""SRDF is read here as strictly as models are: which pairs of links are not checked, and the states of groups.

MoveIt prints an error about what it cannot read, and goes on without it. Here the file is refused, with the line. Groups, end effectors
and so on make no difference to where bodies touch, so they are not looked into.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from certifier.errors import SceneError, close_matches
from certifier.names import escaped
from certifier.positions import MAGNITUDE
from certifier.scene.formats.model_file import decimals, wanted
from certifier.scene.formats.urdf_names import Known
from certifier.scene.nodes import MAX_DEPTH
from certifier.scene.xml import parse_xml

_PAIR = Known(needed=("link1", "link2"), read=("reason",))
READ: Mapping[tuple[str, str], Known] = {
    ("", "robot"): Known(read=("name",), harmless=("version",)),
    ("robot", "disable_collisions"): _PAIR,
    ("robot", "enable_collisions"): _PAIR,
    ("robot", "disable_default_collisions"): Known(needed=("link",), harmless=("reason",)),
    ("robot", "group_state"): Known(needed=("name",), read=("group",)),
    ("group_state", "joint"): Known(needed=("name", "value")),
    ("robot", "virtual_joint"): Known(needed=("name",), harmless=("type", "parent_frame", "child_link")),
}
"""By the names of the parent and of the element. The parent of the root is empty."""
HARMLESS = (
    *("group", "end_effector", "passive_joint", "joint_property", "link_sphere_approximation"),
    *("gripper", "specificities", "rotor_params"),
)
"""Elements of a robot that are not looked into. MoveIt reads those of the first line, and other programs those of the second."""
_ONLY_READ = {name for place, name in READ if place == "robot" and name != "virtual_joint"}
"""These stand in a robot and nowhere else: somebody who wrote them elsewhere meant them."""
_EXPAND = "expand the file with xacro first: xacro FILE > robot.srdf"
_REASON = 80
"""A reason is cut to this many characters."""


@dataclass(frozen=True)
class LinkPair:
    """Names two links of the model, and says why they are not checked; ``line`` is where the file says so."""

    a: str
    b: str
    reason: str
    line: int


@dataclass(frozen=True)
class State:
    """A state of a group of joints.

    Attributes:
        positions: by joint, radians or metres. Joints of the base are left out: virtual ones, and those that have several numbers.
    """

    name: str
    group: str
    positions: Mapping[str, float]
    line: int


class Srdf:
    """Reads one file.

    Attributes:
        disabled, enabled: pairs of links whose collisions are disabled, and enabled again.
        undefaulted: the links whose collisions are disabled but for the enabled pairs, each with its line.
        states: the states of groups.

    Args:
        name: the file's name for people.

    Raises:
        SceneError: ``scene_srdf``, with file and line, when the file is not accepted.
    """

    def __init__(self, path: Path, name: str) -> None:
        self.name = name
        self.disabled: list[LinkPair] = []
        self.enabled: list[LinkPair] = []
        self.undefaulted: dict[str, int] = {}
        self.states: list[State] = []
        self._virtual: set[str] = set()
        self._open: list[str] = []
        self._state: dict[str, float] = {}
        self._begun: tuple[dict[str, str], int] = ({}, 0)
        parse_xml(path.read_bytes(), name, "scene_srdf", self._install)
        self._finish()

    def _install(self, parser: expat.XMLParserType) -> None:
        def start(element: str, attributes: dict[str, str]) -> None:
            parent = self._open[-1] if self._open else ""
            self._begin(element, parent, {key: value.strip() for key, value in attributes.items()}, parser.CurrentLineNumber)
            self._open.append(element)
            if len(self._open) > MAX_DEPTH:
                self.refuse(parser.CurrentLineNumber, f"elements may be nested at most {MAX_DEPTH} levels deep", "take some out")

        def end(element: str) -> None:
            self._open.pop()
            if element == "group_state" and len(self._open) == 1:
                attributes, line = self._begun
                self.states.append(State(attributes["name"], attributes.get("group", ""), self._state, line))

        parser.StartElementHandler, parser.EndElementHandler = start, end

    def _begin(self, element: str, parent: str, attributes: dict[str, str], line: int) -> None:
        for key, value in attributes.items():
            if "${" in value or "$(" in value:
                self.refuse(line, f"{key} of <{element}> is {value[:80]!a}, which was not expanded", _EXPAND)
        if element.startswith("xacro:"):
            self.refuse(line, f"<{element}> is a macro that was not expanded", _EXPAND)
        if len(self._open) > 1 and self._open[1] in HARMLESS:
            if element in _ONLY_READ:
                self.refuse(line, f"<{element}> in <{parent}> is not read", f"<{element}> belongs in <robot>")
            return
        if parent == "robot" and element in HARMLESS:
            return
        known = READ.get((parent, element))
        if known is None:
            inside = [name for place, name in READ if place == parent] + ([*HARMLESS] if parent == "robot" else [])
            where = f"in <{parent}>" if parent else "as the root of an SRDF file"
            hint = close_matches(element, inside) or (f"known there: {', '.join(inside)}" if inside else "take it out")
            self.refuse(line, f"<{element}> is not known {where}", hint)
        for key in attributes:
            if key not in known.attributes and key.partition(":")[0] != "xmlns":
                hint = close_matches(key, [*known.attributes]) or f"known attributes: {', '.join(known.attributes)}"
                self.refuse(line, f"{key} is not known in <{element}>", hint)
        for key in known.needed:
            if not attributes.get(key):
                self.refuse(line, f"<{element}> has no {key}", "write it")
        self._take(element, attributes, line)

    def _take(self, element: str, attributes: dict[str, str], line: int) -> None:
        match element:
            case "disable_collisions" | "enable_collisions":
                reason = " ".join(escaped(attributes.get("reason", "")).split())[:_REASON].rstrip() or "no reason given"
                pair = LinkPair(attributes["link1"], attributes["link2"], reason, line)
                if pair.a == pair.b:
                    self.refuse(line, f"link1 and link2 are both {pair.a[:80]!a}", "name two links")
                (self.disabled if element == "disable_collisions" else self.enabled).append(pair)
            case "disable_default_collisions":
                self.undefaulted.setdefault(attributes["link"], line)
            case "virtual_joint":
                self._virtual.add(attributes["name"])
            case "group_state":
                self._state, self._begun = {}, (attributes, line)
            case "joint":
                self._add_position(attributes, line)

    def _add_position(self, attributes: dict[str, str], line: int) -> None:
        joint, text = attributes["name"], attributes["value"]
        numbers = decimals(text, (max(1, len(text.split())),))
        if numbers is None or max(map(abs, numbers)) > MAGNITUDE:
            what = f"the value of joint {joint[:80]!a} is {text[:80]!a} instead of {wanted((1,))} of at most {MAGNITUDE:g}"
            self.refuse(line, what, "write its position in radians or metres")
        if joint in self._state:
            self.refuse(line, f"the state names joint {joint[:80]!a} twice", "leave one of them out")
        if len(numbers) == 1:
            self._state[joint] = numbers[0]

    def _finish(self) -> None:
        enabled = {frozenset((pair.a, pair.b)): pair.line for pair in self.enabled}
        for pair in self.disabled:
            if (line := enabled.get(frozenset((pair.a, pair.b)))) is not None:
                what = f"the collisions of {pair.a[:80]!a} and {pair.b[:80]!a} are disabled here and enabled in line {line}"
                self.refuse(pair.line, what, "leave one of them out")
        seen: dict[tuple[str, str], int] = {}
        for state in self.states:
            if (line := seen.setdefault((state.group, state.name), state.line)) != state.line:
                self.refuse(state.line, f"the state {state.name[:80]!a} stands in line {line} already", "rename one of them")
        base = self._virtual
        self.states = [
            State(s.name, s.group, {joint: value for joint, value in s.positions.items() if joint not in base}, s.line) for s in self.states
        ]

    def refuse(self, line: int, what: str, hint: str) -> NoReturn:
        raise SceneError("scene_srdf", f"{self.name}:{line}: {what}", hint=hint)
