"""The version of a scene's regions, and the overlaps that are kept of them, on both databases."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from db import overlaps, regions
from db.overlaps import Overlap
from db.session import Database
from tests.db.builders import a_running_job, add_region


def three_regions(db: Database) -> tuple[str, list[str]]:
    """The id of a scene, and those of its three regions in the order of their numbers."""
    with db.write() as session:
        job = a_running_job(session)
        made = [add_region(session, job).id for _ in range(3)]
        return job.scene_id, made


def test_every_change_of_the_regions_counts_once_even_at_once(db: Database) -> None:
    with db.write() as session:
        job = a_running_job(session)
        scene_id = job.scene_id

    def add(_: int) -> str:
        with db.write() as session:
            return add_region(session, a_running_job(session)).id

    with ThreadPoolExecutor(4) as pool:
        made = set(pool.map(add, range(12)))
    with db.read() as session:
        version, ids = regions.roll(session, scene_id)
        assert (version, set(ids)) == (12, made)
        assert [number for number, _ in overlaps.numbers(session, scene_id).values()] == list(range(1, 13))


def test_overlaps_are_saved_once_and_go_with_their_regions(db: Database) -> None:
    scene_id, (a, b, c) = three_regions(db)
    first, second = Overlap(a, b, 0.25, [0.5]), Overlap(a, c, 0.125, [0.25])
    for _ in range(2):
        with db.write() as session:
            overlaps.save(session, scene_id, b, 1, [first])
            overlaps.save(session, scene_id, c, 2, [second])
            overlaps.save(session, scene_id, c, 1, [])
    with db.read() as session:
        assert overlaps.all_of(session, scene_id) == [first, second]
        assert overlaps.numbers(session, scene_id) == {a: (1, 0), b: (2, 1), c: (3, 2)}
    with db.write() as session:
        regions.delete(session, b)
    with db.read() as session:
        assert overlaps.all_of(session, scene_id) == [second]


def test_what_is_found_of_regions_that_are_gone_is_left_out(db: Database) -> None:
    scene_id, (a, b, c) = three_regions(db)
    with db.write() as session:
        regions.delete(session, a)
    with db.write() as session:
        overlaps.save(session, scene_id, c, 2, [Overlap(a, c, 0.25, [0.5]), Overlap(b, c, 0.25, [0.5])])
        overlaps.save(session, scene_id, a, 1, [])
    with db.read() as session:
        assert overlaps.all_of(session, scene_id) == [Overlap(b, c, 0.25, [0.5])]
