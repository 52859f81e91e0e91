"""These functions make of what an engineer has, such as arrays, what the service takes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NotRequired, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from certifier.errors import CirisError, RegionError, close_matches
from ciris.documents import Document, given
from ciris.options import GROW, Fields, GrowOptions
from ciris.space import Array, Straight, numbers

_WAYS = "give waypoints as q or s, or a curve: bezier, or knots with control_points"


class FramePose(TypedDict):
    """A pose of a frame in the world: the body's name, position (3,) in metres, and roll, pitch and yaw (3,) in radians."""

    frame: str
    position: ArrayLike
    rpy: NotRequired[ArrayLike]


class Tolerance(TypedDict, total=False):
    """How far a frame may be from a line, in metres and radians; the service's defaults where they are missing."""

    metres: float
    radians: float


def grow_request(scene: str, q: ArrayLike, options: GrowOptions) -> Document:
    """Returns the request of a job that grows a region around q, (n,)."""
    asked = asked_for(options, GROW)
    return {"kind": "grow", "scene": scene, **asked, "seed": {"q": plain(q, "q"), **asked.get("seed", {})}}


def asked_for(options: Mapping[str, Any], fields: Fields) -> Document:
    """Returns the options that are given as the request has them; None stands for the service's default.

    Raises:
        CirisError: unknown_option, argument.
        RegionError: points.
    """
    asked: Document = {}
    for name, value in options.items():
        if name not in fields:
            groups = [group for group, (_, takes) in fields.items() if not isinstance(takes, str) and name in takes]
            hint = f"give it in {groups[0]}" if groups else close_matches(name, list(fields)) or f"options: {', '.join(fields)}"
            raise CirisError("unknown_option", f"there is no option {name!r}", field=name, hint=hint)
        if value is not None:
            field, takes = fields[name]
            *places, last = field.split(".")
            inside = asked
            for place in places:
                inside = inside.setdefault(place, {})
            inside[last] = _taken(name, value, takes)
    return asked


def _taken(name: str, value: Any, takes: str | Fields) -> Any:
    match takes:
        case "point":
            return plain(value, name)
        case "points":
            return _rows(value, name)
        case "paths":
            if not isinstance(value, Iterable) or isinstance(value, str):
                raise CirisError("argument", f"{type(value).__name__} is no paths", field=name, hint="give a list of (k, n) arrays")
            return [_rows(path, f"{name}[{i}]") for i, path in enumerate(value)]
        case str():
            return value
    if not isinstance(value, Mapping):
        raise CirisError("argument", f"{type(value).__name__} is no options", field=name, hint="give a dict of options")
    return asked_for(value, takes)


def plain(value: ArrayLike | str | None, field: str) -> Any:
    """Returns an array, or what numpy makes one of, as nested lists; a text, such as an id, and None as they are.

    Texts may stand in lists as well, in the place of the joint positions (n,) that they name.

    Raises:
        RegionError: points.
    """
    if value is None or isinstance(value, str):
        return value
    if _names(value):
        assert isinstance(value, list | tuple)
        found = [plain(one, f"{field}[{i}]") for i, one in enumerate(value)]
        if len({_axes(one) for one in found}) > 1:
            hint = "names stand in the place of whole configurations"
            raise RegionError("points", "names and numbers stand in one row", field=field, hint=hint)
        return found
    return numbers(value, field).tolist()


def _names(value: object) -> bool:
    """Returns whether there is a text in nested lists."""
    return isinstance(value, list | tuple) and any(isinstance(one, str) or _names(one) for one in value)


def _rows(value: Any, field: str) -> Any:
    """Returns points, (k, n), as nested lists, also where one was given alone."""
    return [value] if isinstance(value, str) else plain(value, field) if _names(value) else np.atleast_2d(numbers(value, field)).tolist()


def _axes(value: Any) -> int:
    """Returns the number of axes of nested lists, in which a text stands for (n,)."""
    return 1 if isinstance(value, str) else 1 + _axes(value[0]) if isinstance(value, list) and value else 0


def straight(space: Straight | None, s: ArrayLike | None) -> str:
    """Returns in which coordinates a motion is straight: in those that it is given in, unless ``space`` says otherwise."""
    return space or ("q" if s is None else "s")


def points(axes: int, **values: ArrayLike | None) -> Document:
    """Returns points as nested lists with this number of axes, by the name under which they were given; the first axis may be missing.

    Raises:
        RegionError: points.
    """
    found = {
        name: plain(value, name) if name == "q" else numbers(value, name).tolist() for name, value in values.items() if value is not None
    }
    if len(found) != 1:
        hint = "q are joint positions, s tangent-space coordinates: give one of them"
        raise RegionError("points", "the points must be given either as q or as s", field="q", hint=hint)
    ((name, nested),) = found.items()
    if _axes(nested) not in (axes - 1, axes):
        raise RegionError("points", f"it must be finite numbers in {axes - 1} or {axes} axes, joints last", field=name)
    return {name: nested if _axes(nested) == axes else [nested]}


def motion_request(
    scene: str,
    *,
    q: ArrayLike | None,
    s: ArrayLike | None,
    bezier: ArrayLike | None,
    knots: ArrayLike | None,
    control_points: ArrayLike | None,
    space: Straight | None,
) -> Document:
    """Returns what every request about a motion has: the scene, and the motion, which is given in one way.

    Raises:
        RegionError: points.
    """
    ways = given(q=q, s=s, bezier=bezier, knots=knots, control_points=control_points)
    if tuple(ways) not in (("q",), ("s",), ("bezier",), ("knots", "control_points")):
        message = f"the motion is given by {' and '.join(ways)}" if ways else "the motion is missing"
        raise RegionError("points", message, field=next(reversed(ways), "q"), hint=_WAYS)
    if knots is None:
        motion = points(2 if bezier is None else 3, **ways)
    else:
        motion = {name: _in_axes(axes, name, ways[name]).tolist() for name, axes in (("knots", 1), ("control_points", 2))}
    return {"scene": scene, **motion, "space": straight(space, s)}


def _in_axes(axes: int, name: str, values: ArrayLike) -> Array:
    array = numbers(values, name)
    if array.ndim != axes:
        message = f"it has the shape {array.shape}"
        raise RegionError("points", message, field=name, hint="knots are (k + m + 1,), control_points (k, n), joints last")
    return array
