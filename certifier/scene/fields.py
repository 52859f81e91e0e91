"""Values of a scene file are checked here, each with its place in the file; errors name it.

All functions raise SceneError ``scene_field`` for what is wrong.
"""

from __future__ import annotations

import math
from typing import Any

import yaml

from certifier.errors import SceneError, close_matches
from certifier.names import ALPHABET, MAX_SENTENCE, is_name, is_sentence
from certifier.positions import MAGNITUDE
from certifier.scene.nodes import MEND


def construct(node: yaml.Node, where: str) -> Any:
    """Returns what a node is in Python."""
    check_unique(node, where)
    try:
        return yaml.constructor.SafeConstructor().construct_document(node)
    except (yaml.YAMLError, ValueError) as error:
        problem = error.problem if isinstance(error, yaml.MarkedYAMLError) else str(error)
        raise wrong(where, f"line {node.start_mark.line + 1}: {problem}", hint=MEND) from None


def check_unique(node: yaml.Node, where: str) -> None:
    """Refuses a key that a mapping has twice: YAML's reader would take the last one without a word."""
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise wrong(where, f"line {key.start_mark.line + 1}: a key must be text")
            place = f"{where}.{key.value}"
            if key.value in seen:
                raise twice(place, key)
            seen.add(key.value)
            check_unique(value, place)
    elif isinstance(node, yaml.SequenceNode):
        for i, value in enumerate(node.value):
            check_unique(value, f"{where}[{i}]")


def twice(where: str, key: yaml.Node) -> SceneError:
    """Returns the error of a key that is given again."""
    return wrong(where, f"is given twice, again in line {key.start_mark.line + 1}", hint="leave one of them out")


def wrong(where: str, message: str, hint: str = "") -> SceneError:
    """Returns the error of a field, by its path in the file; empty for the file itself."""
    return SceneError("scene_field", message, field=where or None, hint=hint)


def check_known(found: dict[str, Any], where: str, known: tuple[str, ...]) -> None:
    """Refuses keys that are not known."""
    for key in found:
        if key not in known:
            hint = close_matches(str(key), list(known)) or f"known keys: {', '.join(known)}"
            raise wrong(f"{where}.{key}" if where else str(key), "is not a key of a scene file", hint=hint)


def section(value: Any, where: str, known: tuple[str, ...]) -> dict[str, Any]:
    """Returns a mapping whose keys are known."""
    if not isinstance(value, dict):
        raise wrong(where, f"must be a mapping with the keys {', '.join(known)}")
    check_known(value, where, known)
    return value


def string(value: Any, where: str) -> str:
    """Returns printable text."""
    if not isinstance(value, str) or not value or not value.isprintable():
        raise wrong(where, f"must be printable text, not {value!r}")
    return value


def name(value: Any, where: str) -> str:
    """Returns a name."""
    if not is_name(value):
        raise wrong(where, f"must be a name, not {value!a}", hint=f"names have {ALPHABET}")
    return str(value)


def sentence(value: Any, where: str) -> str:
    """Returns a line of text for people."""
    if not value or not is_sentence(value):
        raise wrong(where, f"must be one line of at most {MAX_SENTENCE} printable characters, not {value!a}")
    return str(value)


def number(value: Any, where: str, minimum: float = -math.inf) -> float:
    """Returns a number as a float."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= MAGNITUDE:
        raise wrong(where, f"must be a number of at most {MAGNITUDE:g}, not {value!r}")
    if value < minimum:
        raise wrong(where, f"must be at least {minimum:g}, not {value!r}")
    return float(value)


def integer(value: Any, where: str, minimum: int, maximum: int) -> int:
    """Returns a whole number within bounds."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise wrong(where, f"must be a whole number, not {value!r}")
    if value > maximum:
        raise wrong(where, f"must be at most {maximum}, not {value}")
    return int(number(value, where, minimum))
