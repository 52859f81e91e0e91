"""The migrations lead to the tables of the models, and back, on SQLite and on PostgreSQL."""

from __future__ import annotations

from dataclasses import replace

import pytest
from sqlalchemy import inspect, select, text

from certifier.errors import CirisError
from db import clock, jobs, migrate, pairs, regions, scenes, solver_time, work
from db.models import DEFAULT_PROJECT, IterationRow, SolverTimeRow
from db.session import Database
from tests.db.builders import a_job, a_running_job, add_iteration, add_region, all_pairs
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
    database = there_and_back(database, empty_database_url, "0025")
    with database.read() as session:
        job = jobs.get(session, job_id)
        assert (job.state, len(all_pairs(session, job_id))) == ("running", 3)
        assert (job.action, jobs.growth(session, job_id)) == (certify, {"next": 1})
        (row,) = session.scalars(select(IterationRow))
        assert (row.action["hard"], row.action["polytope"]["d"], row.failures, row.faces) == ([], [1.0, 1.0], 1, 2)
    database.close()


def test_what_is_held_on_the_way_up_is_held_since_nobody_knows_when(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        job = a_running_job(session, pair_count=1)
        jobs.coordinate(job, clock.now(session), 60)
        session.flush()
        assert work.claim(session, job.id, lease_seconds=60, batch_seconds=0.5) is not None
        job_id = job.id
    with database.read() as session:
        (before,) = all_pairs(session, job_id)
        assert before.lease_since is not None
        assert jobs.get(session, job_id).coordinator_since is not None
    database = there_and_back(database, empty_database_url, "0040")
    with database.read() as session:
        (after,) = all_pairs(session, job_id)
        assert (after.worker, after.lease_token, after.lease_until) == (before.worker, before.lease_token, before.lease_until)
        assert (after.lease_since, jobs.get(session, job_id).coordinator_since) == (None, None)
    database.close()


def test_the_time_that_a_project_has_used_survives_the_way_down_and_up(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        solver_time.add(session, DEFAULT_PROJECT, 1.0)
        for key in ("a", "b"):
            solver_time.add(session, DEFAULT_PROJECT, 2.0, key)
    database = there_and_back(database, empty_database_url, "0044")
    with database.read() as session:
        assert solver_time.used(session, DEFAULT_PROJECT) == 5.0
        assert [row.key_id for row in session.scalars(select(SolverTimeRow))] == [""]
    database.close()


def test_iterations_of_before_say_of_each_pair_when_it_was_begun(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database, of_before = Database(empty_database_url), {0: None, 1: 0, 2: 0}
    with database.write() as session:
        job = a_running_job(session, pair_count=3)
        for index in (1, 2):
            rows, begun = [pairs.NewPair(i, f"a{i}", f"b{i}", 1.0) for i in (0, 2)], {0: 0, 2: 0 if index == 1 else 1}
            add_iteration(session, job, index=index, label="cells", C=[[1.0], [-1.0]], d=[1.0, 1.0], pairs=rows, begun=begun)
    database.close()
    migrate.downgrade(empty_database_url, "0029")
    database = Database(empty_database_url)
    with database.read() as session:
        assert {row.index: row.action["begun"] for row in session.scalars(select(IterationRow))} == of_before
    database.close()
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.read() as session:
        found = {row.index: row.action["begun"] for row in session.scalars(select(IterationRow))}
    database.close()
    assert found == {0: {}, 1: {"0": 0, "2": 0}, 2: {"0": 0, "2": 0}}


def test_what_lists_show_of_a_region_survives_the_way_down_and_up(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.write() as session:
        region = add_region(session, a_job(session))
        region_id, summary = region.id, region.summary
    database = there_and_back(database, empty_database_url, "0026")
    with database.read() as session:
        assert regions.get(session, region_id).summary == summary
    database.close()


def test_named_configurations_survive_the_way_down_and_up(empty_database_url: str) -> None:
    """Before, all names of a scene had one home; the way up gives it to each of them."""
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    (joint,) = (joint.name for joint in slider().moving)
    with database.write() as session:
        scene_id = scenes.add(session, replace(slider("one"), configurations={"home": {joint: 0.1}})).id
        scenes.add(session, slider("two"))
    database = there_and_back(database, empty_database_url, "0033")
    with database.read() as session:
        assert scenes.known(session, "one").agreed == {"home": {joint: 0.1}}
        assert scenes.known(session, "two").agreed == {"home": {joint: 0.1}}
        assert "configurations" not in scenes.get(session, scene_id).document
    database.close()


def test_a_database_of_another_version_is_refused_with_the_way_to_it(empty_database_url: str) -> None:
    migrate.upgrade(empty_database_url)
    database = Database(empty_database_url)
    with database.writer.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '0007'"))
    database.close()
    with pytest.raises(CirisError, match="0007") as refused:
        migrate.upgrade(empty_database_url)
    assert refused.value.code == "database_version"
