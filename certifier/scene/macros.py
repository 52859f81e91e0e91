"""Models that are written in xacro are found here, and expanded in a child process (:mod:`.expansion`)."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any
from xml.parsers import expat

from certifier.errors import SceneError, close_matches
from certifier.isolation.confinement import alone
from certifier.scene.load import read_in_child
from certifier.scene.xml import parse_xml

XACRO = ".xacro"
EXPANDED = " (expanded)"
"""This stands behind the name of a file where its expansion is meant."""
_NAMESPACE = "xmlns:xacro"
_FIND = re.compile(r"\$\(find\s+([\w.-]+)\s*\)")
_INCLUDE = re.compile(r"<xacro:include\s[^>]*filename\s*=\s*[\"']([^\"']+)")
_MAX_BYTES = 2**24
EXPAND = "certifier.scene.expansion:expand"
TIMEOUT_S, MEMORY_BYTES = 30.0, 2**30
Argument = str | int | float | bool


def in_xacro(path: Path, name: str) -> bool:
    """Says whether a model file has to be expanded: it declares the namespace of xacro, and uses it.

    Raises:
        SceneError: ``scene_model`` for XML that is broken.
    """
    data = path.read_bytes() if path.suffix.lower() in (".urdf", ".sdf", XACRO) else b""
    if _NAMESPACE.encode() not in data:
        return False
    declared, used, around = False, False, list[str]()

    def start(element: str, attributes: dict[str, str]) -> None:
        nonlocal declared, used
        declared = declared or _NAMESPACE in attributes
        used = used or element.startswith("xacro:") or any(key.startswith("xacro:") for key in attributes)
        used = used or ("gazebo" not in around and any("${" in value or "$(" in value for value in attributes.values()))
        around.append(element)

    def install(parser: expat.XMLParserType) -> None:
        parser.StartElementHandler, parser.EndElementHandler = start, lambda _: around.pop()

    parse_xml(data, name, "scene_model", install)
    return declared and used


def root_of(data: bytes, name: str) -> str:
    """Returns the name of the root of a model file.

    Raises:
        SceneError: ``scene_model`` for XML that is broken.
    """
    found: list[str] = []

    def install(parser: expat.XMLParserType) -> None:
        parser.StartElementHandler = lambda element, _: found.append(element)

    parse_xml(data, name, "scene_model", install)
    return found[0]


def packages_named(path: Path, find: Callable[[str], Path | None]) -> dict[str, Path]:
    """Returns the packages that a file names by $(find), also in files that it includes, as far as ``find`` knows them."""
    found: dict[str, Path] = {}
    waiting = [path]
    for file in waiting:
        text = file.read_bytes().decode(errors="replace")
        for name in _FIND.findall(text):
            if name not in found and (root := find(name)) is not None:
                found[name] = root
        for spec in _INCLUDE.findall(text):
            included = file.parent / _FIND.sub(lambda name: str(found.get(name[1], name[0])), spec)
            if included.is_file() and included not in waiting:
                waiting.append(included)
    return found


def request(path: Path, root: Path, packages: Mapping[str, Path], arguments: Mapping[str, Argument]) -> dict[str, Any]:
    """Returns what :func:`certifier.scene.expansion.expand` is asked about a model.

    Args:
        root: directory of the scene file.
    """
    return {
        "path": str(path),
        "root": str(root),
        "packages": {package: str(place) for package, place in packages.items()},
        "arguments": {key: _written(value) for key, value in arguments.items()},
        "bytes": _MAX_BYTES,
    }


def check_declared(arguments: Mapping[str, Argument], declared: Collection[str]) -> None:
    """Checks that some file declares each argument.

    Raises:
        SceneError: ``scene_xacro``.
    """
    for name in arguments:
        if name not in declared:
            known = sorted(declared)
            hint = close_matches(name, known) or f"arguments of the models: {', '.join(known) or 'none'}"
            raise SceneError("scene_xacro", f"no model has an argument {name[:80]!a}", field=f"xacro.{name}", hint=hint)


class Expander:
    """Expands the models of one scene, each once."""

    def __init__(self, root: Path, packages: Mapping[str, Path], arguments: Mapping[str, Argument]) -> None:
        """Takes the directory of the scene file, and its packages and arguments."""
        self._root, self._packages, self._arguments = root, packages, arguments
        self._texts: dict[Path, bytes] = {}
        self._declared: set[str] = set()

    def expanded(self, path: Path, name: str) -> bytes:
        """Returns what a file that is in xacro expands to.

        Args:
            name: the file's name for people.

        Raises:
            SceneError: ``scene_xacro`` for what xacro refuses; ``scene_model_crash`` if expanding takes too long or too much memory;
                ``bundle_file`` in a process that may start no other: what xacro evaluates would run in it.
        """
        if alone():
            message = f"{name} is written in xacro, and only models that the scene file names are expanded"
            raise SceneError("bundle_file", message, hint="make the bundle with `ciris scene add`, which expands all of them")
        if path not in self._texts:
            payload = request(path, self._root, self._packages, self._arguments)
            found = read_in_child(EXPAND, payload, name, TIMEOUT_S, MEMORY_BYTES)
            self._texts[path] = found["text"].encode()
            self._declared |= {*found["declared"]}
        return self._texts[path]

    def check_arguments(self) -> None:
        """Checks that some file declares each argument.

        Raises:
            SceneError: ``scene_xacro``.
        """
        check_declared(self._arguments, self._declared)


def _written(value: Argument) -> str:
    """Returns an argument as xacro takes it on its command line."""
    return str(value).lower() if isinstance(value, bool) else str(value)
