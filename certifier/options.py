"""An option is written once: as the field of a dataclass, with its type, its default, its bounds and its text.

:func:`read` checks a document of options. Everything else that lists options is made from :func:`table`: the requests of the API, the
arguments of the command, the types of the Python client, the form of the page and the docs.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum, StrEnum
from functools import cache
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from certifier.errors import RegionError, close_matches

Options = TypeVar("Options")
_KEY = "option"
PATH = 3
"""The numbers of paths are so deep: a list of paths has waypoints, which have numbers."""


class Takes(StrEnum):
    """Says what values an option takes."""

    WHOLE = "whole"
    """A whole number."""
    REAL = "real"
    """A finite number."""
    FLAG = "flag"
    """True or false."""
    CHOICE = "choice"
    """One of a few texts."""
    POINT = "point"
    """A list of numbers, such as one for each joint."""
    POINTS = "points"
    """A list of points."""
    PATHS = "paths"
    """A list of lists of points."""
    LABELS = "labels"
    """Texts by name."""
    GROUP = "group"
    """Options of their own, by name."""


@dataclass(frozen=True)
class Option:
    """Describes an option.

    Attributes:
        name: of the field, and in documents and requests.
        argument: of the command, without ``--``.
        python: the name in the Python client. It is the argument with ``_`` for ``-``, but that of the field for what is typed once for
            each item.
        text: what it means, in sentences.
        otherwise: what holds where nothing is given, in words; "" where the default says it.
        default: the value where nothing is given.
        optional: whether None may be given; it stands for ``otherwise``.
        least, greatest: bounds that the number may reach; None for none.
        above, below: bounds that the number may not reach; None for none.
        unit: of the number; "" where it has none.
        choices: the texts of a choice.
        cls: the dataclass of a group, or the enumeration of a choice that has one.
        most: largest number of items of points or paths; None for any.
        positions: whether points and paths are joint positions, in the place of which configurations may be named.
    """

    name: str
    takes: Takes
    text: str
    default: Any
    optional: bool
    argument: str
    python: str
    otherwise: str = ""
    least: float | None = None
    greatest: float | None = None
    above: float | None = None
    below: float | None = None
    unit: str = ""
    choices: tuple[str, ...] = ()
    cls: type | None = None
    most: int | None = None
    positions: bool = True

    @property
    def described(self) -> str:
        """Returns the text with what holds where nothing is given."""
        return f"{self.text} Default: {self.otherwise}." if self.otherwise else self.text

    @property
    def explained(self) -> str:
        """Returns the same with the default where it is a value."""
        valued = self.takes in (Takes.WHOLE, Takes.REAL, Takes.CHOICE) and self.default is not None and not self.otherwise
        return f"{self.text} Default: {self.default}." if valued else self.described


def option(default: Any, text: str, **more: Any) -> Any:
    """Returns the field of a dataclass that is an option.

    Args:
        text: what it means, in sentences.
        more: attributes of :class:`Option` that do not follow from the field.
    """
    given: dict[str, Any] = {"default_factory": lambda: {**default}} if isinstance(default, dict) else {"default": default}
    return field(**given, metadata={_KEY: {"text": text, **more}})


@cache
def table(cls: type) -> tuple[Option, ...]:
    """Returns the options of a dataclass, in order. Fields that :func:`option` did not make are left out."""
    hints = get_type_hints(cls)
    return tuple(_of_field(f, hints[f.name]) for f in fields(cls) if _KEY in f.metadata)


def _of_field(f: dataclasses.Field[Any], hint: Any) -> Option:
    members = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    (kept,) = (member for member in members if member is not type(None))
    takes, choices = _takes(kept)
    said = {"argument": f.name.replace("_", "-"), "choices": choices, "cls": kept if isinstance(kept, type) else None, **f.metadata[_KEY]}
    default = {} if f.default is dataclasses.MISSING else f.default
    repeated = takes in (Takes.POINTS, Takes.PATHS, Takes.LABELS)
    said.setdefault("python", f.name if repeated else said["argument"].replace("-", "_"))
    return Option(name=f.name, takes=takes, default=default, optional=type(None) in members, **said)


def _takes(hint: Any) -> tuple[Takes, tuple[str, ...]]:
    if get_origin(hint) is Literal:
        return Takes.CHOICE, get_args(hint)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return Takes.CHOICE, tuple(str(member.value) for member in hint)
    if dataclasses.is_dataclass(hint):
        return Takes.GROUP, ()
    number = tuple[float, ...]
    lists: dict[Any, Takes] = {number: Takes.POINT, tuple[number, ...]: Takes.POINTS, tuple[tuple[number, ...], ...]: Takes.PATHS}
    return {int: Takes.WHOLE, float: Takes.REAL, bool: Takes.FLAG, dict[str, str]: Takes.LABELS, **lists}[hint], ()


def read(cls: type[Options], document: Mapping[str, Any], place: str) -> Options:
    """Returns the options of a document. None stands for the default, as far as the type allows no None.

    Args:
        place: where the document stands, which the fields of errors begin with, as in ``options.cells``; "" for a request itself.

    Raises:
        RegionError: ``unknown_option``, ``option_value``; the error names the option.
    """
    known, described = [f.name for f in fields(cls)], {one.name: one for one in table(cls)}  # type: ignore[arg-type]
    for name in document:
        if name not in known:
            found = in_group(cls, name)
            hint = f"give {_within(place, found)}" if found else close_matches(name, known) or f"options: {', '.join(sorted(described))}"
            raise RegionError("unknown_option", f"there is no option {name!r}", field=_within(place, name), hint=hint)
    given = {}
    for name, value in document.items():
        one = described.get(name)
        if value is None and one is not None:
            continue
        given[name] = value if one is None else _value(one, value, _within(place, name))
    return cls(**given)


def _within(place: str, name: str) -> str:
    return f"{place}.{name}".removeprefix(".")


def in_group(cls: type, name: str) -> str:
    """Returns the path of an option that a group of the dataclass has, as in ``group.name``; "" where none has it."""
    groups = [one for one in table(cls) if one.takes is Takes.GROUP and one.cls is not None]
    return next((f"{one.name}.{name}" for one in groups if name in [inner.name for inner in table(one.cls)]), "")


def _value(one: Option, value: Any, where: str) -> Any:
    match one.takes:
        case Takes.GROUP:
            if not isinstance(value, Mapping):
                raise _refused(one, where, "an object of options")
            assert one.cls is not None
            return read(one.cls, value, where)
        case Takes.WHOLE | Takes.REAL if not fits(one, value):
            raise _refused(one, where, within(one))
        case Takes.FLAG if not isinstance(value, bool):
            raise _refused(one, where, "true or false")
        case Takes.LABELS if not isinstance(value, Mapping):
            raise _refused(one, where, "an object of texts")
        case Takes.CHOICE if value not in one.choices:
            raise _refused(one, where, f"one of {', '.join(one.choices)}")
        case Takes.CHOICE:
            return value if one.cls is None else one.cls(value)
        case Takes.POINT | Takes.POINTS | Takes.PATHS:
            return _numbers(value, where, {Takes.POINT: 1, Takes.POINTS: 2, Takes.PATHS: PATH}[one.takes], one.most)
    return value


def fits(one: Option, value: Any) -> bool:
    """Returns whether a value is a number that an option takes."""
    right = isinstance(value, int) if one.takes is Takes.WHOLE else isinstance(value, int | float) and math.isfinite(value)
    return (
        right
        and not isinstance(value, bool)
        and (one.least is None or one.least <= value)
        and (one.greatest is None or value <= one.greatest)
        and (one.above is None or one.above < value)
        and (one.below is None or value < one.below)
    )


def within(one: Option) -> str:
    """Returns in words which numbers an option takes."""
    what = "an integer" if one.takes is Takes.WHOLE else "a number"
    if one.least is not None and one.greatest is not None:
        return f"{what} from {one.least} to {one.greatest}"
    above = [] if one.above is None else [f"above {one.above:.10g}"]
    upper = [] if one.greatest is None else [f"at most {one.greatest:.10g}"]
    below = [] if one.below is None else [f"below {one.below:.10g}"]
    return " ".join([what, " and ".join([*above, *upper, *below])]).strip()


def _numbers(value: Any, where: str, depth: int, most: int | None) -> Any:
    if not isinstance(value, list | tuple):
        raise RegionError("option_value", f"{where.rpartition('.')[2]} must be a list{' of numbers' if depth == 1 else ''}", field=where)
    if most is not None and len(value) > most:
        raise RegionError("option_value", f"{where.rpartition('.')[2]} must have at most {most} items", field=where)
    for i, path in enumerate(value if depth == PATH else ()):
        if not isinstance(path, list | tuple) or len(path) < 2:
            raise RegionError("option_value", "a path must have two waypoints at least", field=f"{where}[{i}]")
    if depth > 1:
        return tuple(_numbers(row, f"{where}[{i}]", depth - 1, most) for i, row in enumerate(value))
    if not all(isinstance(x, int | float) and not isinstance(x, bool) for x in value):
        raise RegionError("option_value", f"{where.rpartition('.')[2]} must be a list of numbers", field=where)
    return tuple(float(x) for x in value)


def _refused(one: Option, where: str, what: str) -> RegionError:
    return RegionError("option_value", f"{one.name} must be {what}", field=where)
