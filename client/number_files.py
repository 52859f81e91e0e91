"""Files of numbers in JSON and YAML are read here: paths, polytopes and seeds."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import yaml

from certifier.scene.nodes import Loader

LARGEST = 2**28
"""No file of numbers is read that has more bytes than this."""
UNREADABLE = (OSError, ValueError, TypeError, EOFError, yaml.YAMLError, RecursionError)
"""What reading a wrong file may raise."""


class NotNumbers(ValueError):
    """Says which part of a file is no number, and what is there."""


def text_of(path: str | Path) -> str:
    """Returns the text of a file.

    Raises:
        NotNumbers: it is too long.
        OSError, UnicodeDecodeError: it cannot be read.
    """
    with open(path, "rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise NotNumbers(f"it has more than {LARGEST} bytes")
    return data.decode("utf-8")


def document_of(path: str | Path) -> dict[str, Any]:
    """Returns the mapping in a file, JSON or YAML by its suffix.

    Raises:
        ValueError, yaml.YAMLError, RecursionError: it is not JSON or YAML.
        NotNumbers: it holds no mapping, or is too long.
        OSError: it cannot be read.
    """
    text = text_of(path)
    document: Any = json.loads(text) if str(path).lower().endswith(".json") else yaml.load(text, Loader)
    if not isinstance(document, dict):
        raise NotNumbers("it must be a mapping, such as q: [[0, 0.3], [0.5, 0.2]]")
    return document


def checked(value: Any, place: str) -> Any:
    """Returns a number, or lists of numbers in each other, as they are. Texts and truth values are no numbers.

    Raises:
        NotNumbers: naming the place.
    """
    if isinstance(value, list):
        for i, one in enumerate(value):
            checked(one, f"{place}[{i}]")
    elif isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise NotNumbers(f"{place} must be a finite number, not {str(value)[:100]!r}")
    return value
