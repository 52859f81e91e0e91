"""This module finds which other files a scene's files refer to, and where those are.

One reader for each kind of file finds the references that Drake would follow. The same readers serve to pack a bundle and to check a bundle
from a stranger.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote
from xml.parsers import expat

import yaml

from certifier.errors import SceneError
from certifier.scene.nodes import MAX_DEPTH, compose, read_yaml
from certifier.scene.paths import beside
from certifier.scene.xml import parse_xml

_ATTRIBUTES = {"file", "filename", "uri", "url"}
_PLUGIN = "plugin"
_GAZEBO = "gazebo"
"""Drake reads nothing in this element of URDF."""
_MJCF = (".xml", ".mjcf")
_XACRO = ".xacro"
MANIFEST = "package.xml"
"""The file of a package of ROS that has its name."""
_DIRECTORIES = {"meshdir", "texturedir", "assetdir"}
_EXPORT = "export the mesh again"
_SCHEME = re.compile(r"^([a-zA-Z][\w+.-]*):(//)?")


def references(path: Path, expanded: bytes | None = None) -> list[str]:
    """Returns the references in one file, as written; a kind of file that refers to nothing has none.

    Args:
        expanded: what a model expands to that is written in xacro.

    Raises:
        SceneError: ``bundle_file`` for a kind of file that has no place in a scene, ``bundle_xml`` for XML that is broken or declares a
            document type, ``bundle_text`` for a text file that is not what its name says.
    """
    try:
        read = _READERS[path.suffix.lower()]
    except KeyError:
        kinds = ", ".join(sorted(_READERS))
        raise SceneError("bundle_file", f"{path.name}: files of this kind are not part of a scene", hint=f"known kinds: {kinds}") from None
    try:
        return read(path) if expanded is None else _xml(path, expanded)
    except UnicodeDecodeError as error:
        raise SceneError("bundle_text", f"{path.name}: byte {error.start} is not UTF-8 text", hint="save the file as UTF-8") from None
    except (json.JSONDecodeError, RecursionError):
        raise SceneError("bundle_text", f"{path.name} is not JSON", hint=_EXPORT) from None


def resolve(reference: str, directory: Path, packages: dict[str, Path]) -> Path:
    """Returns the path that a reference means in a file of ``directory``. Drake, too, takes several slashes for one.

    Raises:
        SceneError: as :func:`certifier.scene.paths.beside`; ``bundle_uri`` for an absolute path, a scheme other than package:// and
            model://, or an unknown package.
    """
    scheme = _SCHEME.match(reference)
    if scheme is None:
        if reference.startswith(("/", "~")) or "\\" in reference or "\0" in reference:
            hint = "name a directory above it under packages, and write package://NAME/FILE"
            raise SceneError("bundle_uri", f"{reference!r} is not a relative path", hint=hint)
        return beside(directory, reference)
    if scheme[1] not in ("package", "model") or not scheme[2]:
        raise SceneError("bundle_uri", f"{reference!r} is no file of the scene", hint="use a relative path or package://NAME/FILE")
    name, _, rest = reference[scheme.end() :].partition("/")
    if name not in packages:
        hint = f"known packages: {', '.join(packages)}" if packages else "name its directory under packages in the scene file"
        raise SceneError("bundle_uri", f"{reference!r} names the unknown package {name!r}", hint=hint)
    return beside(packages[name], rest.lstrip("/"))


def is_read(path: Path) -> bool:
    """Says whether a file is of a kind that Drake reads, by its name. It reads no xacro, and no manifest of a package."""
    return path.suffix.lower() in _READERS and path.suffix.lower() != _XACRO and path.name != MANIFEST


def is_mjcf(path: Path) -> bool:
    """Says whether Drake takes a file for MJCF, by its name."""
    return path.suffix.lower() in _MJCF


def mjcf_references(path: Path, packages: dict[str, Path]) -> list[Path]:
    """Returns the files that an MJCF model refers to, also in files that it includes. Some of them may not exist.

    All paths start at the directory of the model, or at a directory that a <compiler> of the model or of an included file names.

    Raises:
        SceneError: as :func:`references` and :func:`resolve`.
    """
    files, names, directories = [path], [""], ["."]
    for file in files:
        written, below = _written(file, file.read_bytes())
        names += written
        directories += below
        included = [resolve(name, path.parent, packages) for name in written if is_mjcf(Path(name))]
        files += [file for file in dict.fromkeys(included) if file.is_file() and file not in files]
    return [resolve(name, path.parent / directory, packages) for directory in directories for name in names if name]


def _xml(path: Path, data: bytes | None = None) -> list[str]:
    found, directories = _written(path, path.read_bytes() if data is None else data)
    return found + [f"{directory}/{value}" for directory in directories for value in found]


def _written(path: Path, data: bytes) -> tuple[list[str], list[str]]:
    """Returns the references in an XML file, and the directories below which MJCF looks for some of them."""
    found: list[str] = []
    directories: list[str] = []
    stack: list[str] = []
    text: list[str] = []

    def unread() -> bool:
        return _GAZEBO in stack and path.suffix.lower() in (".urdf", _XACRO)

    def start(name: str, attributes: dict[str, str]) -> None:
        stack.append(name)
        if len(stack) > MAX_DEPTH:
            raise SceneError("bundle_xml", f"{path.name} may be nested at most {MAX_DEPTH} levels deep")
        text.clear()
        directories.extend(value for key, value in attributes.items() if key in _DIRECTORIES)
        if name != _PLUGIN and not unread():
            found.extend(value for key, value in attributes.items() if key in _ATTRIBUTES)

    def end(name: str) -> None:
        stack.pop()
        if name in _ATTRIBUTES and not unread():
            found.append("".join(text).strip())
        text.clear()

    def install(parser: expat.XMLParserType) -> None:
        parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, text.append

    parse_xml(data, path.name, "bundle_xml", install)
    if any(".." in Path(value).parts for value in directories):
        message = f"{path.name}: .. is not accepted in {', '.join(sorted(_DIRECTORIES))}"
        raise SceneError("bundle_uri", message, hint="keep the files below the directory of the model")
    return [value for value in found if value], directories


def _yaml(path: Path) -> list[str]:
    found: list[str] = []
    waiting = [compose(read_yaml(path, path.name), path.name)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, yaml.MappingNode):
            found += [value.value for key, value in node.value if isinstance(value, yaml.ScalarNode) and str(key.value) in _ATTRIBUTES]
            waiting += [part for item in node.value for part in item]
        elif isinstance(node, yaml.SequenceNode):
            waiting += node.value
    return found


def _obj(path: Path) -> list[str]:
    """Comments of OBJ files may be in any encoding."""
    lines = path.read_bytes().splitlines()
    return [os.fsdecode(name) for line in lines if line.lstrip().startswith(b"mtllib") for name in line.split()[1:]]


def _gltf(path: Path) -> list[str]:
    document = json.loads(path.read_text(encoding="utf-8"))
    try:
        uris = [part["uri"] for key in ("buffers", "images") for part in document.get(key, []) if "uri" in part]
        written = [uri for uri in uris if not uri.startswith("data:")]
        return list(dict.fromkeys([*written, *map(unquote, written)]))
    except (AttributeError, TypeError):
        raise SceneError("bundle_text", f"{path.name} is not glTF", hint=_EXPORT) from None


def _nothing(_: Path) -> list[str]:
    return []


_READERS: dict[str, Callable[[Path], list[str]]] = {
    **dict.fromkeys((".urdf", ".sdf", _XACRO, *_MJCF), _xml),
    **dict.fromkeys((".yaml", ".yml"), _yaml),
    ".obj": _obj,
    ".gltf": _gltf,
    **dict.fromkeys((".srdf", ".vtk", ".bin", ".mtl", ".stl", ".dae", ".glb", ".png", ".jpg", ".jpeg"), _nothing),
}
