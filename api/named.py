"""The names of configurations in a request become joint positions here, before anything else looks at the request."""

from __future__ import annotations

import re
from typing import Any, TypeVar

from pydantic import BaseModel

from certifier.configurations import Configurations, is_known, positions
from certifier.model import Scene
from db import scenes
from db.session import Database
from jobs.fields import Named, NamedOrRegion

Body = TypeVar("Body", bound=BaseModel)
_ID = re.compile(r"[0-9a-f-]{4,64}")


def with_positions(db: Database, scene_id: str, scene: Scene, body: Body) -> Body:
    """Returns a request with joint positions in the place of the names of configurations; the id of a region stays.

    The names mean what the scene file says that was added last: the row has it, and the scene in memory may be older.

    Raises:
        RegionError: ``unknown_configuration``, ``configuration``; the field names the place.
    """
    if not _has_names(body):
        return body
    with db.read() as session:
        known = scenes.get(session, scene_id).document.get("configurations", {})
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


def _filled(value: Any, scene: Scene, known: Configurations, field: str) -> Any:
    match value:
        case NamedOrRegion() if not is_known(value, known) and _ID.fullmatch(value):
            return str(value)
        case Named():
            return positions(value, known, [joint.name for joint in scene.moving], scene.q_star.tolist(), field)
        case BaseModel():
            changed = {
                name: _filled(member, scene, known, f"{field}.{name}".removeprefix(".")) for name, member in value if _has_names(member)
            }
            return value.model_copy(update=changed)
        case list() if _has_names(value):
            return [_filled(member, scene, known, f"{field}[{i}]") for i, member in enumerate(value)]
        case _:
            return value
