"""What was typed for the options of a job becomes the request for it."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from typing import Any

from certifier.errors import CirisError
from certifier.options import Option, Takes, fits, within
from ciris.documents import Document
from client.inputs import Given, configuration, labels
from client.options import JOB, Part


def request(args: Namespace, parts: tuple[Part, ...]) -> Document:
    """Returns the options that were given, as a request has them.

    Raises:
        CirisError: ``option`` for a member of a group that was not asked for; or as the readers of lists and files.
    """
    asked: Document = {part.place: {} for part in parts if part.place}
    flags = {field: one.argument for part in parts for field, one in part.fields() if one.takes is Takes.GROUP}
    for field, one, value in _given(args, parts):
        *places, name = field.split(".")
        group = ".".join(places)
        if group in flags and getattr(args, group) is None:
            raise _belongs(one, flags[group])
        inside = asked
        for place in places:
            inside = inside[place]
        inside[name] = _value(one, value)
    return asked


def refuse_options(args: Namespace, parts: tuple[Part, ...], flag: str) -> None:
    """Refuses options that are of no use without another one.

    Args:
        flag: the other one.

    Raises:
        CirisError: option, for the first of them that was given.
    """
    for _, one, _ in _given(args, parts):
        raise _belongs(one, flag)


def refuse_of_service(args: Namespace) -> None:
    """Refuses, with ``--local``, options that only jobs of a service have.

    Raises:
        CirisError: option, for the first of them that was given.
    """
    for _, one, _ in _given(args, JOB):
        if one.name != "deadline_seconds":
            raise CirisError("option", "is only for jobs of the service", field=f"--{one.argument}", hint="leave out it or --local")


def _belongs(one: Option, flag: str) -> CirisError:
    return CirisError("option", f"is an option of --{flag}", field=f"--{one.argument}", hint=f"add --{flag}")


def _given(args: Namespace, parts: tuple[Part, ...]) -> Iterator[tuple[str, Option, Any]]:
    for part in parts:
        for field, one in part.fields():
            value = getattr(args, field)
            if value is not None:
                yield field, one, value


def _value(one: Option, value: Any) -> Any:
    argument = f"--{one.argument}"
    match one.takes:
        case Takes.GROUP:
            return {}
        case Takes.POINT:
            return configuration(value, argument)
        case Takes.POINTS:
            return [configuration(text, f"{argument}[{i}]") for i, text in enumerate(value)]
        case Takes.PATHS:
            return [_waypoints(path) for path in value]
        case Takes.LABELS:
            return labels(value)
        case Takes.WHOLE | Takes.REAL if not fits(one, value):
            raise CirisError("option_value", f"must be {within(one)}", field=argument)
    return value


def _waypoints(path: str) -> list[Given]:
    """Returns the waypoints of a file, which have to be joint positions."""
    from client.path_files import path_file  # which needs numpy

    read = path_file(path)
    if "q" not in read.motion:
        message = f"{path} has no waypoints in q; a path to cover is straight in q between them"
        raise CirisError("option", message, field="--path", hint="give waypoints in q")
    waypoints: list[Given] = read.motion["q"]
    return waypoints
