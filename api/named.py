"""The names of configurations in a request become joint positions here, before anything else looks at the request."""

from __future__ import annotations

import re
from typing import Any, TypeVar

from pydantic import BaseModel

from certifier.configurations import is_known, positions
from certifier.errors import RegionError
from certifier.model import Scene
from db import scenes
from db.scenes import Known
from db.session import Database
from jobs.fields import Named, NamedOrRegion

Body = TypeVar("Body", bound=BaseModel)
_ID = re.compile(r"[0-9a-f-]{4,64}")


def with_positions(db: Database, scene: Scene, body: Body) -> Body:
    """Returns a request with joint positions in the place of the names of configurations; the id of a region stays.

    The names mean what the scene file says that was added last under the name of the scene in the request.

    Raises:
        RegionError: ``unknown_configuration``, ``configuration``; the field names the place.
    """
    if not _has_names(body):
        return body
    with db.read() as session:
        known = scenes.known(session, body.scene)  # type: ignore[attr-defined]
    filled: Body = _filled(body, scene, known, "")
    return filled


def _has_names(value: Any) -> bool:
    match value:
        case Named():
            return True
        case BaseModel():
            return any(_has_names(member) for _, member in value)
        case [int() | float(), *_]:
            return False
        case list():
            return any(map(_has_names, value))
        case _:
            return False


def _filled(value: Any, scene: Scene, known: Known, field: str) -> Any:
    match value:
        case NamedOrRegion() if not any(is_known(value, one) for one in known.of_names.values()) and _ID.fullmatch(value):
            return str(value)
        case Named():
            return _meant(value, scene, known, field)
        case BaseModel():
            changed = {
                name: _filled(member, scene, known, f"{field}.{name}".removeprefix(".")) for name, member in value if _has_names(member)
            }
            return value.model_copy(update=changed)
        case list() if _has_names(value):
            return [_filled(member, scene, known, f"{field}[{i}]") for i, member in enumerate(value)]
        case _:
            return value


def _meant(text: str, scene: Scene, known: Known, field: str) -> list[float]:
    """Returns what names of configurations mean, (n,) in radians or metres: the same under all names of the scene that have them.

    Raises:
        RegionError: ``unknown_configuration``, ``configuration``.
    """
    joints, q_star = [joint.name for joint in scene.moving], scene.q_star.tolist()
    found: dict[str, list[float]] = {}
    for name, configurations in (known.of_names or {"": {}}).items():
        try:
            found[name] = positions(text, configurations, joints, q_star, field)
        except RegionError as error:
            problem = error
    if not found:
        raise problem
    (one, first), *others = found.items()
    for other, second in others:
        if second != first:
            message = f"{text!r} means other positions under the scene's name {one!r} than under {other!r}"
            raise RegionError("configuration", message, field=field, hint="name the scene in the place of its id, or write NAME@ID")
    return first
