"""These pages have two jobs, or two versions of a scene, side by side."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from fastapi import APIRouter, Request, Response

from api.access import Db
from api.pages import copies
from api.pages.job import elapsed
from api.pages.rendering import page
from api.parameters import KNOWN_TO_PAGE
from api.routers import jobs, regions, scenes
from certifier.conditions import of_condition
from certifier.model import Scene
from db import pairs
from db import scenes as stored
from db.session import Database
from jobs.registry import KINDS

router = APIRouter()

ABSENT = "\N{EN DASH}"
LISTED = 100
"""The page lists at most this many names of each kind."""


@router.get("/compare/jobs", dependencies=[KNOWN_TO_PAGE])
def compare_jobs_page(request: Request, a: str, b: str, db: Db) -> Response:
    """Shows two jobs side by side: how their requests differ, and with what results."""
    both = [jobs.get_job(job_id, db) for job_id in (a, b)]
    with db.read() as session:
        spent, begun = ([look(session, job.id) for job in both] for look in (pairs.seconds, pairs.begun))
    options = [_flat(job.options) for job in both]
    names = dict.fromkeys([*options[0], *options[1]])
    known = [(name, [one.get(name, ABSENT) for one in options]) for name in names]
    context = {
        "both": both,
        "kinds": [KINDS[job.kind] for job in both],
        "names": [scenes.get_scene(job.scene, db).name for job in both],
        "elapsed": [elapsed(job) for job in both],
        "sizes": [regions.get_region(job.region, db).q_volume if job.region else None for job in both],
        "spent": spent,
        "begun": begun,
        "differ": [(name, values) for name, values in known if values[0] != values[1]],
        "alike": sum(values[0] == values[1] for _, values in known),
        "shown": [{"id": job.id, "kind": job.kind} for job in both],
        "copied": copies.of_two("job", (both[0].id, both[1].id)),
    }
    return page(request, "compare_jobs.html", context)


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    """Returns the values of a document by their places, such as ``seed.q``. Lists stay whole."""
    if not isinstance(value, dict):
        return {name: value}
    return {place: one for key, part in value.items() for place, one in _flat(part, f"{name}.{key}" if name else key).items()}


@router.get("/compare/scenes", dependencies=[KNOWN_TO_PAGE])
def compare_scenes_page(request: Request, a: str, b: str, db: Db) -> Response:
    """Shows what is in one scene and not in the other, and what changed. Everything is matched by its name."""
    both = [scenes.get_scene(scene, db) for scene in (a, b)]
    first, second = (_described(db, scene.id) for scene in both)
    context = {"both": both, "changes": [(kind, *_changes(first[kind], second[kind])) for kind in first], "listed": LISTED}
    return page(request, "compare_scenes.html", context | {"copied": copies.of_two("scene", (both[0].id, both[1].id))})


def _described(db: Database, scene_id: str) -> dict[str, dict[Hashable, Any]]:
    """Returns the parts of a scene: kind -> name -> what is compared of it."""
    scene: Scene = stored.load(db, scene_id)
    document = scene.to_document()
    own = [geometry for geometry in document["geometries"] if not of_condition(geometry["name"])]
    of_bodies = [pair for pair in scene.pairs if not of_condition(pair.a) and not of_condition(pair.b)]
    return {
        "Bodies": dict.fromkeys(body for body in document["bodies"] if not of_condition(body)),
        "Geometries": {geometry["name"]: geometry for geometry in own},
        "Pairs of bodies": {f"{pair.a} \N{EN DASH} {pair.b}": scene.padding_of(pair) for pair in of_bodies},
        "Joint limits": {
            joint.name: (joint.unit, low, high) for joint, low, high in zip(scene.moving, scene.q_lower, scene.q_upper, strict=True)
        },
        "Conditions": {condition.name: str(condition) for condition in scene.conditions},
    }


def _changes(first: Mapping[Any, Any], second: Mapping[Any, Any]) -> tuple[Sequence[Any], Sequence[Any], Sequence[Any], int]:
    """Returns what came, what went, what changed (with both values), and how many are as they were."""
    came, gone = [name for name in second if name not in first], [name for name in first if name not in second]
    changed = [(name, first[name], second[name]) for name in first if name in second and first[name] != second[name]]
    return came, gone, changed, len(first) - len(gone) - len(changed)
