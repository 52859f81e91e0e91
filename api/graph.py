"""This module answers which regions of a scene are connected, and compares those pairs of regions that nobody has compared yet."""

from __future__ import annotations

import time

from api.advice import seed_between
from api.free_sets import Mapped
from api.schemas.planning import Edge, Gap, GraphRegion, GraphResponse
from certifier.model import Scene
from certifier.outcome import Guarantee
from db import overlaps
from db.overlaps import Overlap
from db.session import Database
from planner.library import Library
from planner.overlap import compare, components, gap

COMPARE_SECONDS = 5.0
"""One request compares regions for about this many seconds."""
MOST_GAPS = 20
"""Gaps are looked for around at most this many components, the largest."""


def describe(db: Database, mapped: Mapped | None, scene_id: str, scene: Scene, library: Library) -> GraphResponse:
    """Returns the graph of the library's regions, after comparing pairs for at most COMPARE_SECONDS.

    Args:
        mapped: what the scene's latest map proves.
    """
    complete, known = compared(db, scene_id, library)
    number = {region_id: i for i, region_id in enumerate(library.ids)}
    parts = components(len(library), [(number[edge.earlier], number[edge.later]) for edge in known])
    part_of = {region: part for part, regions in enumerate(parts) for region in regions}
    return GraphResponse(
        scene=scene_id,
        version=library.version,
        regions=len(library),
        complete=complete,
        nodes=[
            GraphRegion(region=region_id, guarantee=Guarantee(guarantee), component=part_of[i])
            for i, (region_id, guarantee) in enumerate(zip(library.ids, library.guarantees, strict=True))
        ],
        edges=[Edge(a=edge.earlier, b=edge.later, depth=edge.depth, q=scene.to_q(edge.witness).tolist(), s=edge.witness) for edge in known],
        components=len(parts),
        gaps=_gaps(library, scene, parts, mapped) if complete else [],
        map=None if mapped is None else mapped.job,
    )


def compared(db: Database, scene_id: str, library: Library) -> tuple[bool, list[Overlap]]:
    """Compares pairs for at most COMPARE_SECONDS. Returns whether none is left, and what overlaps are known."""
    complete = _compare(db, scene_id, library, time.monotonic() + COMPARE_SECONDS)
    there = set(library.ids)
    with db.read() as session:
        return complete, [edge for edge in overlaps.all_of(session, scene_id) if edge.earlier in there and edge.later in there]


def _compare(db: Database, scene_id: str, library: Library, until: float) -> bool:
    """Compares regions of the library that were not compared yet, until the time is over, and saves what it finds.

    Returns:
        Whether all pairs of the library's regions have been compared.
    """
    with db.read() as session:
        known = overlaps.numbers(session, scene_id)
    rows = [(row, *known[region_id]) for row, region_id in enumerate(library.ids) if region_id in known]
    complete = True
    for compared in compare(library, rows, until):
        later = library.ids[compared.row]
        found = [Overlap(library.ids[other], later, common.depth, common.witness.tolist()) for other, common in compared.found]
        with db.write() as session:
            overlaps.save(session, scene_id, later, compared.reached, found)
        complete = compared.complete
    return complete


def _gaps(library: Library, scene: Scene, parts: list[list[int]], mapped: Mapped | None) -> list[Gap]:
    found = {frozenset((near.a, near.b)): near for part in parts[:MOST_GAPS] if (near := gap(library, part)) is not None}
    gaps = []
    for near in found.values():
        q_a, q_b = scene.to_q(near.s_a), scene.to_q(near.s_b)
        by_map = mapped is not None and bool(mapped.free.contains_motion(q_a, q_b))
        a, b = library.ids[near.a], library.ids[near.b]
        seed = seed_between(scene, library, near)
        gaps.append(Gap(a=a, b=b, distance=near.distance, q=seed, q_a=q_a.tolist(), q_b=q_b.tolist(), map=by_map))
    return gaps
