"""The arguments of commands that start jobs are made here, from the tables in which the options are written (certifier.options).

The destination of each argument is the field of the request that it fills, such as ``options.cells``. So the parser also says which
argument an error is about (:func:`typed`).
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from certifier.errors import CirisError
from certifier.growth.options import CertifyOptions, GrowthOptions, RecertifyOptions
from certifier.jobs.options import JobOptions
from certifier.map.options import MapOptions
from certifier.options import Option, Takes, table
from certifier.seeding.options import GIVEN, SeedOptions
from planner.cover.options import CoverOptions

JOINTS = '"0,0.3,..."'
_FILES = "The file is npz, JSON, YAML or CSV with q (K x n). "
SEED = next(one for one in table(SeedOptions) if one.name == "q")
"""Where a region grows around. The command and the Python client take it in ways of their own."""


@dataclass(frozen=True)
class Part:
    """The options that a part of a request has.

    Attributes:
        cls: the dataclass that says which.
        place: the field of the request that the part is; "" for the request itself.
        without: options, and choices of options, that are not typed by their own names.
    """

    cls: type
    place: str = ""
    without: tuple[str, ...] = ()

    @property
    def options(self) -> tuple[Option, ...]:
        """Returns the options that are typed."""
        left = (one for one in table(self.cls) if one.name not in self.without)
        return tuple(replace(one, choices=tuple(choice for choice in one.choices if choice not in self.without)) for one in left)

    def field(self, one: Option) -> str:
        """Returns the field of the request that an option is."""
        return f"{self.place}.{one.name}".removeprefix(".")

    def group(self, one: Option) -> Part:
        """Returns the options of a group."""
        assert one.cls is not None
        return Part(one.cls, self.field(one), self.without)

    def fields(self) -> Iterator[tuple[str, Option]]:
        """Yields the options with their fields, each group before its members."""
        for one in self.options:
            yield self.field(one), one
            if one.takes is Takes.GROUP:
                yield from self.group(one).fields()


JOB = (Part(JobOptions),)
GROW = (Part(SeedOptions, "seed", (SEED.name, *GIVEN)), Part(GrowthOptions, "options"), *JOB)
COVER = (Part(CoverOptions, "options"), *JOB)
MAP = (Part(MapOptions, "options"), *JOB)
CERTIFY = (Part(CertifyOptions), *JOB)
RECERTIFY = (Part(RecertifyOptions), *JOB)


def add_options(parser: argparse.ArgumentParser, parts: tuple[Part, ...]) -> None:
    """Adds an argument for every option. What is not given is None, and the service or the certifier has a default for it."""
    for part in parts:
        for field, one in part.fields():
            parser.add_argument(f"--{one.argument}", dest=field, help=about(one), **_taking(one))


def _taking(one: Option) -> dict[str, Any]:
    match one.takes:
        case Takes.FLAG | Takes.GROUP:
            return {"action": "store_const", "const": True}
        case Takes.CHOICE:
            return {"choices": one.choices}
        case Takes.WHOLE:
            return {"type": int, "metavar": "N"}
        case Takes.REAL:
            return {"type": _real, "metavar": {"s": "SECONDS", "m": "METRES"}.get(one.unit, one.unit.upper() or "X")}
        case Takes.POINT:
            return {"metavar": JOINTS}
        case Takes.POINTS | Takes.PATHS | Takes.LABELS:
            written = {Takes.POINTS: JOINTS, Takes.PATHS: "FILE", Takes.LABELS: "NAME=VALUE"}
            return {"metavar": written[one.takes], "action": "append"}


def _real(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number")
    return value


def about(one: Option) -> str:
    """Returns the help text of an option."""
    told = one.explained
    if one.takes in (Takes.POINTS, Takes.PATHS, Takes.LABELS):
        told += f" {_FILES if one.takes is Takes.PATHS else ''}May be repeated."
    told = told.replace("`", "").replace("%", "%%").rstrip(".")
    return f"{told[0].lower()}{told[1:]}" if re.match(r"[A-Z][a-z ]", told) else told


def typed(error: CirisError, parser: argparse.ArgumentParser) -> CirisError:
    """Returns the error with the argument that was typed in the place of the field that it fills."""
    arguments = {action.dest: action.option_strings[-1] for action in parser._actions if action.option_strings}
    named = "labels" if (error.field or "").startswith("labels.") else error.field or ""
    matches = [field for field in arguments if re.match(rf"{re.escape(field)}(?![\w.])", named)]
    if not matches:
        return error
    field = max(matches, key=len)
    place = named.removeprefix(field)
    message = error.message.removeprefix(f"{field.rpartition('.')[2]}{place} ")
    return type(error)(error.code, message, field=f"{arguments[field]}{place}", hint=error.hint)
