"""This module writes what the planner finds as parts of answers, with the ids of regions and with joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from api.libraries import Libraries
from api.schemas.planning import Near, Piece, Uncovered
from certifier.model import Scene
from certifier.outcome import Guarantee
from db import scenes
from db.session import Database
from planner.library import Library
from planner.motion import path
from planner.nearest import Nearest
from planner.tubes import Tubes


def asked(db: Database, libraries: Libraries, name: str) -> tuple[str, Scene, Library]:
    """Returns the id of the scene that a request names, the scene, and its regions as they are now."""
    with db.read() as session:
        scene_id = scenes.find(session, name)
    scene = scenes.load(db, scene_id)
    return scene_id, scene, libraries.of(db, scene_id, scene.n)


def pieces(library: Library, tubes: Tubes, stretches: Sequence[path.Stretch], map_job: str | None = None) -> list[Piece]:
    """Returns the pieces of a motion, each with the region, the motion or the job of the map that proves it."""
    return [Piece(begin=s.begin, end=s.end, **_proved_by(library, tubes, s.region, map_job)) for s in stretches]


def _proved_by(library: Library, tubes: Tubes, number: int, map_job: str | None) -> dict[str, Any]:
    if number < len(library):
        return {"region": library.ids[number], "guarantee": guarantee(library, number)}
    if number < len(library) + len(tubes):
        return {"region": None, "motion": tubes.motions[number - len(library)].id, "guarantee": Guarantee.EXACT}
    return {"region": None, "map": map_job, "guarantee": Guarantee.EXACT}


def uncovered(library: Library, scene: Scene, stop: path.Uncovered | None) -> Uncovered | None:
    if stop is None:
        return None
    return Uncovered(
        time=stop.time,
        segment=stop.segment,
        q=stop.q.tolist(),
        s=None if stop.s is None else stop.s.tolist(),
        next=near(library, scene, stop.next),
    )


def near(library: Library, scene: Scene, found: Nearest | None, map_job: str | None = None) -> Near | None:
    if found is None:
        return None
    return Near(
        region=None if found.region is None else library.ids[found.region],
        map=map_job if found.region is None else None,
        guarantee=Guarantee.EXACT if found.region is None else guarantee(library, found.region),
        distance=found.distance,
        q=scene.to_q(found.s).tolist(),
        s=found.s.tolist(),
    )


def guarantee(library: Library, region: int) -> Guarantee:
    return Guarantee(library.guarantees[region])
