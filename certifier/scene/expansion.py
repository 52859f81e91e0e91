"""The child process that runs xacro expands one file here. What xacro evaluates is Python, so the process may do next to nothing.

From the moment when xacro begins, an audit hook refuses everything but reading files of the scene. Nothing can take it off again: the
process ends with the expansion.
"""

from __future__ import annotations

import os
import sys
import xml.dom.expatbuilder
import xml.sax.saxutils  # noqa: F401
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

import numpy as np  # noqa: F401 - the answer needs it
import xacro
import xacro.substitution_args
import yaml  # noqa: F401 - xacro.load_yaml needs it

from certifier.errors import SceneError, close_matches

_HARMLESS = frozenset(["compile", "exec", "object.__getattr__", "object.__setattr__", "object.__delattr__", "code.__new__", "builtins.id"])
_READING = frozenset(["open", "os.listdir", "os.scandir", "glob.glob", "glob.glob/2"])
_MEND = "mend the model there"


class _Arguments(dict[str, str]):
    """The arguments that are given, and the names of those that files declare."""

    def __init__(self, given: dict[str, str]) -> None:
        super().__init__(given)
        self.declared: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.declared.add(str(name))
        return super().__contains__(name)


def expand(payload: dict[str, Any]) -> dict[str, Any]:
    """Returns the ``text`` that a file expands to, and the names of the arguments that are ``declared``.

    References below a package become package:// URIs, and others become relative to the file.

    Args:
        payload: ``path`` of the file, ``root`` directory of the scene file, ``packages``, ``arguments``, and ``bytes``, the longest text.

    Raises:
        SceneError: ``scene_xacro``.
    """
    path, root = Path(payload["path"]), payload["root"]
    packages = {name: os.path.abspath(package) for name, package in payload["packages"].items()}
    arguments = _Arguments(payload["arguments"])
    _replace_lookups(packages)
    _confine([os.path.realpath(directory) for directory in (root, *packages.values())])
    try:
        document = xacro.process_file(str(path), mappings=arguments)
        for node in _inside(document):
            _relocate(node, path.parent, packages)
        text = '<?xml version="1.0"?>\n' + document.documentElement.toprettyxml(indent="  ")
    except SceneError:
        raise
    except expat.ExpatError as error:
        _refuse(root, f"line {error.lineno}: this is not XML: {expat.ErrorString(error.code)}", "mend the file there")
    except RecursionError:
        _refuse(root, "macros or files include themselves", "remove the circle")
    except MemoryError:
        raise
    except Exception as error:
        hint = next((found.hint for found in _causes(error) if isinstance(found, SceneError)), _MEND)
        _refuse(root, " ".join(str(error).split()), hint)
    if len(text) > payload["bytes"]:
        _refuse(root, f"the expansion has {len(text)} characters; at most {payload['bytes']} are read", "expand less")
    return {"text": text, "declared": sorted(arguments.declared)}


def _replace_lookups(packages: dict[str, str]) -> None:
    """Has xacro look for packages in the scene file alone, and for nothing in the environment."""

    def find(name: str) -> str:
        if name not in packages:
            hint = close_matches(name, list(packages)) or f"name its directory under packages in the scene file: {{{name[:80]}: DIRECTORY}}"
            raise SceneError("scene_xacro", f"the package {name[:80]!a} is not known", field="packages", hint=hint)
        return packages[name]

    def environment(name: str, *_: object, **__: object) -> NoReturn:
        hint = "write an argument, <xacro:arg>, and its value under xacro in the scene file"
        raise SceneError("scene_xacro", f"the environment variable {name[:80]!a} is not read", field="directives", hint=hint)

    lookups = xacro.substitution_args
    lookups._eval_find, lookups._eval_env, lookups._eval_optenv = find, environment, environment
    lookups._eval_dict.update(find=find, env=environment, optenv=environment)


def _confine(roots: list[str]) -> None:
    """Refuses from now on whatever this process does but reading what is below the roots, which have no symbolic links."""
    below = tuple(f"{root.rstrip('/')}/" for root in roots)
    realpath, writing = os.path.realpath, os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event in _HARMLESS:
            return
        if event == "open" and isinstance(arguments[0], int):
            return
        if event in _READING and isinstance(arguments[0], str):
            reads = event != "open" or not (arguments[2] or 0) & writing
            if reads and f"{realpath(arguments[0])}/".startswith(below):
                return
            message = f"the file {arguments[0][-200:]!a} is not below the scene file or one of its packages"
            hint = "name a directory above it under packages in the scene file"
            raise SceneError("scene_xacro", message, field="directives", hint=hint)
        raise SceneError("scene_xacro", f"an expression does what no model needs ({event})", field="directives", hint="take it out")

    sys.addaudithook(hook)


def _inside(document: Any) -> list[Any]:
    found = [document.documentElement]
    for node in found:
        found += node.childNodes
    return found


def _relocate(node: Any, directory: Path, packages: dict[str, str]) -> None:
    """Makes references that are absolute package:// URIs, or relative to the directory of the model."""
    for attribute in list((node.attributes or {}).values()):
        attribute.value = _relocated(attribute.value, directory, packages)
    if node.nodeType == node.TEXT_NODE:
        node.data = _relocated(node.data, directory, packages)


def _relocated(text: str, directory: Path, packages: dict[str, str]) -> str:
    path = text.strip().removeprefix("file://")
    if not path.startswith("/") or "\n" in path:
        return text
    for name, root in packages.items():
        if path.startswith(f"{root}/"):
            return f"package://{name}/{path.removeprefix(root).lstrip('/')}"
    return os.path.relpath(path, directory)


def _causes(error: BaseException) -> list[BaseException]:
    found: list[BaseException] = [error]
    for known in found:
        found += [cause for cause in (known.__cause__, known.__context__, getattr(known, "exc", None)) if cause and cause not in found]
    return found


def _refuse(root: str, what: str, hint: str) -> NoReturn:
    file = str((xacro.filestack or ["the model"])[-1])
    where = os.path.relpath(file, root) if file.startswith("/") else file
    what = what.replace(f"{root}/", "")
    raise SceneError("scene_xacro", f"{where}: xacro: {what[:400]}", field="directives", hint=hint)
