"""Drake Model Directives are checked here before Drake reads them: which files they add, and that their numbers are numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import yaml

from certifier.errors import SceneError
from certifier.positions import MAGNITUDE
from certifier.scene.formats.model_file import decimals
from certifier.scene.nodes import compose
from certifier.scene.paths import beside

_SHORT = 1e-6
"""Least length of the axis of a rotation. Of a zero axis, Drake makes a matrix that is no rotation."""
_NULL = "tag:yaml.org,2002:null"
_NAMES = {"add_model": "name", "add_directives": "model_namespace"}


@dataclass(frozen=True)
class AddedFile:
    """A file that a directive adds.

    Attributes:
        kind: ``add_model`` or ``add_directives``.
        node: holds the file as written.
        named: the name of the model, or of the models' namespace; empty without one.
    """

    kind: str
    node: yaml.ScalarNode
    named: str

    @property
    def file(self) -> str:
        return str(self.node.value)

    @property
    def line(self) -> int:
        return int(self.node.start_mark.line) + 1


def added_by(text: str, name: str) -> list[AddedFile]:
    """Returns the files that a document of Drake Model Directives adds.

    Args:
        name: the document's name for people.

    Raises:
        SceneError: ``scene_yaml`` or ``scene_field``, with the line, for what Drake would read otherwise or as no number.
    """
    root = compose(text, name)
    entries = root.value if isinstance(root, yaml.MappingNode) else []
    lists = [value for key, value in entries if key.value == "directives" and isinstance(value, yaml.SequenceNode)]
    for directives in lists:
        check_directives(directives, name)
    return [file for directives in lists for file in added_files(directives)]


def added_files(directives: yaml.Node) -> list[AddedFile]:
    """Returns the files that a list of directives adds."""
    found = []
    for kind, body in _each(directives):
        if kind in _NAMES and isinstance(body, yaml.MappingNode):
            said = [(key.value, value) for key, value in body.value if isinstance(value, yaml.ScalarNode) and value.tag != _NULL]
            named = next((value.value for key, value in said if key == _NAMES[kind]), "")
            found += [AddedFile(kind, value, named) for key, value in said if key == "file"]
    return found


def check_directives(directives: yaml.Node, name: str) -> None:
    """Checks that every text is printable and on one line, and that the numbers of transforms and positions are finite, and none above 1e6.

    What has another structure than Drake's directives is left to Drake, which refuses it.

    Raises:
        SceneError: ``scene_field``, with the document's name and the line.
    """
    for node in _inside(directives):
        if isinstance(node, yaml.ScalarNode) and (node.style in ("|", ">") or node.start_mark.line != node.end_mark.line):
            _refuse(name, node, "the text goes over several lines", "write it on one line, in quotes")
        if isinstance(node, yaml.ScalarNode) and not node.value.isprintable():
            _refuse(name, node, f"the text {node.value[:80]!a} has a character that cannot be printed", "remove it")
    for _, body in _each(directives):
        for key, value in _pairs(body):
            if key in ("X_PC", "X_PF"):
                _check_transform(value, key, name)
            for inside, content in _pairs(value):
                if key == "default_free_body_pose":
                    _check_transform(content, key, name)
                elif key == "default_joint_positions":
                    _check_numbers(content, f"{inside[:80]!a} in {key}", name)


def resolved(text: str, directives: yaml.Node, directory: Path) -> str:
    """Returns a document for Drake: the directives of a scene file with absolute paths, at the line numbers of the file.

    Args:
        text: the scene file, and ``directives`` the list in it.
        directory: relative paths start there.

    Raises:
        SceneError: as :func:`certifier.scene.paths.beside`.
    """
    start, end = directives.start_mark.index, directives.end_mark.index
    relative = [file.node for file in added_files(directives) if "://" not in file.file]
    absolute = [json.dumps(f"file://{beside(directory, node.value)}", ensure_ascii=False) for node in relative]
    document = replaced(text, start, end, list(zip(relative, absolute, strict=True)))
    line, column = directives.start_mark.line, directives.start_mark.column
    if line == 0:
        return f"directives: {document}"
    return "\n" * (line - 1) + "directives:\n" + " " * column + document


def replaced(text: str, start: int, end: int, changed: Sequence[tuple[yaml.Node, str]]) -> str:
    """Returns a part of the text with other texts in the place of some of its nodes, which are in order."""
    pieces, last = [], start
    for node, instead in changed:
        pieces += [text[last : node.start_mark.index], instead]
        last = node.end_mark.index
    return "".join([*pieces, text[last:end]])


def _check_transform(node: yaml.Node, what: str, name: str) -> None:
    for key, value in _pairs(node):
        if key == "translation":
            _check_numbers(value, f"{key} of {what}", name)
        if key == "rotation":
            for part, numbers in _pairs(value):
                found = _check_numbers(numbers, f"{part} of {what}", name)
                if part == "axis" and found and math.hypot(*found) < _SHORT:
                    _refuse(name, numbers, f"axis of {what} is shorter than {_SHORT:g}", "write its direction with the length 1")


def _check_numbers(node: yaml.Node, what: str, name: str) -> list[float]:
    found = []
    for scalar in _inside(node):
        if isinstance(scalar, yaml.ScalarNode):
            numbers = decimals(scalar.value, (1,))
            if numbers is None or abs(numbers[0]) > MAGNITUDE:
                message = f"{what} has {scalar.value[:80]!a} in the place of a finite decimal number of at most {MAGNITUDE:g}"
                _refuse(name, scalar, message, "write such numbers, in metres, degrees or radians")
            found += numbers
    return found


def _each(directives: yaml.Node) -> list[tuple[str, yaml.Node]]:
    return [pair for entry in directives.value for pair in _pairs(entry)]


def _pairs(node: yaml.Node) -> list[tuple[str, yaml.Node]]:
    if not isinstance(node, yaml.MappingNode):
        return []
    return [(key.value, value) for key, value in node.value if isinstance(key, yaml.ScalarNode)]


def _inside(root: yaml.Node) -> Iterator[yaml.Node]:
    """Yields a node and all nodes in it."""
    yield root
    if isinstance(root, yaml.MappingNode):
        for pair in root.value:
            for part in pair:
                yield from _inside(part)
    elif isinstance(root, yaml.SequenceNode):
        for part in root.value:
            yield from _inside(part)


def _refuse(name: str, node: yaml.Node, what: str, hint: str) -> NoReturn:
    raise SceneError("scene_field", f"{name}:{node.start_mark.line + 1}: {what}", field="directives", hint=hint)
