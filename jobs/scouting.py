"""A look at how much of a scene its regions cover, for a cover (planner.cover). A process keeps what it knows from one look to the next."""

from __future__ import annotations

import math
from functools import lru_cache, partial

from cachetools import LRUCache

from certifier import stored
from certifier.model import Scene
from certifier.pair.collisions import in_collision
from db import jobs, overlaps, regions
from db.overlaps import Overlap
from db.session import database
from db.transaction import persistently
from jobs.scenes import load_scene
from planner.cover.known import Known
from planner.cover.look import Look
from planner.cover.options import CoverOptions
from planner.cover.state import CoverState, Scouted
from planner.library import Library, renewed
from planner.overlap import compare

MOST = 4
"""Number of scenes whose regions are kept, those that were looked at last."""
_libraries: LRUCache[str, Library] = LRUCache(MOST)


def scout(scene: Scene, scene_id: str, job_id: str) -> Scouted:
    """Looks at the scene for a cover, and returns what was seen.

    Raises:
        RegionError: as :class:`planner.cover.look.Look`.
    """

    state = state_of(job_id)
    known = persistently(lambda: _known(scene, scene_id))
    return _look(scene_id, job_id)(known, state)


def state_of(job_id: str) -> CoverState:
    """Returns what a cover that has begun remembers."""

    def read() -> CoverState:
        with database().read() as session:
            growth = jobs.growth(session, job_id)
            assert growth is not None, "a cover has begun when it asks for a step"
            return stored.value(CoverState, growth)

    return persistently(read)


@lru_cache(maxsize=4)
def _look(scene_id: str, job_id: str) -> Look:
    """Returns who looks at the scene for a cover, with samples of its own."""

    def read() -> CoverOptions:
        with database().read() as session:
            return CoverOptions.from_document(jobs.get(session, job_id).options)

    scene = load_scene(scene_id)
    return Look(scene, partial(in_collision, scene), persistently(read))


def _known(scene: Scene, scene_id: str) -> Known:
    """Returns the regions of the scene and their overlaps, after comparing those that were not compared yet."""
    library = _library(scene, scene_id)
    row = {region_id: i for i, region_id in enumerate(library.ids)}
    with database().read() as session:
        numbers = overlaps.numbers(session, scene_id)
    linked = [(row[region_id], *numbers[region_id]) for region_id in library.ids if region_id in numbers]
    for compared in compare(library, linked, math.inf):
        later = library.ids[compared.row]
        found = [Overlap(library.ids[other], later, common.depth, common.witness.tolist()) for other, common in compared.found]
        with database().write() as session:
            overlaps.save(session, scene_id, later, compared.reached, found)
    with database().read() as session:
        edges = overlaps.all_of(session, scene_id)
    return Known.of(library, [(row[e.earlier], row[e.later], e.witness) for e in edges if e.earlier in row and e.later in row])


def _library(scene: Scene, scene_id: str) -> Library:
    library = _libraries.get(scene_id) or Library(scene.n)
    with database().read() as session:
        if regions.version(session, scene_id) != library.version:
            library = renewed(library, partial(regions.roll, session, scene_id), partial(regions.polytopes, session))
    _libraries[scene_id] = library
    return library
