"""The migrations lead to the tables of the models, and back, on SQLite and on PostgreSQL."""

from __future__ import annotations

from datetime import timedelta

from sqlalchemy import inspect, select

from db import events, jobs, migrate, overlaps, pairs, regions, retention, scenes, subtrees, work
from db.models import IterationRow, SceneRow
from db.session import Database
from db.types import utcnow
from tests.db.builders import a_job, a_running_job, add_region, all_pairs, certified
from tests.scenes import slider


def tables(url: str) -> set[str]:
    database = Database(url)
    try:
        return set(inspect(database.reader).get_table_names())
    finally:
        database.close()


def there_and_back(database: Database, url: str, revision: str) -> Database:
    """The same database after the way down to a revision and up again."""
    database.close()
    migrate.downgrade(url, revision)
    migrate.upgrade(url)
    assert migrate.drift(url) == []
    return Database(url)


def test_an_empty_database_drifts(empty_database_url: str) -> None:
    assert migrate.drift(empty_database_url)


def test_upgrade_makes_the_models_tables_and_may_be_repeated(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    assert migrate.drift(empty_database_url) == []
    migrate.upgrade(empty_database_url)
    assert migrate.drift(empty_database_url) == []


def test_downgrade_leaves_nothing_and_upgrade_comes_back(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    migrate.downgrade(empty_database_url, "base")
    assert tables(empty_database_url) == {"alembic_version"}
    migrate.upgrade(empty_database_url)
    assert migrate.drift(empty_database_url) == []


def test_rows_survive_a_second_upgrade(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        scene_id = scenes.add(session, slider()).id
    migrate.upgrade(empty_database_url)
    with database.read() as session:
        assert scenes.get(session, scene_id).hash == slider().hash
    database.close()


def test_jobs_and_their_pairs_survive_the_way_down_and_up(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        job = a_running_job(session, pair_count=3)
        certify = {"kind": "certify", "iteration": 0}
        job.action, job_id = certify, job.id
        jobs.keep_growth(session, job, {"next": 1})
    migrate.downgrade(empty_database_url, "0001")
    migrate.upgrade(empty_database_url)
    assert migrate.drift(empty_database_url) == []
    with database.read() as session:
        job = jobs.get(session, job_id)
        assert (job.state, len(all_pairs(session, job_id))) == ("running", 3)
        assert (job.action, jobs.growth(session, job_id)) == (certify, {"next": 1})
        (row,) = session.scalars(select(IterationRow))
        assert (row.action["hard"], row.action["polytope"]["d"], row.failures, row.faces) == ([], [1.0, 1.0], 1, 2)
    database.close()


def test_a_job_under_way_goes_on_after_the_counts_were_introduced(empty_database_url: str) -> None:
    """One pair is settled, one is held, two are open; the holder's lease survives."""
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        job_id = a_running_job(session, pair_count=4).id
    done, held = (claimed(database, job_id) for _ in range(2))
    with database.write() as session:
        pairs.save(session, done, certified(done.pairs[0].index))
    database.close()
    migrate.downgrade(empty_database_url, "0007")
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.read() as session:
        job = jobs.get(session, job_id)
        assert (job.open_pairs, job.running_pairs) == (2, 1)
        assert jobs.awaiting_coordination(session, utcnow()) == []
    with database.write() as session:
        assert pairs.save(session, held, certified(held.pairs[0].index)) == pairs.Saved(held=False, finished=False)
    finished = []
    for _ in range(2):
        claim = claimed(database, job_id)
        with database.write() as session:
            finished.append(pairs.save(session, claim, certified(claim.pairs[0].index)).finished)
    assert finished == [False, True]
    database.close()


def test_iterations_stored_before_there_were_cells_say_that_they_have_none(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        job_id = a_running_job(session).id
    database.close()
    migrate.downgrade(empty_database_url, "0008")
    assert not {"partitions", "subtrees"}.intersection(tables(empty_database_url))
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.read() as session:
        (row,) = session.scalars(select(IterationRow))
        assert [row.action[name] for name in ("cells", "begun", "parts", "ending")] == [1, None, {}, []]
        assert {row.open_cells for row in all_pairs(session, job_id)} == {None}
    database.close()


def test_jobs_of_before_there_were_outlines_have_none_and_lose_those_that_are_left_alone(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        job_id = a_running_job(session, 2).id
        subtrees.keep(session, job_id, 0, {(0, 0): (b"subtrees", b"outline"), (1, 0): (b"", b"outline of a job that has ended")})
    database = there_and_back(database, empty_database_url, "0013")
    with database.read() as session:
        assert jobs.get(session, job_id).pieces is None
        assert [subtrees.left_of(session, job_id, pair, 0) for pair in range(2)] == [[b"subtrees"], []]
        assert subtrees.outlines(session, job_id, 0, 0, 0) == {0: {0: None}}
    database.close()


def test_regions_stored_before_there_were_boxes_have_their_limits_and_numbers(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        job = a_running_job(session)
        made = [add_region(session, job).id for _ in range(3)]
        scene_id = job.scene_id
    database = there_and_back(database, empty_database_url, "0011")
    with database.write() as session:
        assert regions.roll(session, scene_id) == (3, made)
        assert list(overlaps.numbers(session, scene_id).values()) == [(1, 0), (2, 0), (3, 0)]
        assert {(*box.lower, *box.upper) for box in regions.polytopes(session, made)} == {(-2.0, 2.0)}
        regions.delete(session, made[0])
        assert regions.roll(session, scene_id) == (4, made[1:])
    database.close()


def ids_of_new_events(database: Database) -> list[int]:
    """The ids of the events of a job that is deleted again."""
    with database.write() as session:
        job_id = a_job(session).id
        ids = [event.id for event in events.since(session, job_id)]
        jobs.cancel(session, job_id)
    with database.write() as session:
        retention.delete_job(session, job_id, dependents=False)
    return ids


def test_ids_of_events_go_on_from_the_largest_one_and_never_come_again(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        kept = events.since(session, a_job(session).id)[-1].id
    database = there_and_back(database, empty_database_url, "0021")
    with database.read() as session:
        assert events.last_id(session) == kept
    first, second = ids_of_new_events(database), ids_of_new_events(database)
    assert kept < min(first) <= max(first) < min(second)
    database.close()


def test_jobs_of_before_their_bytes_were_counted_count(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        job_id = a_job(session, given_labels={"team": "welding"}).id
    database = there_and_back(database, empty_database_url, "0022")
    with database.read() as session:
        assert jobs.get(session, job_id).bytes == jobs.ROW_BYTES + len('{"random_seed": 0}') + len("teamwelding")
    database.close()


def claimed(database: Database, job_id: str) -> pairs.Claim:
    with database.write() as session:
        claim = work.claim(session, job_id, lease_seconds=60, batch_seconds=0.5)
    assert isinstance(claim, pairs.Claim)
    return claim


def test_names_of_scenes_of_before_they_had_versions_mean_the_last_one(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        old, new = (scenes.add(session, slider(posts=posts)).id for posts in (1, 2))
        session.get_one(SceneRow, old).created_at = utcnow() - timedelta(days=1)
    database.close()
    migrate.downgrade(empty_database_url, "0014")
    assert "scene_names" not in tables(empty_database_url)
    migrate.upgrade(empty_database_url)
    assert migrate.drift(empty_database_url) == []
    database = Database(empty_database_url)
    with database.read() as session:
        assert scenes.find(session, slider().name) == new
        assert scenes.names(session, [old, new]) == {old: [], new: [slider().name]}
    database.close()
