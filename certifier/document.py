"""JSON from strangers is read strictly here: every value is of its type and in its place, or an error says which is not.

Python's reader takes NaN, infinities, keys that occur twice and any depth. NumPy takes text and truth values for numbers. This module
refuses them, so that a document means one thing to every reader.
"""

from __future__ import annotations

import json
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from certifier.errors import CirisError

LARGEST = 1e100
"""Larger numbers stand for nothing real; sums and products of a few numbers up to this one do not overflow."""
MAX_NESTING = 16
"""A value of free form has at most this many levels of lists and objects."""
_SHOWN = 60


def parse(data: bytes, where: str) -> Any:
    """Returns the document in a JSON text; ``where`` names the text in errors.

    Raises:
        CirisError: document, when this is not JSON in UTF-8, or holds NaN, an infinity or a key twice, or is nested too deeply.
    """
    try:
        return json.loads(data.decode(), object_pairs_hook=_unique, parse_constant=_constant)
    except RecursionError:
        raise CirisError("document", "it is nested too deeply", field=where) from None
    except ValueError as error:
        raise CirisError("document", f"it is not JSON: {error}", field=where) from None


def _unique(members: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(members)
    if len(found) < len(members):
        raise ValueError("a key occurs twice in an object")
    return found


def _constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


class Node:
    """A node is a value of a document, with the place where it stands, as in ``joints[2].axis``.

    Every method raises CirisError, document, with the place as its field, when the value is not what the method reads.
    """

    def __init__(self, value: Any, where: str = "") -> None:
        self.value, self.where = value, where

    def fields(self, *names: str, optional: tuple[str, ...] = ()) -> dict[str, Node]:
        """Returns the members of an object that has all of these names, perhaps the optional ones, and no other."""
        if not isinstance(self.value, dict):
            self.refuse("an object")
        for name in names:
            if name not in self.value:
                raise CirisError("document", f"{name} is missing", field=self.where or None)
        unknown = next((name for name in self.value if name not in names and name not in optional), None)
        if unknown is not None:
            raise CirisError("document", f"{_shown(unknown)} has no meaning here", field=self.where or None)
        return {name: Node(value, f"{self.where}.{name}".lstrip(".")) for name, value in self.value.items()}

    def members(self) -> dict[str, Node]:
        """Returns the members of an object, whatever their names are."""
        if not isinstance(self.value, dict):
            self.refuse("an object")
        return {name: Node(value, f"{self.where}.{name}".lstrip(".")) for name, value in self.value.items()}

    def items(self, most: int | None = None) -> list[Node]:
        """Returns the items of a list that has at most ``most`` of them."""
        if not isinstance(self.value, list):
            self.refuse("a list")
        if most is not None and len(self.value) > most:
            raise CirisError("document", f"there are {len(self.value)} of them, at most {most} are read", field=self.where or None)
        return [Node(value, f"{self.where}[{i}]") for i, value in enumerate(self.value)]

    def two(self) -> tuple[Node, Node]:
        """Returns the items of a list of two."""
        if not isinstance(self.value, list) or len(self.value) != 2:
            self.refuse("a list of two")
        first, second = self.items()
        return first, second

    def text(self) -> str:
        if not isinstance(self.value, str):
            self.refuse("a text")
        return str(self.value)

    def count(self) -> int:
        """Returns a whole number that is not negative."""
        if type(self.value) is not int or not 0 <= self.value <= LARGEST:
            self.refuse("a whole number from 0")
        return int(self.value)

    def number(self) -> float:
        """Returns a number that a double holds exactly, at most LARGEST in magnitude, as the integer or the float that it is."""
        if not _is_number(self.value):
            self.refuse(f"a number of at most {LARGEST:g} that a double holds")
        number: float = self.value
        return number

    def array(self, *shape: int | None) -> NDArray[np.float64]:
        """Returns nested lists of numbers as an array of this shape; a first length of None stands for any."""
        _check_array(self.value, shape, self.where)
        return np.array(self.value, dtype=float).reshape(-1 if shape[0] is None else shape[0], *shape[1:])

    def free(self) -> dict[str, Any]:
        """Returns an object of free form, whose numbers are finite and which is nested at most MAX_NESTING deep."""
        if not isinstance(self.value, dict):
            self.refuse("an object")
        level: list[Any] = [self.value]
        for _ in range(MAX_NESTING):
            if any(isinstance(x, float) and not abs(x) < float("inf") for x in level):
                raise CirisError("document", "it holds a number that is not finite", field=self.where or None)
            level = [x for node in level for x in (node.values() if isinstance(node, dict) else node if isinstance(node, list) else ())]
            if not level:
                return dict(self.value)
        raise CirisError("document", f"it is nested more than {MAX_NESTING} levels deep", field=self.where or None)

    def refuse(self, expected: str) -> NoReturn:
        raise CirisError("document", f"{_shown(self.value)} is not {expected}", field=self.where or None)


def _is_number(x: Any) -> bool:
    return (isinstance(x, float) or type(x) is int) and abs(x) <= LARGEST and float(x) == x


def _check_array(value: Any, shape: tuple[int | None, ...], where: str) -> None:
    if not shape:
        if not _is_number(value):
            Node(value, where).number()
    elif not isinstance(value, list) or shape[0] not in (None, len(value)):
        Node(value, where).refuse("a list of numbers" if shape[0] is None else f"a list of {shape[0]}")
    elif len(shape) > 1 or not all(map(_is_number, value)):
        for i, item in enumerate(value):
            _check_array(item, shape[1:], f"{where}[{i}]")


def _shown(value: Any) -> str:
    """Returns the beginning of a value, for people."""
    if isinstance(value, (dict, list)):
        return "an object" if isinstance(value, dict) else "a list"
    text = repr(value[: _SHOWN + 1] if isinstance(value, str) else value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]} ..."
