"""YAML is composed into nodes here, from the part of YAML that libyaml, which reads it here, and yaml-cpp, which Drake has, read alike."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from certifier.errors import SceneError

MAX_DEPTH = 50
MEND = "mend the YAML there; docs/scenes.md shows a scene file"
TAGS = ("!Rpy", "!AngleAxis", "!Identity")
"""These tags of Drake's say how a rotation is written."""
_BREAKS = re.compile("\r(?!\n)|[\x85\u2028\u2029]")
_MARK = "\ufeff"
"""A byte order mark. After the first character, it is a letter for some readers and nothing for others."""
_LINES = re.compile("\r\n|[\r\n\x85\u2028\u2029]")


class Loader(yaml.CSafeLoader):
    """This is YAML's safe loader on libyaml, which here also reads ``1e-3`` as a number. PyYAML's own takes ten times as long."""


Loader.yaml_implicit_resolvers = {k: list(v) for k, v in yaml.SafeLoader.yaml_implicit_resolvers.items()}
Loader.add_implicit_resolver("tag:yaml.org,2002:float", re.compile(r"^[-+]?[0-9][0-9]*(\.[0-9]*)?[eE][-+]?[0-9]+$"), list("-+0123456789"))


def decoded(data: bytes, name: str) -> str:
    """Returns the text of a YAML file, with its line breaks as they are.

    Raises:
        SceneError: ``scene_yaml``.
    """
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise SceneError("scene_yaml", f"{name}: byte {error.start} is not UTF-8 text", hint="save the file as UTF-8") from None


def read_yaml(path: Path, name: str) -> str:
    """Returns the text of a YAML file.

    Raises:
        SceneError: ``scene_yaml``.
    """
    try:
        return decoded(path.read_bytes(), name)
    except OSError:
        raise SceneError("scene_yaml", f"{name} cannot be read", field="directives", hint="is it a file, and may you read it?") from None


def compose(text: str, name: str) -> yaml.Node | None:
    """Returns the YAML nodes of a stranger's text, which may be no deeper than a scene needs.

    Raises:
        SceneError: ``scene_yaml``, with the line: also for anchors, aliases, merge keys, tags other than ``TAGS``, line breaks other
            than LF and CRLF, and byte order marks that are not at the beginning.
    """
    if (found := _BREAKS.search(text)) is not None:
        where = f"{name}, line {_line(text, found.start())}"
        message = f"{where}: the character U+{ord(found[0]):04X} ends a line for some readers and not for others"
        raise SceneError("scene_yaml", message, hint="end lines by LF or CRLF")
    if (place := text.find(_MARK, 1)) > 0:
        message = f"{name}, line {_line(text, place)}: a byte order mark (U+FEFF) may only be the first character"
        raise SceneError("scene_yaml", message, hint="remove it; it is there where files were put together")
    try:
        depth = 0
        for event in yaml.parse(text, Loader=Loader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.NodeEvent):
                _check(event, name)
            if depth > MAX_DEPTH:
                raise SceneError("scene_yaml", f"{name} may be nested at most {MAX_DEPTH} levels deep")
        root = yaml.compose(text, Loader=Loader)
    except yaml.MarkedYAMLError as error:
        where = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise SceneError("scene_yaml", f"{name}{where}: {error.problem}", hint=MEND) from None
    except yaml.YAMLError as error:
        raise SceneError("scene_yaml", f"{name} is not YAML: {str(error).splitlines()[0]}", hint=MEND) from None
    _check_merges(root, name)
    return root


def _line(text: str, place: int) -> int:
    return len(_LINES.findall(text, 0, place)) + 1


def _check(event: yaml.NodeEvent, name: str) -> None:
    where = f"{name}, line {event.start_mark.line + 1}" if event.start_mark else name
    if event.anchor is not None:
        message = f"{where}: the anchor or alias {event.anchor[:80]!a} is refused"
        raise SceneError("scene_yaml", message, hint="write out what it stands for")
    tag = event.tag if isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent) else None
    if tag is not None and tag not in TAGS:
        hint = f"remove it, and write values as they are; known tags: {', '.join(TAGS)}"
        raise SceneError("scene_yaml", f"{where}: the tag {tag[:80]!a} is refused", hint=hint)


def _check_merges(root: yaml.Node | None, name: str) -> None:
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                if key.value == "<<":
                    message = f"{name}, line {key.start_mark.line + 1}: the merge key << is refused"
                    raise SceneError("scene_yaml", message, hint="write out the keys that it brings in")
                waiting += [key, value]
        elif isinstance(node, yaml.SequenceNode):
            waiting += node.value
