"""This module turns what users type into numbers and names."""

from __future__ import annotations

import math
from collections.abc import Sequence

from certifier.configurations import is_number
from certifier.errors import CirisError, RegionError

_LIST = "joint positions, separated by commas"

Given = list[float] | str
"""Joint positions, or names of configurations, which the scene turns into positions."""


def configuration(text: str, field: str = "--q") -> Given:
    """Returns the numbers of a text such as ``"0, 0.3, -1.8"`` or ``"[0, 0.3]"``; or the text itself where no part begins with a number.

    Raises:
        RegionError: bad_number, naming the place.
    """
    inside = text.strip()
    inside = inside[1:-1] if inside.startswith("[") and inside.endswith("]") else inside
    begins = [part.split()[0] for part in inside.split(",") if part.strip()]
    return numbers(inside, field) if not begins or any(map(is_number, begins)) else text.strip()


def shown(given: Given) -> str:
    """Returns a configuration for people, as it was given."""
    return given if isinstance(given, str) else ", ".join(f"{value:g}" for value in given)


def numbers(text: str, field: str) -> list[float]:
    """Returns the numbers of a text such as ``"0, 0.3, -1.8"``.

    Raises:
        RegionError: bad_number, naming the place.
    """
    values = []
    for i, part in enumerate(text.replace(",", " ").split()):
        if not is_number(part) or not math.isfinite(float(part)):
            raise RegionError("bad_number", f"{part[:100]!r} is not a finite number", field=f"{field}[{i}]", hint=_LIST)
        values.append(float(part))
    if not values:
        raise RegionError("bad_number", "no numbers were given", field=field, hint=_LIST)
    return values


def is_scene_file(scene: str) -> bool:
    """Says whether the user means a file, and not a name or id that the service knows."""
    return scene.endswith((".yaml", ".yml")) or "/" in scene


def labels(given: Sequence[str]) -> dict[str, str]:
    """Returns the labels of options ``NAME=VALUE``.

    Raises:
        CirisError: bad_option.
    """
    found = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not name or not equals:
            raise CirisError("bad_option", f"must be NAME=VALUE, not {text!r}", field="--label")
        found[name] = value
    return found
